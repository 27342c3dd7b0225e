"""The method 'simulation': simulation error in two stages, as in the paper (Section 3.1), ballistic or partitioned.

Every segment is simulated once, from its start to its end, with the resets of a partition inside the kernel. Free are
the parameters, in units of their natural size and without a prior, and the unknown starts of segments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.method import Method, MethodResult, ResidualRows, SearchResult
from clutchid.estimation.request import FreeParameters, bounds_of
from clutchid.estimation.result import Compared, Recording, compare_states
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.inference.uncertainty.gaussian import Covariance, natural_sizes, sandwich
from clutchid.inference.uncertainty.identifiability import identifiability_warnings, identifiable, in_words
from clutchid.log import FloatArray, Log
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import (
    INITIAL_VALUES,
    Linearisation,
    Solution,
    Start,
    StartStatus,
    compress,
    minimise,
    triangular,
)
from clutchid.numerics.progress import Progress, Stage, Step
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.noise import Noise
from clutchid.simulation.plan import Plan, Segment, plan
from clutchid.simulation.run import (
    POSITION_START,
    PRESSURE_START,
    KernelArrays,
    columns,
    guessed_pressure,
    run,
    run_with_sensitivities,
    start_sensitivities,
    start_state,
)
from clutchid.simulation.stiffness import stiffness_over, top_speed

#: A recording with a smaller range of positions, in m, has no motion.
_REST_RANGE = 5e-4

#: Factors on the initial load weights that the coarse stage tries.
COARSE_FACTORS = (1.0, 0.6, 0.8, 1.25, 1.6)

#: Natural size of start values in m and Pa.
_START_UNITS = {POSITION_START: 1e-3, PRESSURE_START: 1e5}


def search(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    progress: Progress | None = None,
) -> SearchResult:
    """Fit ballistic or partitioned simulations to recordings; a `calibration` is not supported.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    assert calibration is None, "the method has no priors"
    problem, x = _prepared(logs, actuator, free)
    problem, solution = two_stages(problem, x, progress)
    return SearchResult(problem, solution)


def problem_of(logs: Sequence[Log], actuator: Actuator, free: FreeParameters, *_: object) -> Problem:
    """The problem of `search`, without a calibration or the phase of a carrier."""
    return _prepared(logs, actuator, free)[0]


def evaluated(problem: Problem, x: FloatArray, _: Sequence[FloatArray] = ()) -> Linearisation | Failure:
    """The residuals at x, which has the unknown starts of segments; there are no windows."""
    return linearise_segments(problem, x)


def rows(problem: Problem, x: FloatArray, _: object = None) -> ResidualRows | Failure:
    """The residuals of all samples at x: by segment, measured column and time."""
    parts, scales = [np.zeros((0, x.size + 1))], [np.zeros(0)]
    for segment in residuals(problem, x):
        if isinstance(segment, Failure):
            return segment
        part = np.zeros((len(segment.rows), x.size + 1))
        part[:, [*segment.places, x.size]] = segment.rows
        parts.append(part)
        scales.append(segment.scales)
    data = np.concatenate(parts)
    return ResidualRows(parts[0], data, 0.5 * float(np.sum(data[:, -1] ** 2)), np.concatenate(scales))


def _prepared(logs: Sequence[Log], actuator: Actuator, free: FreeParameters) -> tuple[Problem, FloatArray]:
    limits = bounds_of(free.names, actuator, free.bounds)
    start = actuator.replace({name: float(np.clip(actuator.value(name), *limits[name])) for name in free.names})
    rate = stiffness_over(start, limits, top_speed(free.partition))
    plans = [plan(log, start, rate, free.partition, "pressure_a" in free.measure) for log in logs]
    problem, x = build_problem(start, plans, free.names, free.measure, limits)
    _check_size(problem)
    return problem, x


