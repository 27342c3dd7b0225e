"""A fit by multiple shooting, from recordings to the result that the user sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.estimate.least_squares import Failure
from clutchid.estimate.search import Progress
from clutchid.estimate.shooting.carrier import centred, find_carrier, find_phase, grid_phase, shows
from clutchid.estimate.shooting.coordinates import WIDTHS, Prior, coordinates, far_stop
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.pace import paced
from clutchid.estimate.shooting.problem import Shooting
from clutchid.estimate.shooting.projection import Found
from clutchid.estimate.shooting.search import FROM_AFAR, FROM_NEAR, search
from clutchid.estimate.shooting.trajectory import noise_scales
from clutchid.estimate.shooting.uncertainty import deviation
from clutchid.estimate.shooting.windows import GUESS, first_guess, tracks
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.simulation import Partition
from clutchid.simulation.plan import Plan, plan
from clutchid.simulation.stiffness import stiffness

#: Curvature of a load, as a standard deviation in N/m²: a clutch of 5 kN turns within 4 mm.
CURVATURE = 3e8

#: What wears beside the clutch: the friction of the seals, and the dead volume at the engaged rest, which moves.
WEARING = ("F_C", "V_0A")

#: The steps of the integration follow this many times the stiffness at the start, for values that make it stiffer; from
#: calibrated values, which hardly move, so many times.
MARGIN, CALIBRATED_MARGIN = 1.3, 1.05


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


EndT = TypeVar("EndT", bound=End)


@dataclass(frozen=True, slots=True, eq=False)
class Shot(Generic[EndT]):
    """The problem of a fit, the plans of its recordings, and where its search ended."""

    task: Shooting
    plans: tuple[Plan, ...]
    found: EndT | Failure


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be fitted, and what is known of it: names, measured columns, bounds and priors in SI."""

    names: tuple[str, ...]
    measure: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)


def shoot(
    logs: Sequence[Log],
    actuator: Actuator,
    wanted: Wanted,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> Shot[Found]:
    """Fit `wanted` to recordings by multiple shooting.

    With a `calibration` the search starts near its end, from the calibrated values.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    task, plans, phased = problem_of(logs, actuator, wanted, calibration)
    X: list[FloatArray] = []
    for track in task.tracks:
        guess = first_guess(track, phased[track.log], "pressure_a" in wanted.measure)
        if isinstance(guess, Failure):
            return Shot(task, plans, guess)
        X.append(guess)
    # from what is known of every number: a start far outside a narrow prior is out of reach of bounded steps
    x = np.zeros(len(task.coordinates))
    stages = FROM_NEAR if calibration else FROM_AFAR
    coarse = search(task, x, X, stages[:-1], progress)
    if isinstance(coarse, Failure):
        return Shot(task, plans, coarse)
    task = replace(task, noise=replace(task.noise, measured=noise_scales(task, coarse)))
    fine = search(task, coarse.x, coarse.X, stages[-1:], progress)
    if isinstance(fine, Found):
        fine = replace(fine, evaluations=fine.evaluations + coarse.evaluations)
    return Shot(task, plans, fine)


def problem_of(
    logs: Sequence[Log], actuator: Actuator, wanted: Wanted, calibration: Calibration | None = None
) -> tuple[Shooting, tuple[Plan, ...], list[Actuator]]:
    """The problem of a fit, the plans of its recordings, and `actuator` with the carrier's phase in each.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    phased = [with_phase(log, actuator, "pressure_a" in wanted.measure) for log in logs]
    plans = tuple(prepared(log, own, wanted.measure) for log, own in zip(logs, phased, strict=True))
    margin = CALIBRATED_MARGIN if calibration else MARGIN
    own = {**_phases(wanted, logs, phased), **_wearing(wanted, logs, actuator, calibration)}
    free, priors = (*wanted.names, *own), {**own, **wanted.priors}
    task = Shooting(
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


def _phases(wanted: Wanted, logs: Sequence[Log], phased: Sequence[Actuator]) -> dict[str, Prior]:
    """The phase of the carrier in each recording, where the valves' own phases are not free."""
    later = 1 if "s_vs" in wanted.names else 0
    return {
        f"s_pwm@{log.name}": Prior(own.parameters.s_pwm, WIDTHS["s_pwm"])
        for log, own in list(zip(logs, phased, strict=True))[later:]
        if own.parameters.T_pwm > 0.0 and grid_phase(log, own.parameters.T_pwm) is None
    }


def _wearing(
    wanted: Wanted, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """What wears beside the clutch, in each recording, where a load is read from position alone."""
    reads_load = set(wanted.names) & set(actuator.load.names)
    if calibration is None or "pressure_a" in wanted.measure or not reads_load:
        return {}
    taken = {name.partition("@")[0] for name in wanted.names}
    known = {name: Prior(actuator.value(name), deviation(actuator, name, calibration)) for name in WEARING}
    return {
        f"{name}@{log.name}": prior
        for log in logs
        for name, prior in {**known, "y_max": far_stop(actuator, [log])}.items()
        if name not in taken
    }


def prepared(log: Log, actuator: Actuator, measure: Sequence[str]) -> Plan:
    """The plan of a recording, with the resets of the first guess.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = float(np.median(np.diff(log.time))) if len(log) > 1 else GUESS
    every = Partition(every=max(2, round(GUESS / step)))
    return plan(log, actuator, MARGIN * stiffness(actuator), every, "pressure_a" in measure)


def with_phase(log: Log, actuator: Actuator, with_pressure: bool) -> Actuator:
    """`actuator` with the phase that the carrier of its valves has in `log`.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is read from.
    """
    period = actuator.parameters.T_pwm
    if period == 0.0 or len(log) < 2 or not shows(log, period):
        return actuator
    if (grid := grid_phase(log, period)) is not None:
        return actuator.replace({"s_pwm": centred(grid)})
    if with_pressure:
        _, phase = find_carrier(log, actuator, (period,))
        return actuator.replace({"s_pwm": centred(phase - actuator.parameters.tau_p / period)})
    return actuator.replace({"s_pwm": find_phase(log, actuator)})
