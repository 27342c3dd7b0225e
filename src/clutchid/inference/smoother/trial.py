"""A trial step from a linearised problem: its cost, and the linearised problem after it.

Most windows are nearly linear over a step. Only windows that have moved noticeably are simulated, and only those that
deviate from the linear prediction are linearised again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clutchid.inference.smoother.problem import (
    NOT_FINITE,
    FitProblem,
    LinearisedProblem,
    SimulatedWindows,
    assemble,
    linearise_windows,
    total_cost,
)
from clutchid.inference.smoother.rows import link_costs, window_cost
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.threads import map_pairs
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.windows import Track, units

#: A window is simulated again if the linear change of its residuals and final state since the last simulation exceeds
#: this, in standard deviations.
RESIMULATION_DISTANCE = 0.1

#: A window keeps its derivatives while its cost, and its final state in standard deviations of the process noise, are
#: this close to the linear prediction.
COST_TOLERANCE, END_TOLERANCE = 0.05, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """An evaluated step.

    `excess`, one array per track, is the cost of each window and of the link after it beyond the linear prediction;
    `parameter_maps` are those of the recordings at x.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    simulated: tuple[SimulatedWindows, ...]
    excess: tuple[FloatArray, ...]
    cost: float
    parameter_maps: dict[str, ParameterMap]


#: Answer for a step that does not lower the cost.
NO_GAIN = Failure("the step gains nothing")


def evaluate_step(
    problem: FitProblem, current: LinearisedProblem, x: FloatArray, X: Sequence[FloatArray], last: Trial | None = None
) -> Trial | Failure:
    """Evaluate the step from `current` to `x` and `X`; simulations of the `last` trial are reused where possible."""
    parameter_maps = problem.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    before = last.simulated if last else tuple(chain.windows for chain in current.chains)
    simulated = []
    for number, (track, old) in enumerate(zip(problem.tracks, before, strict=True)):
        extrapolated = _extrapolated(problem, current, (x, X[number]), number, old)
        windows = _simulated(problem, track, parameter_maps[problem.stems[track.log]], X[number], extrapolated)
        if isinstance(windows, Failure):
            return windows
        simulated.append(windows)
    return _trial(problem, x, X, parameter_maps, simulated)


def _extrapolated(
    problem: FitProblem,
    current: LinearisedProblem,
    at: tuple[FloatArray, FloatArray],
    number: int,
    old: SimulatedWindows,
) -> SimulatedWindows:
    """Linear extrapolation of the windows of track `number` to x and starts `at`; `old` were simulated last."""
    x, starts = at
    base = current.chains[number].windows.linearised
    step = (x - current.x)[: base.to_theta.shape[2]]
    linearised = base.extrapolated((starts - current.X[number]) / units(problem.actuator), step)
    end_change = (linearised.end - old.linearised.end) / problem.sigmas[number]
    shift = np.hypot(np.linalg.norm(linearised.r - old.linearised.r, axis=1), np.linalg.norm(end_change, axis=1))
    ends, costs = old.ends + linearised.end - old.linearised.end, old.costs + linearised.cost - old.linearised.cost
    return SimulatedWindows(linearised, ends, costs, old.distance + shift)


def _simulated(
    problem: FitProblem, track: Track, mapped: ParameterMap, starts: FloatArray, windows: SimulatedWindows
) -> SimulatedWindows | Failure:
    """`windows`, with those simulated whose `distance` is too large."""
    ends, costs, distance = windows.ends.copy(), windows.costs.copy(), windows.distance.copy()
    places = np.flatnonzero(~(distance <= RESIMULATION_DISTANCE))
    work = partial(window_cost, track, mapped=mapped, measure=problem.measure, noise=problem.noise)
    answers = map_pairs(work, [track.windows[i] for i in places], starts[places])
    for i, answer in zip(places, answers, strict=True):
        if isinstance(answer, Failure):
            return answer
        ends[i], costs[i] = answer
    distance[places] = 0.0
    return SimulatedWindows(windows.linearised, ends, costs, distance)


def _trial(
    problem: FitProblem,
    x: FloatArray,
    X: Sequence[FloatArray],
    parameter_maps: dict[str, ParameterMap],
    simulated: Sequence[SimulatedWindows],
) -> Trial | Failure:
    cost = total_cost(problem, parameter_maps, x, X, simulated)
    if not np.isfinite(cost):
        return NOT_FINITE
    excess = []
    for sigma, starts, windows in zip(problem.sigmas, X, simulated, strict=True):
        linked = partial(link_costs, starts=starts, sigma=sigma, outlier=problem.noise.outlier)
        excess.append(windows.costs - windows.linearised.cost + linked(windows.ends) - linked(windows.linearised.end))
    return Trial(x, tuple(X), tuple(simulated), tuple(excess), cost, parameter_maps)


def accept(problem: FitProblem, trial: Trial, free: bool = True) -> LinearisedProblem | Failure:
    """Linearise the problem after a step; without `free`, with theta fixed."""
    parameter_maps = (
        trial.parameter_maps if free else {stem: mapped.fixed() for stem, mapped in trial.parameter_maps.items()}
    )
    simulated = []
    for number, (track, windows, excess) in enumerate(zip(problem.tracks, trial.simulated, trial.excess, strict=True)):
        linearised = windows.linearised if free else windows.linearised.states_only()
        end_error = np.linalg.norm((windows.ends - linearised.end) / problem.sigmas[number], axis=1)
        places = np.flatnonzero((np.abs(excess) > COST_TOLERANCE) | (end_error > END_TOLERANCE))
        if places.size:
            new = linearise_windows(problem, track, parameter_maps, trial.X[number], places.tolist())
            if isinstance(new, Failure):
                return new
            linearised = linearised.updated(places, new)
        simulated.append(replace(windows, linearised=linearised))
    return assemble(problem, parameter_maps, (trial.x, trial.X), simulated, trial.cost)


def with_theta_fixed(problem: FitProblem, current: LinearisedProblem) -> LinearisedProblem:
    """`current` with theta fixed."""
    n = len(problem.actuator.states)
    theta = np.arange(n, n + current.x.size)
    chains = []
    for chain in current.chains:
        first, links = np.delete(chain.first, theta, axis=1), np.delete(chain.links, n + theta, axis=2)
        windows = replace(chain.windows, linearised=chain.windows.linearised.states_only())
        chains.append(replace(chain, first=first, links=links, windows=windows))
    return replace(current, chains=tuple(chains))


def with_theta_free(
    problem: FitProblem, current: LinearisedProblem, candidate: LinearisedProblem
) -> LinearisedProblem | Failure:
    """`candidate`, linearised with theta fixed, with theta free; `current` provides the derivatives to start from."""
    parameter_maps = problem.parameter_maps(candidate.x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    unit, step = units(problem.actuator), candidate.x - current.x
    simulated = [
        replace(new.windows, linearised=old.windows.linearised.extrapolated((after - before) / unit, step))
        for old, new, before, after in zip(current.chains, candidate.chains, current.X, candidate.X, strict=True)
    ]
    trial = _trial(problem, candidate.x, candidate.X, parameter_maps, simulated)
    return trial if isinstance(trial, Failure) else accept(problem, trial)
