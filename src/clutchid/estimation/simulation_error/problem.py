"""Simulation error as a least-squares problem: free parameters, compared samples, residuals and exact Jacobian."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.gaussian import natural_sizes
from clutchid.log import FloatArray
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, compress, triangular
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.plan import Plan, Segment
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

IntArray = NDArray[np.int64]

#: A recording with a smaller range of positions, in m, has no motion.
REST_RANGE = 5e-4

#: Natural size of start values in m and Pa.
_START_UNITS = {POSITION_START: 1e-3, PRESSURE_START: 1e5}


@dataclass(frozen=True, slots=True, eq=False)
class ProblemSegment:
    """One segment of one recording; `start` are the indices in x of its free start values, if it has any."""

    log: int
    segment: Segment
    start: tuple[int, ...]
    start_names: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Free parameters x: shared parameters `names`, then free start values of segments, each divided by its `unit`.

    `measure` are the compared columns, `low` and `high` the bounds of x. The units make all elements of x of order one,
    so that thresholds are independent of the physical quantity.
    """

    actuator: Actuator
    plans: tuple[Plan, ...]
    names: tuple[str, ...]
    measure: tuple[str, ...]
    segments: tuple[ProblemSegment, ...]
    unit: FloatArray
    x0: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def has_motion(self) -> bool:
        """Whether the piston moves in any recording; without motion no parameter of the actuator can be determined."""
        spans = [p.log["position"][np.isfinite(p.log["position"])] for p in self.plans]
        return any(span.size > 0 and float(np.ptp(span)) > REST_RANGE for span in spans)

    def si(self, x: FloatArray) -> FloatArray:
        """`x` in SI units."""
        return x * self.unit

    def actuator_at(self, x: FloatArray) -> Actuator:
        """The actuator with the free parameters of `x`; ParameterError if they contradict each other."""
        return self.actuator.replace(dict(zip(self.names, self.si(x).tolist(), strict=False)))

    def starts_at(self, x: FloatArray, log: int, actuator: Actuator) -> list[tuple[float, float]]:
        """Position and pressure at the start of every segment of a recording."""
        return [self.start_of(part, x, actuator) for part in self.segments if part.log == log]

    def start_of(self, part: ProblemSegment, x: FloatArray, actuator: Actuator) -> tuple[float, float]:
        """Position and pressure at the start of one segment."""
        values = dict(zip(part.start_names, (float(self.si(x)[i]) for i in part.start), strict=True))
        position = values.get(POSITION_START, part.segment.position_start)
        return position, values.get(PRESSURE_START, guessed_pressure(part.segment, actuator))


def build_problem(
    actuator: Actuator,
    plans: Sequence[Plan],
    names: Sequence[str],
    measure: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
) -> Problem:
    """Set up a fit of `names` to the recordings `plans`, starting at the values of `actuator`."""
    x0 = [actuator.value(name) for name in names]
    unit = natural_sizes(actuator, names).tolist()
    low, high = [bounds[name][0] for name in names], [bounds[name][1] for name in names]
    segments = []
    for number, prepared in enumerate(plans):
        for segment in prepared.segments:
            free = _free_start(segment, actuator)
            place = tuple(range(len(x0), len(x0) + len(free)))
            segments.append(ProblemSegment(number, segment, place, tuple(name for name, *_ in free)))
            for name, value, lowest, highest in free:
                x0.append(value)
                unit.append(_START_UNITS[name])
                low.append(lowest)
                high.append(highest)
    scale = np.array(unit)
    return Problem(
        actuator, tuple(plans), tuple(names), tuple(measure), tuple(segments), scale,
        np.clip(np.array(x0), low, high) / scale, np.array(low) / scale, np.array(high) / scale,
    )  # fmt: skip


def _free_start(segment: Segment, actuator: Actuator) -> list[tuple[str, float, float, float]]:
    """Name, value and bounds of the unknown start values of a segment; none if Eq. (24) holds."""
    if segment.vented:
        return []
    p, y = actuator.parameters, segment.position_start
    free = [(POSITION_START, y, y - 2e-3, y + 2e-3)]
    if not np.isfinite(segment.pressure_start):
        free.append((PRESSURE_START, guessed_pressure(segment, actuator), 0.5 * p.P_0, max(2 * p.P_S, 2 * p.P_0)))
    return free


