"""Age of a truck, and the changes between its calibration and its use."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeVar

from clutchid.names import check_names
from clutchid.truck.vehicle import Vehicle

_Kind = TypeVar("_Kind", bound=Vehicle)

#: Named changes and what they are: those whose effect on a calibrated reading is to be known.
CHANGES: Mapping[str, str] = MappingProxyType({
    "supply": "supply pressure 5 % lower",
    "cold": "30 K colder, viscous friction of the grease doubled",
    "warm": "30 K warmer, viscous friction of the grease 0.6 times as large",
    "valves": "valves pass 7 % less and are 20 % slower",
    "seals": "friction of the seals 40 % larger",
})  # fmt: skip

#: Change of temperature in K, and factor of the viscous friction that belongs to it.
_TEMPERATURES = {"cold": (-30.0, 2.0), "warm": (30.0, 0.6)}


def aged(truck: _Kind, wear: float = 0.0, cycles: float = 0.0) -> _Kind:
    """`truck` after additional wear and strokes.

    Wear moves the working point of the diaphragm, the touch point of the clutch and the engaged rest of the piston;
    strokes increase seal friction and leakage and relax the springs, each part by a law of its own. The parameters of
    the new truck are kept; `wear` and `cycles` accumulate.

    Parameters
    ----------
    wear : m
        Additional wear of the facing.
    cycles : 1
        Additional strokes.

    Raises
    ------
    ParameterError
        If the wear is negative or more than the facing allows.

    Examples
    --------
    >>> from clutchid.truck import Truck
    >>> old = aged(aged(Truck(), wear=1e-3, cycles=2e5), wear=1e-3)
    >>> old.wear, old.cycles
    (0.002, 200000.0)
    """
    return truck.replace({"wear": truck.wear + wear, "cycles": truck.cycles + cycles})


def changed(truck: _Kind, *changes: str) -> _Kind:
    """`truck` after changes between its calibration and its use, each by its name in `CHANGES`, one after the other.

    Raises
    ------
    ParameterError
        If a change is unknown, the text names the nearest one; or if the truck does not admit it.

    Examples
    --------
    >>> from clutchid.truck import Truck
    >>> f"{changed(Truck(), 'supply', 'seals').F_C:.0f} N"
    '196 N'
    """
    check_names(changes, CHANGES, "change")
    for name in changes:
        if name in _TEMPERATURES:
            truck = _at_temperature(truck, *_TEMPERATURES[name])
        else:
            factors = [item for part in truck.parts for item in part.factors.get(name, {}).items()]
            truck = _scaled(truck, dict(factors))
    return truck


def _scaled(truck: _Kind, factors: Mapping[str, float]) -> _Kind:
    return truck.replace({name: getattr(truck, name) * factor for name, factor in factors.items()})


def _at_temperature(truck: _Kind, change: float, factor: float) -> _Kind:
    """`truck` warmer by `change` in K, with `factor` times its viscous friction: the grease's own law and the rest."""
    other, viscosity = truck.replace({"T_0": truck.T_0 + change}), truck.parts.friction.viscosity
    return _scaled(other, {"D_v": factor * viscosity(truck) / viscosity(other)})
