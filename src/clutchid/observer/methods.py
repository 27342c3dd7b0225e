"""The methods of an observer by name: which parameters adapt, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from clutchid.errors import ParameterError
from clutchid.inference.filter.references import Reference, adaptive_numbers, balance_numbers
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.parameters import in_order

#: Modes of the load that adapt in 'joint-reduced' in place of its weights. Provenance: docs/derivations.md.
MODES = 12

#: Samples from one correction to the next at 1 kHz. Provenance: docs/derivations.md.
EVERY = 10


class ObserverMethod(NamedTuple):
    """Parameters that adapt, and how.

    `modes` is how many modes of the load adapt in place of its weights, None for the weights; `refused` says in a
    sentence why a method does not take an actuator; `every` are samples from one correction to the next at 1 kHz;
    `reference` makes the numbers of a reference observer for an actuator, its free coordinates, a root of their prior,
    and the time between samples in s, where it is none of the Kalman filter.
    """

    adapting: Callable[[Actuator], tuple[str, ...]]
    modes: int | None = None
    refused: Callable[[Actuator], str | None] = lambda _: None
    every: int = EVERY
    reference: Callable[[Actuator, Sequence[Coordinate], FloatArray, float], Reference] | None = None


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, and the parameters of the rows that adapt beside them and have an effect.

    These are what wears with a clutch, the far stop, the viscous friction of the grease, a delay of the duty cycles,
    which looks like one of the sensor, a leak of chamber A, and the phase of the valves' carrier. Provenance:
    docs/derivations.md.
    """
    acting = actuator.acting
    return (*actuator.load.names, *(n for n in in_order(actuator.rows, lambda row: row.adapts) if n in acting))


def _load(actuator: Actuator) -> tuple[str, ...]:
    return actuator.load.names


def _not_of_the_paper(actuator: Actuator) -> str | None:
    if actuator.model == "isothermal" and actuator.load.basis == "paper":
        return None
    return (
        f"method 'paper': the calibration is of the model '{actuator.model}' with a load of {len(actuator.load.theta)} "
        f"weights ('{actuator.load.basis}'); it takes the model 'isothermal' with the paper's three splines. Calibrate "
        "with --model isothermal and a list of parameters in --free, or take another method."
    )


#: Methods by name: what adapts is the load and more, modes of the load and more, nothing, or the load alone.
METHODS: Mapping[str, ObserverMethod] = MappingProxyType({
    "joint": ObserverMethod(joint), "joint-reduced": ObserverMethod(joint, MODES),
    "states": ObserverMethod(lambda _: ()),
    "paper": ObserverMethod(_load, refused=_not_of_the_paper), "rls": ObserverMethod(_load, reference=balance_numbers),
    "adaptive": ObserverMethod(_load, every=1, reference=adaptive_numbers),
})  # fmt: skip


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
