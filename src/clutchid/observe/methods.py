"""The methods of an observer by name: which parameters adapt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from clutchid.errors import ParameterError
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name

#: Parameters that adapt beside the load: what wears with a clutch, and the far stop. Provenance: docs/derivations.md.
WEARING = ("F_C", "V_0A", "y_max")


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, what wears with them, and the phase of the valves' carrier."""
    phase = ("s_pwm",) if actuator.parameters.T_pwm > 0.0 else ()
    return (*actuator.load.names, *WEARING, *phase)


def states(_actuator: Actuator) -> tuple[str, ...]:
    """Nothing: the load stays as calibrated, and only the states follow the position."""
    return ()


#: Methods by name.
METHODS: Mapping[str, Callable[[Actuator], tuple[str, ...]]] = MappingProxyType({"joint": joint, "states": states})


def adapting(method: str, actuator: Actuator) -> tuple[str, ...]:
    """Load weights and parameters that adapt in a method.

    Raises
    ------
    ParameterError
        If there is no such method.
    """
    if method not in METHODS:
        raise ParameterError(unknown_name(method, METHODS, "method"))
    return METHODS[method](actuator)
