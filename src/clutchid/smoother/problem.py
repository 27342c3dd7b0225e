"""A fit by multiple shooting as a least-squares problem, linearised at a point and condensed to its free numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.numerics.threads import each
from clutchid.simulation.parameter_map import ColumnCache, ParameterMap, parameter_map
from clutchid.simulation.windows import Track
from clutchid.smoother.elimination import Eliminated, eliminate
from clutchid.smoother.linearised_windows import LinearisedWindows
from clutchid.smoother.links import first_rows, link_costs, link_rows, link_sigma
from clutchid.smoother.window_rows import window_rows
from clutchid.states import STATES
from clutchid.uncertainty.coordinates import Coordinate, smoothness
from clutchid.uncertainty.noise import Noise

#: Standard deviations of its prior that a number stays within. Without, a calibration has sealed chamber B and made it
#: twenty times as large: what no recording tells runs where the model is least itself.
FARTHEST = 5.0

#: So many points x are remembered with what does not depend on the states, which settle at one and the same x.
FEW = 4


@dataclass(frozen=True, eq=False)
class FitProblem:
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

    @cached_property
    def sigmas(self) -> tuple[FloatArray, ...]:
        """Standard deviations of the links of every track, see `link_sigma`."""
        return tuple(link_sigma(track, self.actuator, self.noise) for track in self.tracks)

    @cached_property
    def column_caches(self) -> dict[str, ColumnCache]:
        """What windows of each recording have asked of theta, which is the same wherever theta is."""
        return {stem: {} for stem in self.stems}

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

    def parameter_map(self, x: FloatArray, stem: str) -> ParameterMap:
        """The view of the recording `stem` on x."""
        places = self.places(stem)
        bases = [self.coordinates[i].base for i in places]
        return parameter_map(
            self.actuator_of(x, stem), bases, places, self.slopes(x)[places], x.size, self.column_caches[stem]
        )

    def parameter_maps(self, x: FloatArray) -> dict[str, ParameterMap] | Failure:
        """The view of every recording on x, by stem; a `Failure` where values contradict each other."""
        return self._views_at(x.tobytes())

    @cached_property
    def _views_at(self) -> Callable[[bytes], dict[str, ParameterMap] | Failure]:
        return lru_cache(maxsize=FEW)(self._views)

    def _views(self, x: bytes) -> dict[str, ParameterMap] | Failure:
        try:
            return {stem: self.parameter_map(np.frombuffer(x), stem) for stem in self.stems}
        except ParameterError as error:
            return Failure(str(error))

    @cached_property
    def prior_at(self) -> Callable[[bytes], FloatArray]:
        """`prior_rows` at the bytes of x."""
        return lru_cache(maxsize=FEW)(lambda x: _prior(self, np.frombuffer(x)))


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedWindows:
    """A track at a point: what its windows said where they were linearised, taken along to here, and simulated.

    `ends` (windows, n) and `costs` (windows,) are those of the simulation, from which the windows have moved by `drift`
    standard deviations of what they say.
    """

    linearised: LinearisedWindows
    ends: FloatArray
    costs: FloatArray
    drift: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A track at a point, as rows: of its first state, of its windows in `windows`, and of the links between them."""

    first: FloatArray
    windows: SimulatedWindows
    links: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedProblem:
    """The problem linearised at a point: prior rows ``[theta | r]``, chains, and its cost there (sum of losses).

    Where theta is held, its chains have no columns for it.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    prior: FloatArray
    chains: tuple[Chain, ...]
    cost: float


def linearise(task: FitProblem, x: FloatArray, X: Sequence[FloatArray]) -> LinearisedProblem | Failure:
    """The problem at parameters `x` and window starts `X`, one array a track; a failed simulation is an answer."""
    parameter_maps = task.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    simulated = []
    for track, starts in zip(task.tracks, X, strict=True):
        linearised = linearise_windows(task, track, parameter_maps, starts, range(len(track.windows)))
        if isinstance(linearised, Failure):
            return linearised
        simulated.append(SimulatedWindows(linearised, linearised.end, linearised.cost, np.zeros(len(track.windows))))
    cost = cost_of(task, parameter_maps, x, X, simulated)
    return assembled(task, parameter_maps, (x, X), simulated, cost) if np.isfinite(cost) else NOT_FINITE


def linearise_windows(
    task: FitProblem,
    track: Track,
    parameter_maps: Mapping[str, ParameterMap],
    starts: FloatArray,
    places: Sequence[int],
) -> LinearisedWindows | Failure:
    """What the windows `places` of a track say, linearised at their own `starts`."""
    work = partial(
        window_rows, track, mapped=parameter_maps[task.stems[track.log]], measure=task.measure, noise=task.noise
    )
    rows = []
    for answer in each(work, [track.windows[i] for i in places], [starts[i] for i in places]):
        if isinstance(answer, Failure):
            return answer
        rows.append(answer)
    return LinearisedWindows.by(rows)


def assembled(
    task: FitProblem,
    parameter_maps: Mapping[str, ParameterMap],
    at: tuple[FloatArray, Sequence[FloatArray]],
    simulated: Sequence[SimulatedWindows],
    cost: float,
) -> LinearisedProblem:
    """The problem at a point whose windows, and so its cost, are known."""
    x, X = at
    chains = []
    for track, sigma, starts, windows in zip(task.tracks, task.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[task.stems[track.log]]
        first, _ = first_rows(track, starts[0], mapped, "pressure_a" in task.measure, task.noise)
        links = link_rows(windows.linearised, windows.ends, starts, sigma, mapped.actuator, task.noise.outlier)
        chains.append(Chain(first, windows, links))
    return LinearisedProblem(x, tuple(X), prior_rows(task, x), tuple(chains), cost)


#: What is said of a point whose simulation has no end.
NOT_FINITE = Failure("the cost is not finite")


def cost_of(
    task: FitProblem,
    parameter_maps: Mapping[str, ParameterMap],
    x: FloatArray,
    X: Sequence[FloatArray],
    simulated: Sequence[SimulatedWindows],
) -> float:
    """The cost of a point whose windows are known."""
    total = float(np.sum(prior_rows(task, x)[:, -1] ** 2))
    for track, sigma, starts, windows in zip(task.tracks, task.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[task.stems[track.log]]
        total += first_rows(track, starts[0], mapped, "pressure_a" in task.measure, task.noise)[1]
        total += float(np.sum(windows.costs + link_costs(windows.ends, starts, sigma, task.noise.outlier)))
    return total


def prior_rows(task: FitProblem, x: FloatArray) -> FloatArray:
    """Rows ``[theta | r]`` of what is known before the data: every number, and the smoothness of the load."""
    return task.prior_at(x.tobytes())


def _prior(task: FitProblem, x: FloatArray) -> FloatArray:
    rows = np.column_stack([np.eye(x.size), x])
    if task.actuator.load.basis == "b-spline" and set(task.names) & set(task.actuator.load.names):
        value = dict(zip(task.names, task.si(x).tolist(), strict=True))
        actuator = task.actuator.replace({n: v for n, v in value.items() if n in task.actuator.load.names})
        smooth = smoothness(actuator, task.names, task.reference, task.curvature)
        smooth[:, :-1] *= task.slopes(x)
        rows = np.vstack([rows, smooth])
    rows.flags.writeable = False  # it is remembered
    return rows


def condense(
    task: FitProblem, linear: LinearisedProblem, damping: Sequence[FloatArray] | None = None
) -> tuple[FloatArray, list[Eliminated]]:
    """Triangular factor of all rows on theta, ``[R | q]``, and the chains that were eliminated into it.

    `damping` says how strongly each window's start is held, an array a track. Where theta is held there is no factor.
    """
    names = task.actuator.states
    weight = np.diag([STATES[name].step for name in names])
    chains = []
    for track, chain in enumerate(linear.chains):
        own = chain.windows.linearised.of_states
        if damping is not None:
            still = np.zeros_like(own)
            still[:, :, : len(names)] = np.sqrt(damping[track])[:, None, None] * weight
            own = np.concatenate([own, still], axis=1)
        chains.append(eliminate(chain.first, own, chain.links))
    size = linear.chains[0].first.shape[1] - len(names) - 1
    if size == 0:
        return np.zeros((0, 1)), chains
    alone = [triangular(chain.windows.linearised.of_theta) for chain in linear.chains]
    factor = triangular(np.vstack([linear.prior, *alone, *(chain.rows for chain in chains)]))
    return factor[: size + 1], chains