def build_problem(
    actuator: Actuator,
    plans: Sequence[Plan],
    names: Sequence[str],
    measure: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[Problem, FloatArray]:
    """The problem of a fit of `names` to the recordings `plans`, and x (k,) at the values of `actuator`."""
    free = []
    for name, unit in zip(names, natural_sizes(actuator, names).tolist(), strict=True):
        free.append(Coordinate(name, None, 0.0, unit, False, *bounds[name], limit=np.inf))
    for prepared in plans:
        for number, segment in enumerate(prepared.segments):
            for name, _, low, high in _free_start(segment, actuator):
                stem = _start_stem(prepared, number)
                free.append(Coordinate(name, stem, 0.0, _START_UNITS[name], False, low, high, limit=np.inf))
    noise = Noise(measured={name: MEASURED[name].first_scale for name in measure})
    stems = tuple(prepared.log.name for prepared in plans)
    problem = Problem(actuator, tuple(free), stems, tuple(measure), noise, tuple(plans))
    return problem, start_values(problem)[0]


def start_values(problem: Problem, _: object = None) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """x (k,) at the values of the actuator, and at the guesses of unknown starts of segments; there are no windows."""
    values = [problem.actuator.value(name) for name in _shared(problem)]
    for prepared in problem.plans:
        for segment in prepared.segments:
            values += [value for _, value, _, _ in _free_start(segment, problem.actuator)]
    places = zip(problem.coordinates, values, strict=True)
    return np.array([c.of(min(max(value, c.low), c.high)) for c, value in places]), ()


def _start_stem(plan: Plan, segment: int) -> str:
    """Stem of the start values of a segment, which no recording has."""
    return f"{plan.log.name}, segment {segment}"


def _free_start(segment: Segment, actuator: Actuator) -> list[tuple[str, float, float, float]]:
    """Name, value and bounds of the unknown start values of a segment; none if Eq. (24) holds."""
    if segment.vented:
        return []
    p, y = actuator.parameters, segment.position_start
    free = [(POSITION_START, y, y - 2e-3, y + 2e-3)]
    if not np.isfinite(segment.pressure_start):
        free.append((PRESSURE_START, guessed_pressure(segment, actuator), 0.5 * p.P_0, max(2 * p.P_S, 2 * p.P_0)))
    return free


def _shared(problem: Problem) -> list[str]:
    """The free parameters, which stand before the start values."""
    return [c.base for c in problem.coordinates if c.stem is None]


def _segments(problem: Problem) -> Iterator[tuple[Plan, Segment, list[int]]]:
    """Each segment of each recording, and where x has its unknown start values."""
    own: dict[str | None, list[int]] = {}
    for i, c in enumerate(problem.coordinates):
        own.setdefault(c.stem, []).append(i)
    for prepared in problem.plans:
        for number, segment in enumerate(prepared.segments):
            yield prepared, segment, own.get(_start_stem(prepared, number), [])


def _start(
    problem: Problem, segment: Segment, at: Sequence[int], x: FloatArray, actuator: Actuator
) -> tuple[float, float]:
    """Position and pressure at the start of a segment, with those that are free from x at the places `at`."""
    values = {problem.coordinates[i].base: problem.coordinates[i].si(float(x[i])) for i in at}
    position = values.get(POSITION_START, segment.position_start)
    return position, values.get(PRESSURE_START, guessed_pressure(segment, actuator))


def _has_motion(problem: Problem) -> bool:
    """Whether the piston moves in any recording; without motion no parameter of the actuator can be determined."""
    spans = [p.log["position"][np.isfinite(p.log["position"])] for p in problem.plans]
    return any(span.size > 0 and float(np.ptp(span)) > _REST_RANGE for span in spans)


def _check_size(problem: Problem) -> None:
    samples = sum(
        int(np.isfinite(plan.log[name][s.start : s.stop]).sum())
        for plan, s, _ in _segments(problem)
        for name in problem.measure
    )
    if samples <= len(problem.coordinates):
        raise DataError(
            f"{problem.stems[0]}: {samples} measured samples for {len(problem.coordinates)} free parameters "
            f"({len(_shared(problem))} parameters and the unknown starts); record at least a full stroke."
        )


def two_stages(
    problem: Problem, x: FloatArray, progress: Progress | None
) -> tuple[Problem, Solution[Linearisation] | Failure]:
    """Solution of the search from x, or a `Failure` of its start, and the problem with the final noise scales.

    The coarse stage tries factors on the load and stops early; the fine stage continues from the best with the rms
    residuals as noise scales. The paper also optimises twice (Section 3.1).
    """
    count, cost = 0, np.nan

    def report(stage: Stage) -> None:
        nonlocal count
        count += 1
        if progress:
            progress(Step(stage, count, cost))

    def evaluate(at: FloatArray, stage: Stage) -> Linearisation | Failure:
        nonlocal cost
        report(stage)
        linearisation = linearise_segments(problem, at)
        if isinstance(linearisation, Linearisation):
            cost = float(np.fmin(cost, linearisation.cost))
        return linearisation

    trials = _trials(problem, x, lambda: report("coarse search"))
    begin = _best_start(problem, trials)
    if isinstance(begin, Failure):
        return problem, begin
    chosen, at = begin
    if not _has_motion(problem):
        still = Solution(x, at, "converged", count)
        return problem, replace(still, starts=_starts(problem, trials, chosen, still))
    low, high = problem.bounds()
    coarse = minimise(lambda x: evaluate(x, "coarse search"), (chosen.x, at), low, high, tolerance=1e-3)
    report("fine search")
    problem, again = _rescaled(problem, coarse)
    assert isinstance(again, Linearisation)
    fine = minimise(lambda x: evaluate(x, "fine search"), (coarse.x, again), low, high, tolerance=1e-9)
    fine = replace(fine, evaluations=count, status="limit" if fine.status == "limit" else "converged")
    return problem, replace(fine, starts=_starts(problem, trials, chosen, fine))


def _rescaled(problem: Problem, end: Solution[Linearisation]) -> tuple[Problem, Linearisation | Failure]:
    """The problem with its rms residuals at the end of a search as noise scales, and its linearisation there.

    Where a single column is measured, all rows are divided by the same number; otherwise they are simulated again.
    """
    if len(problem.measure) == 1:
        ((name, scale),), at = problem.noise.measured.items(), end.at
        rms = max(scale * float(np.sqrt(2.0 * at.cost / at.count)), _least_scale(name))
        factor = scale / rms
        again = Linearisation(factor * at.R, factor * at.q, factor**2 * at.cost, at.count)
        return replace(problem, noise=Noise(measured={name: rms})), again
    segments = [segment for segment in _simulated(problem, end.x) if not isinstance(segment, Failure)]
    problem = replace(problem, noise=Noise(measured=_rms_residuals(problem, segments)))
    return problem, _linearised((_compared(problem, segment) for segment in segments), end.x.size)


class _Trial(NamedTuple):
    """A start x, and the sum of squares of the errors there by measured column, in SI."""

    name: str
    x: FloatArray
    squares: Mapping[str, float]

    def cost(self, noise: Noise) -> float:
        """Sum of squares at the noise scales of `noise`."""
        return sum(total / noise.measured[name] ** 2 for name, total in self.squares.items())


def _trials(problem: Problem, x0: FloatArray, report: Callable[[], None]) -> list[_Trial]:
    """Several multiples of the initial load, if any load weight is free; else x0 alone, which is not simulated."""
    weights = [i for i, c in enumerate(problem.coordinates) if c.base in problem.actuator.load.names]
    trials = []
    for factor in COARSE_FACTORS if weights else (1.0,):
        report()
        x = x0.copy()
        x[weights] *= factor
        x = np.clip(x, *problem.bounds())
        name = f"load times {factor:g}" if weights else INITIAL_VALUES
        trials.append(_Trial(name, x, _squares(problem, x) if weights else {}))
    return trials


def _best_start(problem: Problem, trials: Sequence[_Trial]) -> tuple[_Trial, Linearisation] | Failure:
    """The trial that costs least, linearised."""
    failure = None
    for trial in sorted(trials, key=lambda trial: trial.cost(problem.noise)):
        linearisation = linearise_segments(problem, trial.x)
        if isinstance(linearisation, Linearisation):
            return trial, linearisation
        failure = failure or linearisation
    return failure or Failure("no start can be simulated")


def _starts(
    problem: Problem, trials: Sequence[_Trial], chosen: _Trial, end: Solution[Linearisation]
) -> tuple[Start, ...]:
    """Every trial with its cost; the `chosen` one is that which ended at `end`."""
    starts = []
    for trial in trials:
        cost = 2.0 * end.at.cost if trial is chosen else trial.cost(problem.noise)
        others: StartStatus = "not searched" if np.isfinite(cost) else "failed"
        starts.append(Start(trial.name, cost, end.status if trial is chosen else others))
    return tuple(starts)


def _squares(problem: Problem, x: FloatArray) -> dict[str, float]:
    """Sum of squares of the errors at `x` by measured column, in SI; infinite where a simulation fails."""
    squares = dict.fromkeys(problem.measure, 0.0)
    for number, prepared in enumerate(problem.plans):
        states = simulated_states(problem, x, number)
        if not all(np.isfinite(states[segment.start : segment.stop]).all() for segment in prepared.segments):
            return dict.fromkeys(problem.measure, np.inf)
        for name in problem.measure:
            difference = states[:, problem.actuator.states.index(MEASURED[name].state)] - prepared.log[name]
            with np.errstate(over="ignore"):
                squares[name] += float(np.nansum(difference**2))
    return squares


def _rms_residuals(problem: Problem, segments: Sequence[SimulatedSegment]) -> dict[str, float]:
    """Rms residual of every measured column, or its least scale."""
    rms = {}
    for name, scale in problem.noise.measured.items():
        at = problem.actuator.states.index(MEASURED[name].state)
        pieces = [s.states[:, at] - s.plan.log[name][s.segment.start : s.segment.stop] for s in segments]
        total = sum(float(np.nansum((piece / scale) ** 2)) * scale**2 for piece in pieces)
        count = sum(int(np.isfinite(piece).sum()) for piece in pieces)
        rms[name] = max(float(np.sqrt(total / max(1, count))), _least_scale(name))
    return rms


def _least_scale(name: str) -> float:
    """Least noise scale of a measured column: a thousandth of the first."""
    return 1e-3 * MEASURED[name].first_scale


class SimulatedSegment(NamedTuple):
    """States (n, n_states) of a segment, and derivatives (n, watched, k') of those measured, in SI.

    Times `slopes` (k',) they are those to x at `places`.
    """

    plan: Plan
    segment: Segment
    places: list[int]
    states: FloatArray
    sens: FloatArray
    slopes: FloatArray


class SegmentResiduals(NamedTuple):
    """``[J r]`` (m, k' + 1) of a segment: scaled residuals, their Jacobian in x at `places`; scale, sample of each."""

    plan: Plan
    segment: Segment
    places: list[int]
    rows: FloatArray
    scales: FloatArray
    samples: NDArray[np.int64]

    @property
    def J(self) -> FloatArray:
        """The Jacobian (m, k')."""
        return self.rows[:, :-1]

    @property
    def r(self) -> FloatArray:
        """The residuals (m,)."""
        return self.rows[:, -1]


def linearise_segments(problem: Problem, x: FloatArray) -> Linearisation | Failure:
    """Compressed residuals and Jacobian at `x`; a `Failure` if a simulation fails or parameters are contradictory."""
    return _linearised(residuals(problem, x), x.size)


def _linearised(segments: Iterable[SegmentResiduals | Failure], width: int) -> Linearisation | Failure:
    factor = np.zeros((0, width + 1))
    count, cost = 0, 0.0
    for segment in segments:
        if isinstance(segment, Failure):
            return segment
        count += len(segment.rows)
        with np.errstate(over="ignore", invalid="ignore"):
            local = compress(segment.rows)
            cost += 0.5 * float(np.sum(local[:, -1] ** 2))
        if not (np.isfinite(local).all() and np.isfinite(cost)):
            return Failure(f"{segment.plan.log.name}: the simulation grows beyond all bounds")
        rows = np.zeros((local.shape[0], width + 1))
        rows[:, [*segment.places, width]] = local
        factor = np.vstack([factor, rows])
    if count == 0:
        return Failure("no measured sample can be compared with the simulation")
    R = np.zeros((width + 1, width + 1))
    reduced = triangular(factor)
    R[: reduced.shape[0]] = reduced
    return Linearisation(R[:width, :width], R[:width, width], cost, count)


def residuals(problem: Problem, x: FloatArray, rests: bool = False) -> Iterator[SegmentResiduals | Failure]:
    """The residuals of each segment at `x`; missing samples are left out, element by element.

    With `rests`, J has a last column more, per m of the start position, where that is taken from a rest.
    """
    for simulated in _simulated(problem, x, rests):
        yield simulated if isinstance(simulated, Failure) else _compared(problem, simulated)


def _simulated(problem: Problem, x: FloatArray, rests: bool = False) -> Iterator[SimulatedSegment | Failure]:
    try:
        actuator = problem.actuator_of(x, problem.stems[0])
    except ParameterError as error:
        yield Failure(str(error))
        return
    arrays, shared = KernelArrays.of(actuator), _shared(problem)
    watched = [actuator.states.index(MEASURED[name].state) for name in problem.measure]
    slopes = problem.slopes(x)
    for prepared, segment, at in _segments(problem):
        last = [POSITION_START] if rests and segment.rest > 0 else []
        which = columns(actuator, [*shared, *(problem.coordinates[i].base for i in at), *last])
        x0 = start_state(segment, actuator, _start(problem, segment, at, x, actuator))
        start = x0, start_sensitivities(segment, actuator, which, estimated=bool(at))
        states, sens, _, failed = run_with_sensitivities(segment, arrays, start, which, watched)
        if failed >= 0:
            yield Failure(failure_message(prepared.log, segment, states, failed, actuator.states, actuator))
            return
        places = [*range(len(shared)), *at]
        of_columns = np.append(slopes[places], np.ones(len(last)))
        yield SimulatedSegment(prepared, segment, places, states, sens, of_columns)


def _compared(problem: Problem, simulated: SimulatedSegment) -> SegmentResiduals:
    prepared, segment, places, states, sens, slopes = simulated
    parts, samples = [], []
    names, scales = problem.actuator.states, problem.noise.measured
    for i, name in enumerate(problem.measure):
        values = prepared.log[name][segment.start : segment.stop]
        difference = states[:, names.index(MEASURED[name].state)] - values
        finite = np.isfinite(difference)
        compared = slice(None) if finite.all() else finite  # a slice makes no copy
        samples.append(np.flatnonzero(finite))
        rows = np.empty((samples[-1].size, slopes.size + 1))
        for column, slope in enumerate(slopes):  # by column: NumPy's loops over a few columns take three times as long
            rows[:, column] = sens[compared, i, column] * slope / scales[name]
        rows[:, -1] = difference[compared] / scales[name]
        parts.append(rows)
    of_rows = np.repeat([scales[name] for name in problem.measure], [len(part) for part in parts])
    if len(parts) == 1:
        return SegmentResiduals(prepared, segment, places, parts[0], of_rows, samples[0])
    return SegmentResiduals(prepared, segment, places, np.concatenate(parts), of_rows, np.concatenate(samples))


def simulated_states(problem: Problem, x: FloatArray, log: int) -> FloatArray:
    """States of recording `log` at `x`, shape (n, n_states); NaN outside segments and after a failure."""
    actuator, mine = problem.actuator_of(x, problem.stems[log]), problem.plans[log]
    arrays = KernelArrays.of(actuator)
    states = np.full((len(mine.log), len(actuator.states)), np.nan)
    for prepared, segment, at in _segments(problem):
        if prepared is mine:
            x0 = start_state(segment, actuator, _start(problem, segment, at, x, actuator))
            states[segment.start : segment.stop] = run(segment, arrays, x0)[0]
    return states


def result(problem: Problem, solution: Solution[Linearisation], *_: object) -> MethodResult:
    """Covariance at the solution of a search, and the recordings simulated there."""
    x, names = solution.x, _shared(problem)
    fitted, covariance = problem.actuator_of(x, problem.stems[0]), _covariance(problem, solution)
    compared = _recordings(problem, x, fitted)
    recordings = {recording.measured.name: recording for recording, _ in compared}
    warnings = [_resting(names)]
    if _has_motion(problem):
        reach = furthest([recording.measured for recording in recordings.values()])
        with_pressure = "pressure_a" in problem.measure
        warnings = identifiability_warnings(solution.at.R, names, fitted, reach, with_pressure)
        warnings += _does_not_move(recordings)
    notes = _estimated_starts(problem, recordings)
    return MethodResult(covariance.matrix, solution.at.R, compared, covariance.quantile(), warnings, notes)


def _estimated_starts(problem: Problem, recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """A note for each recording whose start was estimated: a simulation needs the same start for the same errors."""
    notes = []
    for prepared in problem.plans:
        name, first = prepared.log.name, _start_stem(prepared, 0)
        free = [c.base for c in problem.coordinates if c.stem == first]
        if not free:
            continue
        position, pressure = recordings[name].starts[0]
        estimated = f"position {position * 1e3:.3g} mm"
        estimated += f" and pressure {pressure / 1e5:.4g} bar" if PRESSURE_START in free else ""
        notes.append(
            f"{name}: does not start vented and at rest, so its start was estimated: {estimated}. A saved result "
            f"keeps it for clutchid simulate; in Python pass starts=fit.recordings['{name}'].starts."
        )
    return tuple(notes)


def furthest(logs: Sequence[Log]) -> float:
    """Largest finite position in m; 0 if there is none."""
    positions = [log["position"][np.isfinite(log["position"])] for log in logs]
    return max((float(position.max()) for position in positions if position.size), default=0.0)


def _resting(names: Sequence[str]) -> str:
    return (
        f"the recording has no motion, so it cannot determine {in_words(names) or 'the actuator'}; the start values "
        "are kept, the intervals are infinite."
    )


def _does_not_move(recordings: Mapping[str, Recording]) -> list[str]:
    """A warning if the measured piston strokes and the simulated one hardly moves."""
    stuck = [
        name
        for name, recording in recordings.items()
        if furthest([recording.simulated]) < 0.1 * furthest([recording.measured])
    ]
    return [
        f"{name}: the piston moves in the recording but not in the simulation; check the supply pressure, P_S, and "
        "that supply and exhaust are not swapped."
        for name in stuck
    ]


def _recordings(problem: Problem, x: FloatArray, fitted: Actuator) -> list[Compared]:
    starts: dict[str, list[tuple[float, float]]] = {stem: [] for stem in problem.stems}
    for prepared, segment, at in _segments(problem):
        starts[prepared.log.name].append(_start(problem, segment, at, x, fitted))
    return [
        compare_states(prepared, simulated_states(problem, x, number), starts[prepared.log.name])
        for number, prepared in enumerate(problem.plans)
    ]


def _covariance(problem: Problem, solution: Solution[Linearisation]) -> Covariance:
    scores, constants = [], []
    for part in residuals(problem, solution.x, rests=True):
        assert not isinstance(part, Failure)
        width = len(part.places)
        # all columns of a sample share one score, which includes their correlation
        rows = np.zeros((len(part.segment), solution.x.size))
        for column, place in enumerate(part.places):
            rows[:, place] = np.bincount(part.samples, part.J[:, column] * part.r, len(rows))
        scores.append(rows)
        gradient = np.zeros(solution.x.size)
        gradient[part.places] = part.J[:, :width].T @ part.J[:, width:].sum(axis=1)
        constants.append(gradient * _start_std(problem, part.segment))
    determined = identifiable(solution.at.R) & ~_at_active_bound(problem, solution) & _has_motion(problem)
    return sandwich(solution.at.R, scores, determined, len(_shared(problem)), np.transpose(constants))


def _start_std(problem: Problem, segment: Segment) -> float:
    """Standard deviation in m of a start position that is the median of a rest: a sample's, where the rest is one."""
    return problem.noise.measured.get("position", 0.0) * min(1.0, float(np.sqrt(0.5 * np.pi / max(1, segment.rest))))


def _at_active_bound(problem: Problem, solution: Solution[Linearisation]) -> NDArray[np.bool_]:
    """Parameters at an active bound, except load weights: their covariance is that of fixed parameters.

    A weight at its bound stays uncertain in the interval of the load, because it may be larger.
    """
    x, gradient = solution.x, solution.at.R.T @ solution.at.q
    low, high = problem.bounds()
    active: NDArray[np.bool_] = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
    active[[i for i, c in enumerate(problem.coordinates) if c.base in problem.actuator.load.names]] = False
    active[len(_shared(problem)) :] = False
    return active


#: The paper's method.
SIMULATION = Method("simulation", problem_of, search, evaluated, rows, start_values, result, priors=False)
