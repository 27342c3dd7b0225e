"""A fit by multiple shooting, from recordings to the result that the user sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.estimate.shooting.uncertainty import deviation
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.preparation.pace import paced
from clutchid.preparation.prepare import CALIBRATED_MARGIN, MARGIN, prepared
from clutchid.preparation.pulses import Pulsed, pulsed
from clutchid.simulation.plan import Plan
from clutchid.simulation.windows import first_guess, tracks
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution
from clutchid.smoother.search import FROM_AFAR, FROM_NEAR, search
from clutchid.smoother.trajectory import noise_scales
from clutchid.uncertainty.coordinates import Prior, coordinates, far_stop
from clutchid.uncertainty.noise import Noise

#: Curvature of a load, as a standard deviation in N/m²: a clutch of 5 kN turns within 4 mm.
CURVATURE = 3e8

#: What wears beside the clutch: the friction of the seals, and the dead volume at the engaged rest, which moves.
WEARING = ("F_C", "V_0A")

#: What the model gets wrong of a position lasts so long in s. A load that is read from position alone was nearer to the
#: truth with one sample in ten counted, at 1 kHz: docs/methods.md.
MEMORY = 0.01


class End(Protocol):
    """Where a search ended, by whatever method: free numbers, how it ended, and after how much work."""

    @property
    def x(self) -> FloatArray:
        """Free numbers as coordinates."""

    @property
    def status(self) -> Literal["converged", "stalled", "limit"]:
        """How the search ended."""

    @property
    def evaluations(self) -> int:
        """After how many evaluations."""


SolutionT = TypeVar("SolutionT", bound=End)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Generic[SolutionT]):
    """The problem of a fit, the plans of its recordings, and where its search ended."""

    task: FitProblem
    plans: tuple[Plan, ...]
    found: SolutionT | Failure


@dataclass(frozen=True, slots=True)
class FreeParameters:
    """What is to be fitted, and what is known of it: names, measured columns, bounds and priors in SI."""

    names: tuple[str, ...]
    measure: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)

    def free_in(self, stem: str) -> frozenset[str]:
        """What is free in the recording `stem`, of all recordings or its own."""
        return frozenset(name.partition("@")[0] for name in self.names if name.partition("@")[2] in ("", stem))


def shoot(
    logs: Sequence[Log],
    actuator: Actuator,
    wanted: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult[ShootingSolution]:
    """Fit `wanted` to recordings by multiple shooting.

    With a `calibration` the search starts near its end, from the calibrated values.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    task, plans, phased = problem_of(logs, actuator, wanted, calibration)
    if calibration and reads_load(wanted, actuator):
        task = replace(task, noise=replace(task.noise, memory=MEMORY))
    X: list[FloatArray] = []
    for track in task.tracks:
        guess = first_guess(track, phased[track.log], "pressure_a" in wanted.measure)
        if isinstance(guess, Failure):
            return SearchResult(task, plans, guess)
        X.append(guess)
    # from what is known of every number: a start far outside a narrow prior is out of reach of bounded steps
    x = np.zeros(len(task.coordinates))
    stages = FROM_NEAR if calibration else FROM_AFAR
    coarse = search(task, x, X, stages[:-1], progress)
    if isinstance(coarse, Failure):
        return SearchResult(task, plans, coarse)
    task = replace(task, noise=replace(task.noise, measured=noise_scales(task, coarse)))
    fine = search(task, coarse.x, coarse.X, stages[-1:], progress)
    if isinstance(fine, ShootingSolution):
        fine = replace(fine, evaluations=fine.evaluations + coarse.evaluations)
    return SearchResult(task, plans, fine)


def problem_of(
    logs: Sequence[Log], actuator: Actuator, wanted: FreeParameters, calibration: Calibration | None = None
) -> tuple[FitProblem, tuple[Plan, ...], list[Actuator]]:
    """The problem of a fit, the plans of its recordings, and `actuator` with the carrier's phase in each.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    seen = [pulsed(log, actuator, "pressure_a" in wanted.measure) for log in logs]
    phased = [one.actuator for one in seen]
    plans = tuple(_planned(one, wanted.measure) for one in seen)
    margin = CALIBRATED_MARGIN if calibration else MARGIN
    own = {**_phases(wanted, seen), **_wearing(wanted, logs, actuator, calibration)}
    free, priors = (*wanted.names, *own), {**own, **wanted.priors}
    task = FitProblem(
        actuator=phased[0],
        coordinates=coordinates(phased[0], free, wanted.bounds, priors),
        tracks=tuple(paced(track, phased[track.log], margin) for track in tracks(plans)),
        stems=tuple(log.name for log in logs),
        measure=wanted.measure,
        noise=Noise(),
        curvature=CURVATURE,
        reference=actuator.load.theta if calibration else (0.0,) * len(actuator.load.theta),
    )
    return task, plans, phased


def _planned(seen: Pulsed, measure: Sequence[str]) -> Plan:
    """The plan of a recording, with what its pulses are to be warned of."""
    done = prepared(seen.log, seen.actuator, measure)
    return replace(done, warnings=(*done.warnings, seen.warning)) if seen.warning else done


def _phases(wanted: FreeParameters, seen: Sequence[Pulsed]) -> dict[str, Prior]:
    """The phase of the carrier in each recording, where the valves' own phases are not free."""
    later = 1 if "s_vs" in wanted.names else 0
    return {
        f"s_pwm@{one.log.name}": Prior(one.actuator.parameters.s_pwm, one.spread)
        for one in seen[later:]
        if one.spread > 0.0
    }


def reads_load(wanted: FreeParameters, actuator: Actuator) -> bool:
    """Whether a load is read from position alone."""
    return "pressure_a" not in wanted.measure and bool(set(wanted.names) & set(actuator.load.names))


def _wearing(
    wanted: FreeParameters, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """What wears beside the clutch, in each recording, where a load is read from position alone."""
    if calibration is None or not reads_load(wanted, actuator):
        return {}
    taken = {name.partition("@")[0] for name in wanted.names}
    known = {name: Prior(actuator.value(name), deviation(actuator, name, calibration)) for name in WEARING}
    return {
        f"{name}@{log.name}": prior
        for log in logs
        for name, prior in {**known, "y_max": far_stop(actuator, [log])}.items()
        if name not in taken
    }
