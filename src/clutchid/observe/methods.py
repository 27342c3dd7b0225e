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
    """Which parameters adapt; how many leading modes of the prior of the load, None for all; why not, in a sentence."""

    adapting: Callable[[Actuator], tuple[str, ...]]
    modes: int | None = None
    refused: Callable[[Actuator], str | None] = lambda _: None


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, what changes with them, and the phase of the valves' carrier."""
    phase = ("s_pwm",) if actuator.parameters.T_pwm > 0.0 else ()
    return (*actuator.load.names, *ADAPTING, *phase)


def states(_actuator: Actuator) -> tuple[str, ...]:
    """Nothing: the load stays as calibrated, and only the states follow the position."""
    return ()


def paper(actuator: Actuator) -> tuple[str, ...]:
    """The three weights of the paper's load."""
    return actuator.load.names


def _not_of_the_paper(actuator: Actuator) -> str | None:
    if actuator.model == "isothermal" and actuator.load.basis == "paper":
        return None
    return (
        f"method 'paper': the calibration is of the model '{actuator.model}' with a load of {len(actuator.load.theta)} "
        f"weights ('{actuator.load.basis}'); it takes the model 'isothermal' with the paper's three splines. Calibrate "
        "with --model isothermal and a list of parameters in --free, or take another method."
    )


#: Methods by name.
METHODS: Mapping[str, Method] = MappingProxyType({
    "joint": Method(joint), "joint-reduced": Method(joint, MODES), "states": Method(states),
    "paper": Method(paper, refused=_not_of_the_paper),
})  # fmt: skip


def method_for(name: str, actuator: Actuator) -> Method:
    """The method of a name.

    Raises
    ------
    ParameterError
        If there is no such method, or it does not take the actuator.
    """
    if name not in METHODS:
        raise ParameterError(unknown_name(name, METHODS, "method"))
    sentence = METHODS[name].refused(actuator)
    if sentence is not None:
        raise ParameterError(sentence)
    return METHODS[name]
