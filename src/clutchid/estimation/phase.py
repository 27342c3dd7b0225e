"""Phase of the carrier in a recording with position alone, by a filter that adapts load and friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimation.prediction import predict_errors
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FreeParameters
from clutchid.inference.filter.filtering import Filtered, filtered
from clutchid.inference.fixed_gains import prediction_errors
from clutchid.inference.problem import Problem, prior_rows
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.threads import map_pairs
from clutchid.preparation.prepare import CALIBRATED_MARGIN, prepare
from clutchid.preparation.pulses import Duties, FindPhase, centred, duties_in, find_phase
from clutchid.simulation.stiffness import stiffness
from clutchid.simulation.windows import tracks, with_window_steps

#: Phases that are tried, Gauss-Newton steps at each, and the length in s of the part of a recording that they are tried
#: on. Provenance: docs/derivations.md.
PHASES, STEPS, DURATION = 10, 2, 10.0

#: Length in s for a slow recording: over 10 s of 100 Hz another phase costs as little (truck A3). The best phase and
#: those around it, in tenths: where a sample falls into another period the cost jumps, and no parabola fits (truck B2).
_DURATION_SLOW, NEAR = 30.0, (0.0, -0.7, -0.35, 0.35, 0.7)

#: Cost after the first step, as a multiple of the least, beyond which a phase of a slow recording is no candidate: the
#: second step takes at most a quarter of it (truck A7, docs/derivations.md).
_MOST_COST = 1.5

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
    after the second step are compared; the phase is refined by a parabola. In a slow recording, in whose intervals the
    gains depend on the phase, each phase has its own; one that costs much after the first step takes no second one, and
    the best phase is refined by four more.

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
    if slow:
        return _slow_phase(once, part, actuator)
    problems = [_at_phase(once, centred(at / PHASES)) for at in range(PHASES)]
    adapted = [Adapted(0.0, _start(once)) for _ in problems]
    for _ in range(STEPS):
        best_first = sorted(range(PHASES), key=lambda at: adapted[at].cost)
        references = (_reference(problems[at], adapted[at].x) for at in best_first)
        reference = next((passed for passed in references if isinstance(passed, _Reference)), None)
        if reference is None:
            break
        adapted = map_pairs(partial(_stepped, reference), problems, [phase.x for phase in adapted], smallest=1)
    costs = np.array([phase.cost for phase in adapted])
    return centred((int(np.argmin(costs)) + _vertex(costs)) / PHASES)


class _Reference(NamedTuple):
    """A pass of the filter that all phases refer to: its segments, with rows of each sample, and J' J of these."""

    segments: list[Filtered]
    J: FloatArray
    normal: FloatArray


def _reference(problem: Problem, x: FloatArray) -> _Reference | Failure:
    """The filter at x; without the derivative to the phase, which is another one at every phase."""
    maps, segments = problem.parameter_maps(x), []
    if isinstance(maps, Failure):
        return maps
    for track in problem.tracks:
        mapped = maps[problem.stems[track.log]]
        segment = filtered(track, mapped, problem.measure, problem.noise, compressed=False)
        if isinstance(segment, Failure):
            return segment
        segments.append(segment)
    J = np.vstack([segment.rows[:: len(MEASURED), :-1][segment.measured("position")] for segment in segments])
    J[:, [i for i, c in enumerate(problem.coordinates) if c.base == "s_pwm"]] = 0.0
    return _Reference(segments, J, J.T @ J)


def _stepped(reference: _Reference, problem: Problem, x: FloatArray) -> Adapted:
    """A Gauss-Newton step from x with derivatives of the `reference`; the cost is infinite if its prediction fails."""
    low, high = problem.bounds()
    r = _errors(reference, problem, x)
    if not np.isfinite(r).all():
        return Adapted(np.inf, x)
    prior, size, outlier = prior_rows(problem, x), np.abs(r), problem.noise.outlier
    P, of_prior = prior[:, :-1], prior[:, -1]
    gradient = P.T @ of_prior + reference.J.T @ (-r * np.sqrt(np.minimum(1.0, outlier / np.maximum(size, 1e-300))))
    normal = P.T @ P + reference.normal
    step = np.clip(-np.linalg.solve(normal, gradient), -_LARGEST_STEP, _LARGEST_STEP)
    cost = of_prior @ of_prior + np.sum(np.where(size > outlier, (2.0 * size - outlier) * outlier, size**2))
    return Adapted(float(cost + 2.0 * gradient @ step + step @ normal @ step), np.clip(x + step, low, high))


def _errors(reference: _Reference, problem: Problem, x: FloatArray) -> FloatArray:
    """Standardised prediction errors of all samples with a position; a single NaN if a simulation fails."""
    errors = []
    for track, segment in zip(problem.tracks, reference.segments, strict=True):
        try:
            actuator = problem.actuator_of(x, problem.stems[track.log])
        except ParameterError:
            return np.full(1, np.nan)
        of_track = prediction_errors(track, actuator, segment.gains[:, 0])
        if of_track is None:
            return np.full(1, np.nan)
        errors.append(of_track[segment.measured("position")])
    return np.concatenate(errors)


def _slow_phase(once: Problem, part: Log, actuator: Actuator) -> float:
    """`filtered_phase` of a slow recording, whose time grid depends on the phase."""
    rate = CALIBRATED_MARGIN * stiffness(actuator)

    def on_grid(phase: float) -> Problem:
        grid = prepare(part, actuator, once.measure, lambda _log, _actuator: phase, rate)
        return replace(_at_phase(once, phase), tracks=tracks((grid,)))

    def stepped(problems: Sequence[Problem], starts: Sequence[FloatArray]) -> list[Adapted]:
        return map_pairs(_adapted, problems, starts, smallest=1)

    problems = [on_grid(centred(at / PHASES)) for at in range(PHASES)]
    first = stepped(problems, [_start(once)] * PHASES)
    least = min(of_phase.cost for of_phase in first)
    worth = [at for at in range(PHASES) if first[at].cost <= _MOST_COST * least]
    second = stepped([problems[at] for at in worth], [first[at].x for at in worth])
    chosen = int(np.argmin([of_phase.cost for of_phase in second]))
    near = [centred((worth[chosen] + away) / PHASES) for away in NEAR]
    # from what the best phase adapted to, one step is enough
    start = np.where([c.base == "s_pwm" for c in once.coordinates], 0.0, second[chosen].x)
    finer = stepped([on_grid(phase) for phase in near], [start] * len(near))
    return near[int(np.argmin([of_phase.cost for of_phase in finer]))]


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


def _adapted(problem: Problem, x: FloatArray) -> Adapted:
    """A Gauss-Newton step from x towards smaller prediction errors; the cost is infinite if the filter fails."""
    prediction = predict_errors(problem, x)
    if isinstance(prediction, Failure):
        return Adapted(np.inf, x)
    at = prediction.linearisation()
    step = np.clip(np.linalg.lstsq(at.R, -at.q, rcond=None)[0], -_LARGEST_STEP, _LARGEST_STEP)
    after = at.R @ step + at.q
    return Adapted(prediction.cost - float(at.q @ at.q - after @ after), np.clip(x + step, *problem.bounds()))
