"""Multiple shooting as a least-squares problem: linearised at a point and condensed to its free parameters."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.smoother.rows import (
    Eliminated,
    LinearisedWindows,
    eliminate,
    first_rows,
    link_costs,
    link_rows,
    link_sigma,
    window_rows,
)
from clutchid.inference.uncertainty.coordinates import Coordinate, Prior, measured_rows, smoothness
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.numerics.threads import map_pairs
from clutchid.simulation.noise import Noise
from clutchid.simulation.parameter_map import ColumnCache, ParameterMap, parameter_map
from clutchid.simulation.windows import Track

#: Bound of every free parameter in standard deviations of its prior. Without it, parameters that the data do not
#: determine drift to absurd values: a calibration once sealed chamber B and made it twenty times too large.
PRIOR_LIMIT = 5.0

#: Cache size for state-independent terms.
CACHE_SIZE = 4


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Free parameters and recordings of a fit.

    `stems` are the names of the recordings. `curvature` is the prior standard deviation, in N/m², of the load's second
    derivative from that of the weights `reference`. `prior_root` W, shape (k, k), is that of a joint prior of the
    coordinates x, of covariance ``inv(W' W)``; without it they are independent with standard deviation 1. `changing`
    are the names of parameters that may have changed since a calibration, which the joint prior is of. `known` are
    measurements of free parameters, in addition to their prior.
    """

    actuator: Actuator
    coordinates: tuple[Coordinate, ...]
    tracks: tuple[Track, ...]
    stems: tuple[str, ...]
    measure: tuple[str, ...]
    noise: Noise
    curvature: float
    reference: tuple[float, ...] = field(default=())
    prior_root: FloatArray | None = None
    changing: tuple[str, ...] = ()
    known: Mapping[str, Prior] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, NAME or NAME@STEM."""
        return tuple(c.name for c in self.coordinates)

    @cached_property
    def sigmas(self) -> tuple[FloatArray, ...]:
        """Standard deviations of the links of every track, see `link_sigma`."""
        return tuple(link_sigma(track, self.actuator, self.noise) for track in self.tracks)

    @cached_property
    def column_caches(self) -> dict[str, ColumnCache]:
        """Cached `ActiveColumns` of each recording; they do not depend on x."""
        return {stem: {} for stem in self.stems}

    def si(self, x: FloatArray) -> FloatArray:
        """Values in SI."""
        return np.array([c.si(value) for c, value in zip(self.coordinates, x.tolist(), strict=True)])

    def slopes(self, x: FloatArray) -> FloatArray:
        """Derivatives of the values in SI with respect to x."""
        return np.array([c.slope(value) for c, value in zip(self.coordinates, x.tolist(), strict=True)])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of x: those of the parameters, and at most `PRIOR_LIMIT` prior standard deviations from the mean."""
        low, high = np.full((2, len(self.coordinates)), PRIOR_LIMIT)
        low = -low
        for i, c in enumerate(self.coordinates):
            if np.isfinite(c.low) and (c.low > 0.0 or not c.positive):
                low[i] = max(low[i], c.of(c.low))
            if np.isfinite(c.high):
                high[i] = min(high[i], c.of(c.high))
        return low, high

    def widened(self, extra: Sequence[Coordinate]) -> FitProblem:
        """The problem with `extra` coordinates behind its own, which are independent of those."""
        root = self.prior_root
        if root is not None:
            k, m = len(self.coordinates), len(extra)
            root = np.block([[root, np.zeros((k, m))], [np.zeros((m, k)), np.eye(m)]])
        return replace(self, coordinates=(*self.coordinates, *extra), prior_root=root)

    def places(self, stem: str) -> list[int]:
        """Indices in x of the parameters of the recording `stem`; one of its own replaces the shared one."""
        single = {c.base for c in self.coordinates if c.stem == stem}
        return [
            i for i, c in enumerate(self.coordinates) if c.stem == stem or (c.stem is None and c.base not in single)
        ]

    def actuator_of(self, x: FloatArray, stem: str) -> Actuator:
        """Actuator of the recording `stem` at x; ParameterError if values contradict each other."""
        value = self.si(x)
        return self.actuator.replace({self.coordinates[i].base: float(value[i]) for i in self.places(stem)})

    def parameter_map(self, x: FloatArray, stem: str) -> ParameterMap:
        """Parameter map of the recording `stem` at x."""
        places = self.places(stem)
        bases = [self.coordinates[i].base for i in places]
        return parameter_map(
            self.actuator_of(x, stem), bases, places, self.slopes(x)[places], x.size, self.column_caches[stem]
        )

    def parameter_maps(self, x: FloatArray) -> dict[str, ParameterMap] | Failure:
        """Parameter maps of all recordings at x by stem; a `Failure` if values contradict each other."""
        return self._parameter_maps_at(x.tobytes())

    @cached_property
    def _parameter_maps_at(self) -> Callable[[bytes], dict[str, ParameterMap] | Failure]:
        return lru_cache(maxsize=CACHE_SIZE)(self._parameter_maps)

    def _parameter_maps(self, x: bytes) -> dict[str, ParameterMap] | Failure:
        try:
            return {stem: self.parameter_map(np.frombuffer(x), stem) for stem in self.stems}
        except ParameterError as error:
            return Failure(str(error))

    @cached_property
    def prior_at(self) -> Callable[[bytes], FloatArray]:
        """Cached `prior_rows`, by the bytes of x; it does not keep the problem, and so its recordings, alive."""
        own = weakref.proxy(self)
        return lru_cache(maxsize=CACHE_SIZE)(lambda x: _prior(own, np.frombuffer(x)))


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedWindows:
    """The windows of a track at a point: extrapolated linearisation, and final states and costs.

    `ends` (windows, n) and `costs` (windows,) come from the last simulation, with the linear change since then.
    `distance` (windows,) is the length of that change in standard deviations of residuals and final state.
    """

    linearised: LinearisedWindows
    ends: FloatArray
    costs: FloatArray
    distance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Rows of a track at a point: prior of the first state, windows, and links between them."""

    first: FloatArray
    windows: SimulatedWindows
    links: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedProblem:
    """The problem linearised at a point: prior rows ``[theta | r]``, chains, and the cost (sum of losses).

    With fixed theta the chains have no columns for it.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    prior: FloatArray
    chains: tuple[Chain, ...]
    cost: float


