"""The methods of an observer by name: which parameters adapt, and by which rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from clutchid.errors import ParameterError
from clutchid.inference.filter.rules import KALMAN, AdaptiveGains, CorrectionRule, adaptive_rule, balance_rule
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.parameters import in_order

#: Modes of the load that adapt in 'joint-reduced' in place of its weights. Provenance: docs/derivations.md.
MODES = 12

#: Samples from one correction to the next at 1 kHz. Provenance: docs/derivations.md.
EVERY = 10


def by_covariance(
    _actuator: Actuator, _free: Sequence[Coordinate], _root: FloatArray, _spacing: float
) -> CorrectionRule:
    """The rule of the joint filter."""
    return KALMAN


class ObserverMethod(NamedTuple):
    """Parameters that adapt, and the rule of their correction.

    `modes` is how many modes of the load adapt in place of its weights, None for the weights; `refused` says in a
    sentence why a method does not take an actuator; `every` are samples from one correction to the next at 1 kHz;
    `rule` makes the rule of correction for an actuator, its free coordinates, a root of their prior, and the time
    between samples in s.
    """

    adapting: Callable[[Actuator], tuple[str, ...]]
    modes: int | None = None
    refused: Callable[[Actuator], str | None] = lambda _: None
    every: int = EVERY
    rule: Callable[[Actuator, Sequence[Coordinate], FloatArray, float], CorrectionRule] = by_covariance

    @property
    def corrects_supply(self) -> bool:
        """Whether it corrects the supply pressure where the vehicle records it."""
        return self.rule is by_covariance


def joint(actuator: Actuator) -> tuple[str, ...]:
    """All load weights, and the parameters of the rows that adapt beside them and have an effect.

    These are what wears with a clutch, the far stop, the viscous friction of the grease, a delay of the duty cycles,
    which looks like one of the sensor, a leak of chamber A, and the phase of the valves' carrier. Provenance:
    docs/derivations.md.
    """
    acting = actuator.acting
    return (*actuator.load.names, *(n for n in in_order(actuator.rows, lambda row: row.adapts) if n in acting))


def states(_actuator: Actuator) -> tuple[str, ...]:
    """Nothing: the load stays as calibrated, and only the states follow the position."""
    return ()


def load(actuator: Actuator) -> tuple[str, ...]:
    """All load weights and nothing else."""
    return actuator.load.names


def adaptive(actuator: Actuator, free: Sequence[Coordinate], root: FloatArray, spacing: float) -> CorrectionRule:
    """The rule of the adaptive observer."""
    return adaptive_rule(actuator, free, root, spacing, AdaptiveGains())


def _not_of_the_paper(actuator: Actuator) -> str | None:
    if actuator.model == "isothermal" and actuator.load.basis == "paper":
        return None
    return (
        f"method 'paper': the calibration is of the model '{actuator.model}' with a load of {len(actuator.load.theta)} "
        f"weights ('{actuator.load.basis}'); it takes the model 'isothermal' with the paper's three splines. Calibrate "
        "with --model isothermal and a list of parameters in --free, or take another method."
    )


def rls(actuator: Actuator, _free: Sequence[Coordinate], _root: FloatArray, spacing: float) -> CorrectionRule:
    """The rule of least squares on the balance of forces."""
    return balance_rule(actuator, spacing)


#: Methods by name.
METHODS: Mapping[str, ObserverMethod] = MappingProxyType({
    "joint": ObserverMethod(joint), "joint-reduced": ObserverMethod(joint, MODES), "states": ObserverMethod(states),
    "paper": ObserverMethod(load, refused=_not_of_the_paper), "rls": ObserverMethod(load, rule=rls),
    "adaptive": ObserverMethod(load, every=1, rule=adaptive),
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
