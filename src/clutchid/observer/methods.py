"""The methods of an observer by name: which parameters adapt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from clutchid.errors import ParameterError
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.parameters import in_order

#: Samples from one correction to the next at 1 kHz. Provenance: docs/derivations.md.
EVERY = 10


class ObserverMethod(NamedTuple):
    """Parameters that adapt; `refused` says in a sentence why a method does not take an actuator."""

    adapting: Callable[[Actuator], tuple[str, ...]]
    refused: Callable[[Actuator], str | None] = lambda _: None


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, and the parameters of the rows that adapt beside them and have an effect.

    These are what wears with a clutch, the far stop, the viscous friction of the grease, a delay of the duty cycles,
    which looks like one of the sensor, a leak of chamber A, and the phase of the valves' carrier. Provenance:
    docs/derivations.md.
    """
    acting = actuator.acting
    return (*actuator.load.names, *(n for n in in_order(actuator.rows, lambda row: row.adapts) if n in acting))


def _not_of_the_paper(actuator: Actuator) -> str | None:
    if actuator.model == "isothermal" and actuator.load.basis == "paper":
        return None
    return (
        f"method 'paper': the calibration is of the model '{actuator.model}' with a load of {len(actuator.load.theta)} "
        f"weights ('{actuator.load.basis}'); it takes the model 'isothermal' with the paper's three splines. Calibrate "
        "with --model isothermal and a list of parameters in --free, or take another method."
    )


#: Methods by name: what adapts is the load and more, nothing, or the load alone.
METHODS: Mapping[str, ObserverMethod] = MappingProxyType(
    {
        "joint": ObserverMethod(joint),
        "states": ObserverMethod(lambda _: ()),
        "paper": ObserverMethod(lambda actuator: actuator.load.names, _not_of_the_paper),
    }
)


def method_for(name: str, actuator: Actuator) -> ObserverMethod:
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
