"""`Problem`: free parameters and recordings of a fit, and the rows of its prior."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.smoother.rows import link_sigma
from clutchid.inference.uncertainty.change_prior import Hypothesis, change_covariance
from clutchid.inference.uncertainty.coordinates import CURVATURE, Coordinate, Prior, measured_rows, smoothness
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.numerics.failure import Failure
from clutchid.simulation.noise import Noise
from clutchid.simulation.parameter_map import ColumnCache, ParameterMap, parameter_map
from clutchid.simulation.plan import Plan
from clutchid.simulation.windows import Track

#: Cache size for state-independent terms.
_CACHE_SIZE = 4

#: Columns of the duty cycles above which a parameter says that a valve is fully open.
_OPENS_FULLY = {"R_1vs": "duty_supply", "R_1ve": "duty_exhaust"}


@dataclass(frozen=True, eq=False)
class Problem:
    """Free parameters x (k,) as `coordinates`, recordings, and compared columns of a fit, of any method.

    `stems` are the names of the recordings, `plans` how they are simulated, and `tracks` their segments in windows,
    which 'simulation' does without. `curvature` is the prior standard deviation, in N/m², of the load's second
    derivative from that of the weights `reference`. `prior_root` W, shape (k, k), is that of a joint prior of x, of
    covariance ``inv(W' W)``, with fewer rows where the last parameters have no prior; without it they are independent
    with standard deviation 1. `changing` are the names of parameters that may have changed since a calibration, which
    the joint prior is of. `measured` are measurements of free parameters, in addition to their prior.
    """

    actuator: Actuator
    coordinates: tuple[Coordinate, ...]
    stems: tuple[str, ...]
    measure: tuple[str, ...]
    noise: Noise
    plans: tuple[Plan, ...] = ()
    tracks: tuple[Track, ...] = ()
    curvature: float = CURVATURE
    reference: tuple[float, ...] = field(default=())
    prior_root: FloatArray | None = None
    changing: tuple[str, ...] = ()
    measured: Mapping[str, Prior] = field(default_factory=dict)

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
        """Bounds of x: those of the parameters, within the `limit` of each coordinate."""
        high = np.array([c.limit for c in self.coordinates])
        low = -high
        for i, c in enumerate(self.coordinates):
            if np.isfinite(c.low) and (c.low > 0.0 or not c.positive):
                low[i] = max(low[i], c.of(c.low))
            if np.isfinite(c.high):
                high[i] = min(high[i], c.of(c.high))
        return low, high

    @cached_property
    def kinks(self) -> FloatArray:
        """Values of x (k,) where the slope of the cost changes at once; NaN for a parameter without one.

        That is the duty cycle from which a valve is fully open at the highest duty cycle of the recordings: beyond it
        the valve never opens fully.
        """
        kinks = np.full(len(self.coordinates), np.nan)
        for i, c in enumerate(self.coordinates):
            if c.base in _OPENS_FULLY:
                logs = [track.measured for track in self.tracks if c.stem in (None, self.stems[track.log])]
                kinks[i] = c.of(max(float(np.nanmax(log[_OPENS_FULLY[c.base]])) for log in logs))
        return kinks

    def widened(self, extra: Sequence[Coordinate]) -> Problem:
        """The problem with `extra` coordinates behind its own, without their prior."""
        root = np.eye(len(self.coordinates)) if self.prior_root is None else self.prior_root
        root = np.hstack([root, np.zeros((len(root), len(extra)))])
        return replace(self, coordinates=(*self.coordinates, *extra), prior_root=root)

    def places(self, stem: str) -> list[int]:
        """Indices in x of the parameters of the recording `stem`; one of its own replaces the shared one."""
        single = {c.base for c in self.coordinates if c.stem == stem}
        return [
            i for i, c in enumerate(self.coordinates) if c.stem == stem or (c.stem is None and c.base not in single)
        ]

    def actuator_of(self, x: FloatArray, stem: str) -> Actuator:
        """Actuator of the recording `stem` at x; ParameterError if values contradict each other."""
        return self._actuator_at(x.tobytes(), stem)

    @cached_property
    def _actuator_at(self) -> Callable[[bytes, str], Actuator]:
        own = weakref.proxy(self)
        return lru_cache(maxsize=_CACHE_SIZE)(lambda x, stem: _actuator(own, np.frombuffer(x), stem))

    def load_of(self, x: FloatArray) -> Load:
        """Load of the first recording at x, which may be where no actuator is admissible."""
        value = self.si(x)
        weight = {self.coordinates[i].base: float(value[i]) for i in self.places(self.stems[0])}
        load = self.actuator.load
        return replace(load, theta=tuple(weight.get(n, w) for n, w in zip(load.names, load.theta, strict=True)))

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
        return lru_cache(maxsize=_CACHE_SIZE)(self._parameter_maps)

    def _parameter_maps(self, x: bytes) -> dict[str, ParameterMap] | Failure:
        try:
            return {stem: self.parameter_map(np.frombuffer(x), stem) for stem in self.stems}
        except ParameterError as error:
            return Failure(str(error))

    @cached_property
    def prior_at(self) -> Callable[[bytes], FloatArray]:
        """Cached `prior_rows`, by the bytes of x; it does not keep the problem, and so its recordings, alive."""
        own = weakref.proxy(self)
        return lru_cache(maxsize=_CACHE_SIZE)(lambda x: _prior(own, np.frombuffer(x)))


def _actuator(problem: Problem, x: FloatArray, stem: str) -> Actuator:
    value = problem.si(x)
    return problem.actuator.replace({problem.coordinates[i].base: float(value[i]) for i in problem.places(stem)})


def prior_rows(problem: Problem, x: FloatArray) -> FloatArray:
    """Prior rows ``[theta | r]``: of every parameter, of their measurements, and of the smoothness of the load."""
    return problem.prior_at(x.tobytes())


def _prior(problem: Problem, x: FloatArray) -> FloatArray:
    root = np.eye(x.size) if problem.prior_root is None else problem.prior_root
    rows = np.vstack([np.column_stack([root, root @ x]), measured_rows(problem.coordinates, problem.measured, x)])
    if problem.actuator.load.basis == "b-spline" and set(problem.names) & set(problem.actuator.load.names):
        actuator = replace(problem.actuator, load=problem.load_of(x))
        smooth = smoothness(actuator, problem.names, problem.reference, problem.curvature)
        smooth[:, :-1] *= problem.slopes(x)
        rows = np.vstack([rows, smooth])
    rows.flags.writeable = False  # the array is cached
    return rows


def with_hypothesis(problem: Problem, hypothesis: Hypothesis) -> Problem:
    """`problem` with the prior of a hypothesis about what has changed since the calibration in every recording."""
    if not problem.changing:
        return problem
    root = np.eye(len(problem.coordinates))
    for stem in problem.stems:
        at = [i for i, c in enumerate(problem.coordinates) if c.stem == stem and c.name in problem.changing]
        own = [problem.coordinates[i] for i in at]
        sizes = np.array([c.slope(0.0) for c in own])
        covariance = change_covariance(problem.actuator, [c.base for c in own], hypothesis)
        root[np.ix_(at, at)] = np.linalg.inv(np.linalg.cholesky(covariance / np.outer(sizes, sizes)))
    return replace(problem, prior_root=root)
