"""`Family`: what distinguishes a family of trucks, as a record of functions; everything else is shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.names import unknown_name
from clutchid.truck.load_table import LoadCurve
from clutchid.truck.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Family:
    """Functions of a family; trucks are of the type `kind`, and their ranges are in the file `ranges`.

    `prepared` completes drawn numbers before the shares are drawn, `finished` after them. `load_curve` gives the load
    of a truck. `states` names the states of its plant, `loop` is its compiled loop, with or without a ledger, whose
    arrays are filled by `at_rest` (truck, curve), `plant_parameters` (truck) and `settings` (truck, zero, working).
    `start` draws initial states and whether a compressor runs, `position_noise` and `measured_pressure` belong to the
    sensors. `true_states` are the columns of the truth, from a truck and the states of a run. `changes` are the changes
    between calibration and use, by name.
    """

    kind: type[Vehicle]
    ranges: Path
    prepared: Callable[[dict[str, Any]], dict[str, Any]]
    finished: Callable[[dict[str, Any]], dict[str, Any]]
    load_curve: Callable[[Any], LoadCurve]
    states: tuple[str, ...]
    loop: Callable[[bool], ModuleType]
    at_rest: Callable[[Any, LoadCurve], FloatArray]
    plant_parameters: Callable[[Any], FloatArray]
    settings: Callable[[Any, float, bool], FloatArray]
    start: Callable[[Any, LoadCurve, np.random.Generator], tuple[FloatArray, bool]]
    position_noise: Callable[[Any, int, np.random.Generator], FloatArray]
    measured_pressure: Callable[[Any, FloatArray, np.random.Generator], FloatArray]
    true_states: Callable[[Any, Mapping[str, FloatArray]], dict[str, FloatArray]]
    changes: Mapping[str, Callable[[Any], Vehicle]]


@cache
def families() -> Mapping[str, Family]:
    """The families by name."""
    from clutchid.truck.first import FIRST
    from clutchid.truck.second import SECOND

    return {"A": FIRST, "B": SECOND}


def family(name: str) -> Family:
    """The family `name`.

    Raises
    ------
    ParameterError
        If there is none of that name.
    """
    if name not in families():
        raise ParameterError(f"family {name!r}: must be {' or '.join(families())}.")
    return families()[name]


def family_of(truck: Vehicle) -> Family:
    """The family that `truck` belongs to."""
    return next(one for one in families().values() if isinstance(truck, one.kind))


def changed(truck: Vehicle, *changes: str) -> Vehicle:
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
    known = family_of(truck).changes
    unknown = [unknown_name(name, tuple(known), "change") for name in changes if name not in known]
    if unknown:
        raise ParameterError("\n".join(unknown))
    for name in changes:
        truck = known[name](truck)
    return truck
