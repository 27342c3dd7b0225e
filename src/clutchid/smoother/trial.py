"""A small step from a linearised problem: what it costs, and the problem where it leads.

Most windows are so nearly linear that they do what their rows say. Only those that move are simulated, and only those
that do otherwise are linearised again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.threads import each
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.windows import Track, units
from clutchid.smoother.links import link_costs
from clutchid.smoother.problem import (
    NOT_FINITE,
    FitProblem,
    LinearisedProblem,
    SimulatedWindows,
    assembled,
    cost_of,
    linearise_windows,
)
from clutchid.smoother.window_rows import window_cost

#: A window is simulated where what it says has moved by so many standard deviations since it was last.
DRIFT = 0.1

#: A window keeps its derivatives while its cost and its end, in standard deviations of the model's own error, are this
#: near to what they say.
NEAR_COST, NEAR_END = 0.05, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """Where a step leads.

    `excess`, an array a track, is how much more each window with the link after it costs than the linear problem says;
    `parameter_maps` are those of the recordings on x.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    simulated: tuple[SimulatedWindows, ...]
    excess: tuple[FloatArray, ...]
    cost: float
    parameter_maps: dict[str, ParameterMap]


#: What is said of a step after which the problem does not cost less.
NO_GAIN = Failure("the step gains nothing")


def attempt(
    task: FitProblem, here: LinearisedProblem, x: FloatArray, X: Sequence[FloatArray], last: Trial | None = None
) -> Trial | Failure:
    """What the step from `here` to `x` and `X` costs; windows that are where the `last` trial had them are not new."""
    parameter_maps = task.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    before = last.simulated if last else tuple(chain.windows for chain in here.chains)
    simulated = []
    for number, (track, old) in enumerate(zip(task.tracks, before, strict=True)):
        moved = _moved_windows(task, here, (x, X[number]), number, old)
        windows = _simulated(task, track, parameter_maps[task.stems[track.log]], X[number], moved)
        if isinstance(windows, Failure):
            return windows
        simulated.append(windows)
    return _trial(task, x, X, parameter_maps, simulated)


def _moved_windows(
    task: FitProblem, here: LinearisedProblem, at: tuple[FloatArray, FloatArray], number: int, old: SimulatedWindows
) -> SimulatedWindows:
    """A track where x and its starts are `at`, as its rows say; `old` is how it was simulated last."""
    x, starts = at
    base = here.chains[number].windows.linearised
    step = (x - here.x)[: base.to_theta.shape[2]]
    linearised = base.moved((starts - here.X[number]) / units(task.actuator), step)
    ends_off = (linearised.end - old.linearised.end) / task.sigmas[number]
    shift = np.hypot(np.linalg.norm(linearised.r - old.linearised.r, axis=1), np.linalg.norm(ends_off, axis=1))
    ends, costs = old.ends + linearised.end - old.linearised.end, old.costs + linearised.cost - old.linearised.cost
    return SimulatedWindows(linearised, ends, costs, old.drift + shift)


def _simulated(
    task: FitProblem, track: Track, mapped: ParameterMap, starts: FloatArray, windows: SimulatedWindows
) -> SimulatedWindows | Failure:
    """`windows` with the windows simulated that have moved too far."""
    ends, costs, drift = windows.ends.copy(), windows.costs.copy(), windows.drift.copy()
    places = np.flatnonzero(~(drift <= DRIFT))
    work = partial(window_cost, track, mapped=mapped, measure=task.measure, noise=task.noise)
    answers = each(work, [track.windows[i] for i in places], starts[places])
    for i, answer in zip(places, answers, strict=True):
        if isinstance(answer, Failure):
            return answer
        ends[i], costs[i] = answer
    drift[places] = 0.0
    return SimulatedWindows(windows.linearised, ends, costs, drift)


def _trial(
    task: FitProblem,
    x: FloatArray,
    X: Sequence[FloatArray],
    parameter_maps: dict[str, ParameterMap],
    simulated: Sequence[SimulatedWindows],
) -> Trial | Failure:
    cost = cost_of(task, parameter_maps, x, X, simulated)
    if not np.isfinite(cost):
        return NOT_FINITE
    excess = []
    for sigma, starts, windows in zip(task.sigmas, X, simulated, strict=True):
        linked = partial(link_costs, starts=starts, sigma=sigma, outlier=task.noise.outlier)
        excess.append(windows.costs - windows.linearised.cost + linked(windows.ends) - linked(windows.linearised.end))
    return Trial(x, tuple(X), tuple(simulated), tuple(excess), cost, parameter_maps)


def accept(task: FitProblem, trial: Trial, free: bool = True) -> LinearisedProblem | Failure:
    """The problem where a step led; without `free` that of the states alone, with theta held."""
    parameter_maps = (
        trial.parameter_maps if free else {stem: mapped.fixed() for stem, mapped in trial.parameter_maps.items()}
    )
    simulated = []
    for number, (track, windows, excess) in enumerate(zip(task.tracks, trial.simulated, trial.excess, strict=True)):
        linearised = windows.linearised if free else windows.linearised.states_only()
        off = np.linalg.norm((windows.ends - linearised.end) / task.sigmas[number], axis=1)
        places = np.flatnonzero((np.abs(excess) > NEAR_COST) | (off > NEAR_END))
        if places.size:
            new = linearise_windows(task, track, parameter_maps, trial.X[number], places.tolist())
            if isinstance(new, Failure):
                return new
            linearised = linearised.renewed(places, new)
        simulated.append(replace(windows, linearised=linearised))
    return assembled(task, parameter_maps, (trial.x, trial.X), simulated, trial.cost)


def with_theta_fixed(task: FitProblem, here: LinearisedProblem) -> LinearisedProblem:
    """`here` as the problem of its states alone."""
    n = len(task.actuator.states)
    theta = np.arange(n, n + here.x.size)
    chains = []
    for chain in here.chains:
        first, links = np.delete(chain.first, theta, axis=1), np.delete(chain.links, n + theta, axis=2)
        windows = replace(chain.windows, linearised=chain.windows.linearised.states_only())
        chains.append(replace(chain, first=first, links=links, windows=windows))
    return replace(here, chains=tuple(chains))


def with_theta_free(task: FitProblem, here: LinearisedProblem, there: LinearisedProblem) -> LinearisedProblem | Failure:
    """The whole problem at `there`, which is known with theta held, from the one at `here`."""
    parameter_maps = task.parameter_maps(there.x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    unit, step = units(task.actuator), there.x - here.x
    simulated = [
        replace(new.windows, linearised=old.windows.linearised.moved((after - before) / unit, step))
        for old, new, before, after in zip(here.chains, there.chains, here.X, there.X, strict=True)
    ]
    trial = _trial(task, there.x, there.X, parameter_maps, simulated)
    return trial if isinstance(trial, Failure) else accept(task, trial)
