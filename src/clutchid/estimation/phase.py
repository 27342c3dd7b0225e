"""Phase of the carrier in a recording with position alone, by a filter that adapts load and friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FreeParameters
from clutchid.inference.filter.filtering import filtered
from clutchid.inference.fixed_gains import prediction_errors
from clutchid.inference.problem import Problem, prior_rows
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, IntArray, Log, sample_interval
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.threads import map_pairs
from clutchid.preparation.prepare import CALIBRATED_MARGIN, prepare, with_steps
from clutchid.preparation.pulses import Duties, FindPhase, centred, duties_in, find_phase
from clutchid.simulation.stiffness import stiffness
from clutchid.simulation.windows import Track, tracks, with_window_steps

#: Phases that are tried, Gauss-Newton steps at each, and the length in s of the part of a recording that they are tried
#: on. Provenance: docs/derivations.md.
PHASES, _STEPS, DURATION = 10, 2, 10.0

#: Length in s for a slow recording: over 10 s of 100 Hz another phase costs as little (truck A3). Cost with shared
#: gains, as a multiple of the least, up to which a phase has gains of its own: that of the best one is up to 2.3 % more
#: (h:9). Phases beside the best one, in tenths: where a sample falls into another period the cost jumps, and no
#: parabola fits (truck B2).
_DURATION_SLOW, _MOST_COST, _NEAR = 30.0, 1.05, (-1.0 / 3.0, 1.0 / 3.0)

#: Largest step of a parameter in standard deviations of its prior.
_LARGEST_STEP = 2.0


def phase_finder(actuator: Actuator, free: FreeParameters, calibration: Calibration | None) -> FindPhase:
    """Estimator of the phase of the carrier for a fit: with a calibration `filtered_phase`."""
    if calibration is None or not free.reads_load(actuator):
        return find_phase
    return partial(filtered_phase, calibration=calibration)


def filtered_phase(log: Log, actuator: Actuator, calibration: Calibration) -> float:
    """Phase of a carrier of known period for which a Kalman filter predicts the position best, in [-0.5, 0.5).

    At each of ten phases load, viscous friction and what may have changed take two Gauss-Newton steps towards smaller
    prediction errors: wear or cold grease would otherwise be taken for another phase. All phases share the gains of the
    filter and the derivatives, which are computed at the best phase of the round before. The costs that are predicted
    after the second step are compared; the phase is refined by a parabola. In a slow recording each phase has a time
    grid of its own, and those that then cost little are compared with gains of their own too.

    Parameters
    ----------
    log : Log
        Both duty cycles and the position.
    actuator : Actuator
        As calibrated.
    calibration : Calibration
        Its covariance.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step = sample_interval(log.time)
    slow = duties_in(log, actuator) is not Duties.RECORDED
    part = log.slice(0, min(len(log), round((_DURATION_SLOW if slow else DURATION) / step)))
    once = _problem(part, actuator, calibration)
    at_phase: Callable[[float], Problem] = partial(_at_phase, once)
    if slow:
        at_phase = partial(_on_grid, once, part, actuator, CALIBRATED_MARGIN * stiffness(actuator))
    problems = [at_phase(centred(at / PHASES)) for at in range(PHASES)]
    adapted = [Adapted(0.0, _start(once)) for _ in problems]
    for _ in range(_STEPS):
        best_first = sorted(range(PHASES), key=lambda at: adapted[at].cost)
        references = (_reference(problems[at], adapted[at].x) for at in best_first)
        reference = next((passed for passed in references if isinstance(passed, _Reference)), None)
        if reference is None:
            break
        adapted = map_pairs(partial(_stepped, reference), problems, [phase.x for phase in adapted], smallest=1)
    costs = np.array([phase.cost for phase in adapted])
    if slow and reference is not None:
        return _finer(reference, at_phase, problems, adapted)
    return centred((int(np.argmin(costs)) + _vertex(costs)) / PHASES)


def _finer(
    reference: _Reference,
    at_phase: Callable[[float], Problem],
    problems: Sequence[Problem],
    adapted: Sequence[Adapted],
) -> float:
    """The best phase of a slow recording, of those that cost little and of two beside the best of these.

    What the recording does not show of the duty cycles is another process noise at another phase: each has gains of its
    own, for a step from what it adapted to with the shared ones.
    """

    def costs_at(problems: Sequence[Problem], starts: Sequence[FloatArray]) -> FloatArray:
        ends = map_pairs(partial(_stepped, reference, own_gains=True), problems, starts, smallest=1)
        return np.array([end.cost for end in ends])

    most = _MOST_COST * min(phase.cost for phase in adapted)
    worth = [at for at in range(PHASES) if adapted[at].cost <= most]
    own = costs_at([problems[at] for at in worth], [adapted[at].x for at in worth])
    best = worth[int(np.argmin(own))]
    phases = [centred((best + away) / PHASES) for away in (0.0, *_NEAR)]
    beside = costs_at([at_phase(phase) for phase in phases[1:]], [adapted[best].x] * len(_NEAR))
    return phases[int(np.argmin([own.min(), *beside]))]


class _Reference(NamedTuple):
    """A pass of the filter that all phases refer to: at each sample with a position its time stamp, gains and row of J.

    `gains` (n, n_states + 3) are those of the position; `normal` is J' J.
    """

    stamps: FloatArray
    gains: FloatArray
    J: FloatArray
    normal: FloatArray

    def places(self, track: Track) -> tuple[IntArray, IntArray]:
        """Samples of the reference that a track has too, and where it has them."""
        _, at, shared = np.intersect1d(self.stamps, _stamps(track), assume_unique=True, return_indices=True)
        return at, shared


