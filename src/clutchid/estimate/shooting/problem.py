"""A fit by multiple shooting as a least-squares problem, linearised at a point and condensed to its free numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimate.least_squares import Failure, triangular
from clutchid.estimate.shooting.coordinates import Coordinate, smoothness
from clutchid.estimate.shooting.elimination import Eliminated, eliminate
from clutchid.estimate.shooting.links import first_rows, link_cost, link_rows, link_sigma
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.rows import Rows, View, view, window_cost, window_rows
from clutchid.estimate.shooting.threads import each
from clutchid.estimate.shooting.windows import Track
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS

#: Standard deviations of its prior that a number stays within. Without, a calibration has sealed chamber B and made it
#: twenty times as large: what no recording tells runs where the model is least itself.
FARTHEST = 5.0

#: How strongly a damped step holds each state, in standard deviations of a window's own information.
HELD = {
    "y": 60.0, "v": 15.0, "p_A": 30.0, "p_B": 30.0, "z": 30.0, "T_A": 3.0, "T_B": 3.0, "p_S": 3.0, "p_G": 3.0,
    "z_h": 30.0,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Shooting:
    """Free numbers and recordings of a fit.

    `curvature` is the standard deviation of the load's second derivative from that of the weights `reference`, N/m².
    """

    actuator: Actuator
    coordinates: tuple[Coordinate, ...]
    tracks: tuple[Track, ...]
    stems: tuple[str, ...]
    measure: tuple[str, ...]
    noise: Noise
    curvature: float
    reference: tuple[float, ...] = field(default=())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free numbers, NAME or NAME@STEM."""
        return tuple(c.name for c in self.coordinates)

    def si(self, x: FloatArray) -> FloatArray:
        """Values in SI."""
        return np.array([c.si(value) for c, value in zip(self.coordinates, x.tolist(), strict=True)])

    def slopes(self, x: FloatArray) -> FloatArray:
        """Derivatives of the values in SI to x."""
        return np.array([c.slope(value) for c, value in zip(self.coordinates, x.tolist(), strict=True)])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of x: those of the numbers, and not further from what is known of them than `FARTHEST`."""
        low, high = np.full((2, len(self.coordinates)), FARTHEST)
        low = -low
        for i, c in enumerate(self.coordinates):
            if np.isfinite(c.low) and (c.low > 0.0 or not c.positive):
                low[i] = max(low[i], c.of(c.low))
            if np.isfinite(c.high):
                high[i] = min(high[i], c.of(c.high))
        return low, high

    def places(self, stem: str) -> list[int]:
        """Places in x that belong to the recording `stem`; an own number stands in for the shared one."""
        own = {c.base for c in self.coordinates if c.stem == stem}
        return [i for i, c in enumerate(self.coordinates) if c.stem == stem or (c.stem is None and c.base not in own)]

    def actuator_of(self, x: FloatArray, stem: str) -> Actuator:
        """The actuator of the recording `stem` at x; ParameterError where values contradict each other."""
        value = self.si(x)
        return self.actuator.replace({self.coordinates[i].base: float(value[i]) for i in self.places(stem)})

    def view(self, x: FloatArray, stem: str, free: bool = True) -> View:
        """The view of the recording `stem` on x; without `free` on nothing, with x in the actuator only."""
        if not free:
            return view(self.actuator_of(x, stem), (), (), np.zeros(0), 0)
        places = self.places(stem)
        bases = [self.coordinates[i].base for i in places]
        return view(self.actuator_of(x, stem), bases, places, self.slopes(x)[places], x.size)

    def views(self, x: FloatArray, free: bool = True) -> dict[str, View] | Failure:
        """The view of every recording on x, by stem; a `Failure` where values contradict each other."""
        try:
            return {stem: self.view(x, stem, free) for stem in self.stems}
        except ParameterError as error:
            return Failure(str(error))


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """The rows of one track: of its first state, its windows, and the links between them.

    `told` is what the windows say of theta alone, condensed; their rows on states and theta stand in `windows`.
    """

    first: FloatArray
    windows: tuple[Rows, ...]
    links: tuple[FloatArray, ...]
    told: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """The problem linearised at a point: prior rows ``[theta | r]``, chains, and its cost there (sum of losses).

    Where theta is held, its rows have no columns for it.
    """

    prior: FloatArray
    chains: tuple[Chain, ...]
    cost: float


def linearise(
    task: Shooting, noise: Noise, x: FloatArray, X: Sequence[FloatArray], free: bool = True
) -> Linear | Failure:
    """The problem at parameters `x` and window starts `X`, one array a track; a failed simulation is an answer.

    Without `free` the parameters are held: derivatives to the states only, which cost a fraction.

    Raises
    ------
    Nothing: a simulation that fails is a `Failure`.
    """
    views = task.views(x, free)
    if isinstance(views, Failure):
        return views
    prior = prior_rows(task, x)
    cost = float(np.sum(prior[:, -1] ** 2))
    prior = prior if free else np.zeros((0, 1))
    chains = []
    for track, starts in zip(task.tracks, X, strict=True):
        chain = _chain(task, noise, track, starts, views[task.stems[track.log]])
        if isinstance(chain, Failure):
            return chain
        chains.append(chain[0])
        cost += chain[1]
    return Linear(prior, tuple(chains), cost) if np.isfinite(cost) else Failure("the cost is not finite")


def cost_at(task: Shooting, noise: Noise, x: FloatArray, X: Sequence[FloatArray]) -> float:
    """The cost at a point, infinite where it cannot be simulated; as `linearise`, without derivatives.

    Raises
    ------
    Nothing: a simulation that fails costs infinitely much.
    """
    views = task.views(x)
    if isinstance(views, Failure):
        return float("inf")
    total = float(np.sum(prior_rows(task, x)[:, -1] ** 2))
    for track, starts in zip(task.tracks, X, strict=True):
        seen = views[task.stems[track.log]]
        work = partial(window_cost, track, seen=seen, measure=task.measure, noise=noise)
        ends, sigma = [], link_sigma(track, task.actuator, noise)
        total += first_rows(track, starts[0], seen, "pressure_a" in task.measure, noise)[1]
        for answer in each(work, track.windows, starts):
            if isinstance(answer, Failure):
                return float("inf")
            ends.append(answer[0])
            total += answer[1]
        total += sum(
            link_cost(end, start, width, noise.outlier)
            for end, start, width in zip(ends[:-1], starts[1:], sigma[:-1], strict=True)
        )
    return total if np.isfinite(total) else float("inf")


def _chain(task: Shooting, noise: Noise, track: Track, starts: FloatArray, seen: View) -> tuple[Chain, float] | Failure:
    """The rows of a track, and their cost."""
    first, cost = first_rows(track, starts[0], seen, "pressure_a" in task.measure, noise)
    work = partial(window_rows, track, seen=seen, measure=task.measure, noise=noise)
    windows: list[Rows] = []
    for rows in each(work, track.windows, starts):
        if isinstance(rows, Failure):
            return rows
        windows.append(rows)
        cost += rows.cost
    links, sigma = [], link_sigma(track, task.actuator, noise)
    for before, start, width in zip(windows[:-1], starts[1:], sigma[:-1], strict=True):
        link, more = link_rows(before, start, width, seen.actuator, noise.outlier)
        links.append(link)
        cost += more
    n = starts.shape[1]
    told = triangular(np.vstack([rows.own[n:, n:] for rows in windows]))
    return Chain(first, tuple(windows), tuple(links), told), cost


def prior_rows(task: Shooting, x: FloatArray) -> FloatArray:
    """Rows ``[theta | r]`` of what is known before the data: every number, and the smoothness of the load.

    Raises
    ------
    Nothing: numbers are checked where they enter.
    """
    rows = np.column_stack([np.eye(x.size), x])
    if task.actuator.load.basis != "b-spline" or not set(task.names) & set(task.actuator.load.names):
        return rows
    value = dict(zip(task.names, task.si(x).tolist(), strict=True))
    actuator = task.actuator.replace({n: v for n, v in value.items() if n in task.actuator.load.names})
    smooth = smoothness(actuator, task.names, task.reference, task.curvature)
    smooth[:, :-1] *= task.slopes(x)
    return np.vstack([rows, smooth])


def condense(task: Shooting, linear: Linear, damping: float = 0.0) -> tuple[FloatArray, list[Eliminated]]:
    """Triangular factor of all rows on theta, ``[R | q]``, and the chains that were eliminated into it.

    Raises
    ------
    Nothing: numbers are checked where they enter.
    """
    names = VARIANTS[task.actuator.model]
    n, size = len(names), linear.prior.shape[1] - 1
    held = np.zeros((n, n + size + 1))
    held[:, :n] = np.sqrt(damping) * np.diag([HELD[name] for name in names])
    chains = []
    for chain in linear.chains:
        own = [np.vstack([rows.own[:n], held]) if damping else rows.own[:n] for rows in chain.windows]
        left = eliminate(chain.first, own, chain.links, n)
        chains.append(replace(left, rows=np.vstack([chain.told, left.rows])))
    factor = triangular(np.vstack([linear.prior, *(chain.rows for chain in chains)]))
    return factor[: size + 1], chains