def linearise(problem: Problem, x: FloatArray, scales: Mapping[str, float]) -> Linearisation | Failure:
    """Compressed residuals and Jacobian at `x`; a `Failure` if a simulation fails or parameters are contradictory."""
    width = x.size
    factor = np.zeros((0, width + 1))
    count, cost = 0, 0.0
    for answer in residuals(problem, x, scales):
        if isinstance(answer, Failure):
            return answer
        part, r, J, _ = answer
        count += r.size
        with np.errstate(over="ignore", invalid="ignore"):
            local = compress(J, r)
            cost += 0.5 * float(np.sum(local[:, -1] ** 2))
        if not (np.isfinite(local).all() and np.isfinite(cost)):
            return Failure(f"{problem.plans[part.log].log.name}: the simulation grows beyond all bounds")
        rows = np.zeros((local.shape[0], width + 1))
        rows[:, [*range(len(problem.names)), *part.start, width]] = local
        factor = np.vstack([factor, rows])
    if count == 0:
        return Failure("no measured sample can be compared with the simulation")
    R = np.zeros((width + 1, width + 1))
    reduced = triangular(factor)
    R[: reduced.shape[0]] = reduced
    return Linearisation(R[:width, :width], R[:width, width], cost, count)


def residuals(
    problem: Problem, x: FloatArray, scales: Mapping[str, float]
) -> Iterator[tuple[ProblemSegment, FloatArray, FloatArray, IntArray] | Failure]:
    """For each segment: scaled residuals (m,), Jacobian (m, k_local), and the sample of each residual.

    Missing samples are left out, element by element.
    """
    try:
        actuator = problem.actuator_at(x)
    except ParameterError as error:
        yield Failure(str(error))
        return
    arrays = KernelArrays.of(actuator)
    states_of = actuator.states
    watched = [states_of.index(MEASURED[name].state) for name in problem.measure]
    for part in problem.segments:
        log, segment = problem.plans[part.log].log, part.segment
        which = columns(actuator, [*problem.names, *part.start_names])
        x0 = start_state(segment, actuator, problem.start_of(part, x, actuator))
        start = x0, start_sensitivities(segment, actuator, which, estimated=bool(part.start))
        states, sens, failed = run_with_sensitivities(segment, arrays, start, which, watched)
        if failed >= 0:
            yield Failure(failure_message(log, segment, states, failed, states_of, actuator))
            return
        unit = problem.unit[[*range(len(problem.names)), *part.start]]
        yield part, *_compared(problem, part, states, sens * unit, scales)


def _compared(
    problem: Problem, part: ProblemSegment, states: FloatArray, sens: FloatArray, scales: Mapping[str, float]
) -> tuple[FloatArray, FloatArray, IntArray]:
    log, segment = problem.plans[part.log].log, part.segment
    r_parts, J_parts, at_parts = [], [], []
    names = problem.actuator.states
    for i, name in enumerate(problem.measure):
        difference = states[:, names.index(MEASURED[name].state)] - log[name][segment.start : segment.stop]
        known = np.isfinite(difference)
        at_parts.append(np.flatnonzero(known))
        if known.all():
            r_parts.append(difference / scales[name])
            J_parts.append(sens[:, i] / scales[name])
        else:
            r_parts.append(difference[known] / scales[name])
            J_parts.append(sens[known, i] / scales[name])
    if len(r_parts) == 1:
        return r_parts[0], J_parts[0], at_parts[0]
    return np.concatenate(r_parts), np.concatenate(J_parts), np.concatenate(at_parts)


def simulated_states(problem: Problem, x: FloatArray, log: int) -> FloatArray:
    """States of recording `log` at `x`, shape (n, n_states); NaN outside segments and after a failure."""
    actuator = problem.actuator_at(x)
    arrays = KernelArrays.of(actuator)
    states = np.full((len(problem.plans[log].log), len(actuator.states)), np.nan)
    for part in problem.segments:
        if part.log == log:
            x0 = start_state(part.segment, actuator, problem.start_of(part, x, actuator))
            states[part.segment.start : part.segment.stop] = run(part.segment, arrays, x0)[0]
    return states