def _reference(problem: Problem, x: FloatArray) -> _Reference | Failure:
    """The filter at x; without the derivative to the phase, which is another one at every phase."""
    maps, stamps, gains, rows = problem.parameter_maps(x), [], [], []
    if isinstance(maps, Failure):
        return maps
    for track in problem.tracks:
        mapped = maps[problem.stems[track.log]]
        segment = filtered(track, mapped, problem.measure, problem.noise, compressed=False)
        if isinstance(segment, Failure):
            return segment
        measured = segment.measured("position")
        stamps.append(_stamps(track)[measured])
        gains.append(segment.gains[measured, 0])
        rows.append(segment.rows[:: len(MEASURED), :-1])
    J = np.vstack(rows)
    J[:, [i for i, c in enumerate(problem.coordinates) if c.base == "s_pwm"]] = 0.0
    return _Reference(np.concatenate(stamps), np.vstack(gains), J, J.T @ J)


def _stamps(track: Track) -> FloatArray:
    stamps: FloatArray = track.measured.time[track.segment.start : track.segment.stop]
    return stamps


def _stepped(reference: _Reference, problem: Problem, x: FloatArray, *, own_gains: bool = False) -> Adapted:
    """A Gauss-Newton step from x with derivatives of the `reference`; the cost is infinite if its prediction fails."""
    low, high = problem.bounds()
    r = _errors(reference, problem, x, own_gains=own_gains)
    if not np.isfinite(r).all():
        return Adapted(np.inf, x)
    prior, size, outlier = prior_rows(problem, x), np.abs(r), problem.noise.outlier
    P, of_prior = prior[:, :-1], prior[:, -1]
    gradient = P.T @ of_prior + reference.J.T @ (-r * np.sqrt(np.minimum(1.0, outlier / np.maximum(size, 1e-300))))
    normal = P.T @ P + reference.normal
    step = np.clip(-np.linalg.solve(normal, gradient), -_LARGEST_STEP, _LARGEST_STEP)
    cost = of_prior @ of_prior + np.sum(np.where(size > outlier, (2.0 * size - outlier) * outlier, size**2))
    return Adapted(float(cost + 2.0 * gradient @ step + step @ normal @ step), np.clip(x + step, low, high))


def _errors(reference: _Reference, problem: Problem, x: FloatArray, *, own_gains: bool) -> FloatArray:
    """Standardised prediction errors at the samples of the reference; a single NaN if a simulation fails.

    All time grids have these samples. Where a sample lies in no segment of another grid, its error there is 0.
    """
    errors = np.zeros(reference.stamps.size)
    for track in problem.tracks:
        at, shared = reference.places(track)
        of_track = (
            _with_own_gains(problem, x, track)
            if own_gains
            else _with_shared_gains(problem, x, track, shared, reference.gains[at])
        )
        if of_track is None:
            return np.full(1, np.nan)
        errors[at] = of_track[shared]
    return errors


def _with_shared_gains(
    problem: Problem, x: FloatArray, track: Track, shared: IntArray, gains: FloatArray
) -> FloatArray | None:
    """Standardised prediction errors of a track with the gains of its `shared` samples; None if a simulation fails."""
    try:
        actuator = problem.actuator_of(x, problem.stems[track.log])
    except ParameterError:
        return None
    of_track = np.zeros((len(track.segment), gains.shape[1]))
    of_track[:, -1] = np.inf
    of_track[shared] = gains
    return prediction_errors(track, actuator, of_track)


def _with_own_gains(problem: Problem, x: FloatArray, track: Track) -> FloatArray | None:
    """As `_with_shared_gains`, with the gains of a filter of its own."""
    maps = problem.parameter_maps(x)
    if isinstance(maps, Failure):
        return None
    segment = filtered(track, maps[problem.stems[track.log]].fixed(), problem.measure, problem.noise)
    if isinstance(segment, Failure):
        return None
    errors: FloatArray = segment.errors[:, 0, 0] / np.sqrt(segment.errors[:, 0, 1])
    return errors


def _on_grid(once: Problem, part: Log, actuator: Actuator, rate: float, phase: float) -> Problem:
    """`once` with another phase in a slow recording, whose time grid depends on it."""
    grid = prepare(part, actuator, once.measure, lambda _log, _actuator: phase, rate)
    with_grid = tuple(with_window_steps(with_steps(track, actuator, CALIBRATED_MARGIN)) for track in tracks((grid,)))
    return replace(_at_phase(once, phase), tracks=with_grid)


def _start(problem: Problem) -> FloatArray:
    return np.zeros(len(problem.coordinates))


def _vertex(costs: FloatArray) -> float:
    """Place of the least cost between phases, by a parabola through the best and its neighbours, from the best."""
    best = int(np.argmin(costs))
    before, after = costs[best - 1] - costs[best], costs[(best + 1) % costs.size] - costs[best]
    return 0.5 * float((before - after) / (before + after)) if 0.0 < before + after < np.inf else 0.0


def _problem(part: Log, actuator: Actuator, calibration: Calibration) -> Problem:
    """The problem of load and viscous friction for a phase of 0."""
    free = FreeParameters((*actuator.load.names, "D_v"), ("position",))
    problem = fit_problem([part], actuator, free, calibration, lambda _log, _actuator: 0.0)
    return replace(problem, tracks=tuple(map(with_window_steps, problem.tracks)))


def _at_phase(problem: Problem, phase: float) -> Problem:
    """`problem` with another phase of the carrier as prior mean."""
    coordinates = tuple(replace(c, mean=phase) if c.base == "s_pwm" else c for c in problem.coordinates)
    return replace(problem, actuator=problem.actuator.replace({"s_pwm": phase}), coordinates=coordinates)


class Adapted(NamedTuple):
    """Load and viscous friction adapted to a phase: x after a step, and the cost predicted there."""

    cost: float
    x: FloatArray