def linearise(problem: FitProblem, x: FloatArray, X: Sequence[FloatArray]) -> LinearisedProblem | Failure:
    """Linearise at parameters `x` and window starts `X`, one array per track; a `Failure` if a simulation fails."""
    parameter_maps = problem.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    simulated = []
    for track, starts in zip(problem.tracks, X, strict=True):
        linearised = linearise_windows(problem, track, parameter_maps, starts, range(len(track.windows)))
        if isinstance(linearised, Failure):
            return linearised
        simulated.append(SimulatedWindows(linearised, linearised.end, linearised.cost, np.zeros(len(track.windows))))
    cost = total_cost(problem, parameter_maps, x, X, simulated)
    return assemble(problem, parameter_maps, (x, X), simulated, cost) if np.isfinite(cost) else NOT_FINITE


def linearise_windows(
    problem: FitProblem,
    track: Track,
    parameter_maps: Mapping[str, ParameterMap],
    starts: FloatArray,
    places: Sequence[int],
) -> LinearisedWindows | Failure:
    """Linearise the windows `places` of a track at `starts`."""
    mapped = parameter_maps[problem.stems[track.log]]
    work = partial(window_rows, track, mapped=mapped, measure=problem.measure, noise=problem.noise)
    rows = []
    for window in map_pairs(work, [track.windows[i] for i in places], [starts[i] for i in places]):
        if isinstance(window, Failure):
            return window
        rows.append(window)
    return LinearisedWindows.stack(rows)


