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
from clutchid.simulation.parameter_map import View
from clutchid.simulation.windows import Track, units
from clutchid.smoother.links import link_costs
from clutchid.smoother.problem import NOT_FINITE, Linear, Passage, Shooting, assembled, cost_of, told_by
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
    `views` are those of the recordings on x.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    passages: tuple[Passage, ...]
    excess: tuple[FloatArray, ...]
    cost: float
    views: dict[str, View]


#: What is said of a step after which the problem does not cost less.
NO_GAIN = Failure("the step gains nothing")


def attempt(
    task: Shooting, here: Linear, x: FloatArray, X: Sequence[FloatArray], last: Trial | None = None
) -> Trial | Failure:
    """What the step from `here` to `x` and `X` costs; windows that are where the `last` trial had them are not new."""
    views = task.views(x)
    if isinstance(views, Failure):
        return views
    before = last.passages if last else tuple(chain.passage for chain in here.chains)
    passages = []
    for number, (track, old) in enumerate(zip(task.tracks, before, strict=True)):
        moved = _passed(task, here, (x, X[number]), number, old)
        passage = _simulated(task, track, views[task.stems[track.log]], X[number], moved)
        if isinstance(passage, Failure):
            return passage
        passages.append(passage)
    return _trial(task, x, X, views, passages)


def _passed(task: Shooting, here: Linear, at: tuple[FloatArray, FloatArray], number: int, old: Passage) -> Passage:
    """A track where x and its starts are `at`, as its rows say; `old` is how it was simulated last."""
    x, starts = at
    base = here.chains[number].passage.told
    step = (x - here.x)[: base.to_theta.shape[2]]
    told = base.moved((starts - here.X[number]) / units(task.actuator), step)
    ends_off = (told.end - old.told.end) / task.sigmas[number]
    shift = np.hypot(np.linalg.norm(told.r - old.told.r, axis=1), np.linalg.norm(ends_off, axis=1))
    ends, costs = old.ends + told.end - old.told.end, old.costs + told.cost - old.told.cost
    return Passage(told, ends, costs, old.drift + shift)


def _simulated(task: Shooting, track: Track, seen: View, starts: FloatArray, passage: Passage) -> Passage | Failure:
    """`passage` with the windows simulated that have moved too far."""
    ends, costs, drift = passage.ends.copy(), passage.costs.copy(), passage.drift.copy()
    places = np.flatnonzero(~(drift <= DRIFT))
    work = partial(window_cost, track, seen=seen, measure=task.measure, noise=task.noise)
    answers = each(work, [track.windows[i] for i in places], starts[places])
    for i, answer in zip(places, answers, strict=True):
        if isinstance(answer, Failure):
            return answer
        ends[i], costs[i] = answer
    drift[places] = 0.0
    return Passage(passage.told, ends, costs, drift)


def _trial(
    task: Shooting, x: FloatArray, X: Sequence[FloatArray], views: dict[str, View], passages: Sequence[Passage]
) -> Trial | Failure:
    cost = cost_of(task, views, x, X, passages)
    if not np.isfinite(cost):
        return NOT_FINITE
    excess = []
    for sigma, starts, passage in zip(task.sigmas, X, passages, strict=True):
        linked = partial(link_costs, starts=starts, sigma=sigma, outlier=task.noise.outlier)
        excess.append(passage.costs - passage.told.cost + linked(passage.ends) - linked(passage.told.end))
    return Trial(x, tuple(X), tuple(passages), tuple(excess), cost, views)


def accept(task: Shooting, trial: Trial, free: bool = True) -> Linear | Failure:
    """The problem where a step led; without `free` that of the states alone, with theta held."""
    views = trial.views if free else {stem: seen.held() for stem, seen in trial.views.items()}
    passages = []
    for number, (track, passage, excess) in enumerate(zip(task.tracks, trial.passages, trial.excess, strict=True)):
        told = passage.told if free else passage.told.held()
        off = np.linalg.norm((passage.ends - told.end) / task.sigmas[number], axis=1)
        places = np.flatnonzero((np.abs(excess) > NEAR_COST) | (off > NEAR_END))
        if places.size:
            new = told_by(task, track, views, trial.X[number], places.tolist())
            if isinstance(new, Failure):
                return new
            told = told.renewed(places, new)
        passages.append(replace(passage, told=told))
    return assembled(task, views, (trial.x, trial.X), passages, trial.cost)


def with_theta_held(task: Shooting, here: Linear) -> Linear:
    """`here` as the problem of its states alone."""
    n = len(task.actuator.states)
    theta = np.arange(n, n + here.x.size)
    chains = []
    for chain in here.chains:
        first, links = np.delete(chain.first, theta, axis=1), np.delete(chain.links, n + theta, axis=2)
        passage = replace(chain.passage, told=chain.passage.told.held())
        chains.append(replace(chain, first=first, links=links, passage=passage))
    return replace(here, chains=tuple(chains))


def with_theta_free(task: Shooting, here: Linear, there: Linear) -> Linear | Failure:
    """The whole problem at `there`, which is known with theta held, from the one at `here`."""
    views = task.views(there.x)
    if isinstance(views, Failure):
        return views
    unit, step = units(task.actuator), there.x - here.x
    passages = [
        replace(new.passage, told=old.passage.told.moved((after - before) / unit, step))
        for old, new, before, after in zip(here.chains, there.chains, here.X, there.X, strict=True)
    ]
    trial = _trial(task, there.x, there.X, views, passages)
    return trial if isinstance(trial, Failure) else accept(task, trial)
