"""The methods of an observer by name: which parameters adapt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from clutchid.errors import ParameterError
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name

#: Parameters that adapt beside the load: what wears with a clutch, the far stop, the viscous friction of the grease,
#: and a delay of the duty cycles, which looks like one of the sensor. Provenance: docs/derivations.md.
ADAPTING = ("F_C", "V_0A", "y_max", "D_v", "tau_y")


#: Leading modes of the prior of the load that adapt in 'joint-reduced'.
MODES = 10


class Method(NamedTuple):
    """Which parameters adapt, and how many leading modes of the prior of the load, None for all."""

    adapting: Callable[[Actuator], tuple[str, ...]]
    modes: int | None = None


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, what changes with them, and the phase of the valves' carrier."""
    phase = ("s_pwm",) if actuator.parameters.T_pwm > 0.0 else ()
    return (*actuator.load.names, *ADAPTING, *phase)


def states(_actuator: Actuator) -> tuple[str, ...]:
    """Nothing: the load stays as calibrated, and only the states follow the position."""
    return ()


#: Methods by name.
METHODS: Mapping[str, Method] = MappingProxyType({
    "joint": Method(joint), "joint-reduced": Method(joint, MODES), "states": Method(states),
})  # fmt: skip


def method_of(name: str) -> Method:
    """The method of a name.

    Raises
    ------
    ParameterError
        If there is no such method.
    """
    if name not in METHODS:
        raise ParameterError(unknown_name(name, METHODS, "method"))
    return METHODS[name]