def assemble(
    problem: FitProblem,
    parameter_maps: Mapping[str, ParameterMap],
    at: tuple[FloatArray, Sequence[FloatArray]],
    simulated: Sequence[SimulatedWindows],
    cost: float,
) -> LinearisedProblem:
    """The linearised problem at a point with simulated windows and known cost."""
    x, X = at
    chains = []
    for track, sigma, starts, windows in zip(problem.tracks, problem.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[problem.stems[track.log]]
        first, _ = first_rows(track, starts[0], mapped, "pressure_a" in problem.measure, problem.noise)
        links = link_rows(windows.linearised, windows.ends, starts, sigma, mapped.actuator, problem.noise.outlier)
        chains.append(Chain(first, windows, links))
    return LinearisedProblem(x, tuple(X), prior_rows(problem, x), tuple(chains), cost)


#: Answer for a point whose cost is not finite.
NOT_FINITE = Failure("the cost is not finite")


def total_cost(
    problem: FitProblem,
    parameter_maps: Mapping[str, ParameterMap],
    x: FloatArray,
    X: Sequence[FloatArray],
    simulated: Sequence[SimulatedWindows],
) -> float:
    """Cost of a point with simulated windows."""
    total = float(np.sum(prior_rows(problem, x)[:, -1] ** 2))
    for track, sigma, starts, windows in zip(problem.tracks, problem.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[problem.stems[track.log]]
        total += first_rows(track, starts[0], mapped, "pressure_a" in problem.measure, problem.noise)[1]
        total += float(np.sum(windows.costs + link_costs(windows.ends, starts, sigma, problem.noise.outlier)))
    return total


def prior_rows(problem: FitProblem, x: FloatArray) -> FloatArray:
    """Prior rows ``[theta | r]``: of every parameter, of their measurements, and of the smoothness of the load."""
    return problem.prior_at(x.tobytes())


def _prior(problem: FitProblem, x: FloatArray) -> FloatArray:
    root = np.eye(x.size) if problem.prior_root is None else problem.prior_root
    rows = np.vstack([np.column_stack([root, root @ x]), measured_rows(problem.coordinates, problem.known, x)])
    if problem.actuator.load.basis == "b-spline" and set(problem.names) & set(problem.actuator.load.names):
        value = dict(zip(problem.names, problem.si(x).tolist(), strict=True))
        actuator = problem.actuator.replace({n: v for n, v in value.items() if n in problem.actuator.load.names})
        smooth = smoothness(actuator, problem.names, problem.reference, problem.curvature)
        smooth[:, :-1] *= problem.slopes(x)
        rows = np.vstack([rows, smooth])
    rows.flags.writeable = False  # the array is cached
    return rows


def data_factor(problem: FitProblem, linear: LinearisedProblem) -> FloatArray:
    """Triangular factor ``[R | q]`` of the rows of the data alone, in theta after elimination of the states."""
    without = replace(linear, prior=linear.prior[:0])
    return condense(problem, without)[0]


def condense(
    problem: FitProblem, linear: LinearisedProblem, damping: Sequence[FloatArray] | None = None
) -> tuple[FloatArray, list[Eliminated]]:
    """Triangular factor ``[R | q]`` in theta after elimination of the states, and the eliminated chains.

    `damping` of the window starts: one array per track. With fixed theta the factor is empty.
    """
    names = problem.actuator.states
    weight = np.diag([row.step for row in problem.actuator.state_rows.values()])
    chains = []
    for track, chain in enumerate(linear.chains):
        windows = chain.windows.linearised.state_rows
        if damping is not None:
            damped = np.zeros_like(windows)
            damped[:, :, : len(names)] = np.sqrt(damping[track])[:, None, None] * weight
            windows = np.concatenate([windows, damped], axis=1)
        chains.append(eliminate(chain.first, windows, chain.links))
    size = linear.chains[0].first.shape[1] - len(names) - 1
    if size == 0:
        return np.zeros((0, 1)), chains
    theta_rows = [triangular(chain.windows.linearised.theta_rows) for chain in linear.chains]
    factor = triangular(np.vstack([linear.prior, *theta_rows, *(chain.rows for chain in chains)]))
    return factor[: size + 1], chains
