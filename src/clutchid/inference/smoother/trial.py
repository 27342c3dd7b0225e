"""A trial step from a linearised problem, and minimisation over its states with fixed parameters.

Most windows are nearly linear over a step. Only windows that have moved noticeably are simulated, and only those that
deviate from the linear prediction are linearised again.

A few windows with stiction are strongly nonlinear, so that a full step there raises the cost. A common damping would
slow down all other windows; each window therefore has a damping of its own, raised where the linear prediction failed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import (
    NOT_FINITE,
    LinearisedProblem,
    SimulatedWindows,
    assemble,
    condense,
    linearise_windows,
    total_cost,
)
from clutchid.inference.smoother.rows import Eliminated, Sensors, link_costs, recover, window_cost
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
COST_TOLERANCE, _END_TOLERANCE = 0.05, 0.5


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
    problem: Problem, current: LinearisedProblem, x: FloatArray, X: Sequence[FloatArray], last: Trial | None = None
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
    problem: Problem,
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
    problem: Problem, track: Track, mapped: ParameterMap, starts: FloatArray, windows: SimulatedWindows
) -> SimulatedWindows | Failure:
    """`windows`, with those simulated whose `distance` is too large."""
    ends, costs, distance = windows.ends.copy(), windows.costs.copy(), windows.distance.copy()
    places = np.flatnonzero(~(distance <= RESIMULATION_DISTANCE))
    sensors = Sensors.of(track, mapped, problem.measure, problem.noise)
    work = partial(window_cost, track, mapped=mapped, sensors=sensors)
    answers = map_pairs(work, [track.windows[i] for i in places], starts[places])
    for i, answer in zip(places, answers, strict=True):
        if isinstance(answer, Failure):
            return answer
        ends[i], costs[i] = answer
    distance[places] = 0.0
    return SimulatedWindows(windows.linearised, ends, costs, distance)


def _trial(
    problem: Problem,
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


def accept(problem: Problem, trial: Trial, free: bool = True) -> LinearisedProblem | Failure:
    """Linearise the problem after a step; without `free`, with theta fixed."""
    parameter_maps = (
        trial.parameter_maps if free else {stem: mapped.fixed() for stem, mapped in trial.parameter_maps.items()}
    )
    simulated = []
    for number, (track, windows, excess) in enumerate(zip(problem.tracks, trial.simulated, trial.excess, strict=True)):
        linearised = windows.linearised if free else windows.linearised.states_only()
        end_error = np.linalg.norm((windows.ends - linearised.end) / problem.sigmas[number], axis=1)
        places = np.flatnonzero((np.abs(excess) > COST_TOLERANCE) | (end_error > _END_TOLERANCE))
        if places.size:
            new = linearise_windows(problem, track, parameter_maps, trial.X[number], places.tolist())
            if isinstance(new, Failure):
                return new
            linearised = linearised.updated(places, new)
        simulated.append(replace(windows, linearised=linearised))
    return assemble(problem, parameter_maps, (trial.x, trial.X), simulated, trial.cost)


def with_theta_fixed(problem: Problem, current: LinearisedProblem) -> LinearisedProblem:
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
    problem: Problem, current: LinearisedProblem, candidate: LinearisedProblem
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


#: Most steps, most trials of a step, and the decrease of the cost below which the states have converged.
MAX_STEPS, MAX_TRIALS, CONVERGED_GAIN = 12, 6, 0.3

#: Damping of a window: initial, least value after a failed prediction, least value, and factor of a change.
INITIAL_DAMPING, REJECTED_DAMPING, _MIN_DAMPING, _DAMPING_FACTOR = 1e-3, 1.0, 1e-6, 10.0

#: The prediction failed in a window whose cost exceeds it by more than this fraction of the total predicted gain.
_REJECTED_EXCESS = 0.05

States = tuple[FloatArray, ...]
Damping = list[FloatArray]


def initial_damping(problem: Problem) -> Damping:
    """Damping of all windows before the first step: one array per track, which the search changes in place."""
    return [np.full(len(track.windows), INITIAL_DAMPING) for track in problem.tracks]


def minimise_states(
    problem: Problem, current: LinearisedProblem, damping: Damping, on_evaluation: Callable[[], bool]
) -> LinearisedProblem:
    """Minimise the cost over the states, with theta fixed.

    Parameters
    ----------
    problem : Problem
        Recordings and noise.
    current : LinearisedProblem
        Start, with theta fixed.
    damping : one array per track
        Damping of each window; changed in place, for the next call.
    on_evaluation : function
        Called before each step; True ends the steps.

    Returns
    -------
    minimised : LinearisedProblem
        With a cost of at most that of `current`.
    """
    for _ in range(MAX_STEPS):
        if on_evaluation():
            break
        before = current.cost
        current = _step(problem, current, damping)
        if before - current.cost < CONVERGED_GAIN:
            break
    return current


def _step(problem: Problem, current: LinearisedProblem, damping: Damping) -> LinearisedProblem:
    """The problem after a step of the states that lowers the cost, or `current`."""
    trial: Trial | None = None
    for _ in range(MAX_TRIALS):
        _, chains = condense(problem, current, damping)
        X = stepped_states(problem, current.X, chains, np.zeros(0))
        candidate = evaluate_step(problem, current, current.x, X, trial)
        if isinstance(candidate, Failure):
            damping[:] = [_DAMPING_FACTOR * windows for windows in damping]
            continue
        trial = candidate
        predicted = _update_damping(current, trial, damping)
        if trial.cost < current.cost:
            accepted = accept(problem, trial, free=False)
            if isinstance(accepted, LinearisedProblem):
                return accepted
        if predicted < CONVERGED_GAIN:
            break
    return current


def _update_damping(current: LinearisedProblem, trial: Trial, damping: Damping) -> float:
    """Raise the damping of windows whose prediction failed, lower the others after a gain; the predicted gain."""
    before = [chain.windows.costs - chain.windows.linearised.cost for chain in current.chains]
    excess = [now - then for now, then in zip(trial.excess, before, strict=True)]
    gain = current.cost - trial.cost
    predicted = gain + sum(float(more.sum()) for more in excess)
    for windows, more in zip(damping, excess, strict=True):
        failed = more > _REJECTED_EXCESS * max(predicted, CONVERGED_GAIN)
        windows[failed] = np.maximum(windows[failed] * _DAMPING_FACTOR, REJECTED_DAMPING)
        if gain > 0.0:
            windows[~failed] = np.maximum(windows[~failed] / _DAMPING_FACTOR, _MIN_DAMPING)
    return predicted


def stepped_states(problem: Problem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray) -> States:
    """States `X` after the Gauss-Newton step that belongs to a `step` of the parameters, empty if those are fixed."""
    unit = units(problem.actuator)
    return tuple(x + recover(chain, step[:, None])[:, :, 0] * unit for x, chain in zip(X, chains, strict=True))


def shifted_states(problem: Problem, X: Sequence[FloatArray], chains: Sequence[Eliminated], step: FloatArray) -> States:
    """Minimised states `X` shifted, to first order, with a `step` of the parameters."""
    without, with_step = (stepped_states(problem, X, chains, by) for by in (np.zeros_like(step), step))
    return tuple(x + (after - before) for x, before, after in zip(X, without, with_step, strict=True))
