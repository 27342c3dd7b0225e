"""`FitProblem`: the least-squares problem of a fit, for other tools to evaluate, minimise and sample."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from clutchid.errors import ParameterError, SolveError
from clutchid.estimation.calibrate import prepared
from clutchid.estimation.fit import FIT_METHODS, ready
from clutchid.estimation.method import ResidualRows
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.result import Fit
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import made_anew
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.simulation.inputs import with_inputs
from clutchid.simulation.run import POSITION_START, PRESSURE_START

#: Quadratic forms below this are a distance of zero.
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class FitProblem:
    r"""Least-squares problem of a fit in x (k,), the free parameters in the units of its search.

    x is 0 at the mean of a prior and 1 a standard deviation above it (of the logarithm, for a positive parameter);
    by 'simulation', which has no priors, x is a value in units of its natural size. `values` has it in SI.

    Attributes
    ----------
    method
        'simulation', 'shooting' or 'prediction-error'.
    logs
        The recordings.
    actuator, free, calibration
        What the search started from.
    scales : m, Pa
        Standard deviations of the measured columns; they stay as they are.
    x : (k,)
        The end of the search, or its start if nothing was fitted.
    states : one array a segment, (windows, n_states)
        States at the window starts there, by 'shooting'.
    is_fitted
        Whether x is the end of a search.

    Notes
    -----
    Residuals are in standard deviations, those of the priors first. By 'simulation' and 'prediction-error' (with the
    gains of the filter at `x`) they are those of the samples; by 'shooting' the states are eliminated, and with them
    the samples: ``k + 1`` residuals of the data are left, in another basis at each x. ``J' r`` and ``J' J`` are right.

    The density is that behind the intervals of the fit. As residuals are correlated and the model is not exact, it is
    not ``exp(-cost)``: the logarithm is scaled along each direction d = x − x̂ so that its curvature at the estimate is
    the inverse of the stated covariance P (Chandler and Bate 2007, vertical adjustment).

    .. math:: \log p(x) = -\frac{d^T P^{-1} d}{d^T J^T J d}\,(\mathrm{cost}(x) - \mathrm{cost}(\hat x))

    Where nothing was fitted it is ``-cost``, that of independent residuals.

    References
    ----------
    Chandler and Bate 2007, Biometrika 94, 167.

    Examples
    --------
    SciPy ends where the fit ended:

    >>> import clutchid
    >>> from scipy.optimize import least_squares
    >>> problem = clutchid.fit(clutchid.bundled_recording().slice(0, 10_000)).problem
    >>> end = least_squares(problem.residuals, problem.x + 0.1, problem.jacobian, bounds=problem.bounds)
    >>> bool(abs(end.x - problem.x).max() < 1e-3)
    True
    """

    method: str
    logs: tuple[Log, ...]
    actuator: Actuator
    free: FreeParameters
    calibration: Calibration | None
    scales: Mapping[str, float]
    x: FloatArray
    states: tuple[FloatArray, ...] = ()
    is_fitted: bool = False

    __reduce__ = made_anew

    def __repr__(self) -> str:
        names = ", ".join(log.name for log in self.logs)
        return f"FitProblem({self.method!r} of {names}: {self.x.size} free parameters {', '.join(self.names)})"

    @cached_property
    def _problem(self) -> Problem:
        return _problem(self.method, self.logs, self.actuator, self.free, self.calibration, self.scales)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, NAME or NAME@STEM; by 'simulation' also unknown starts of segments."""
        return self._problem.names

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the free parameters."""
        starts = {POSITION_START: "m", PRESSURE_START: "Pa"}
        return tuple(starts.get(c.base) or self.actuator.unit(c.base) for c in self._problem.coordinates)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, (k,) each."""
        return self._problem.bounds()

    def values(self, x: ArrayLike) -> dict[str, float]:
        """Values in SI by name."""
        return dict(zip(self.names, self._problem.si(self._checked(x)).tolist(), strict=True))

    def slopes(self, x: ArrayLike) -> FloatArray:
        """Derivatives (k,) of the values in SI with respect to x."""
        return self._problem.slopes(self._checked(x))

    def actuator_of(self, x: ArrayLike, recording: str | None = None) -> Actuator:
        """The actuator at x; `recording` names the one of a parameter of its own, the first by default.

        Raises
        ------
        ParameterError
            If values contradict each other.
        """
        return self._problem.actuator_of(self._checked(x), recording or self._problem.stems[0])

    def residuals(self, x: ArrayLike) -> FloatArray:
        """Residuals (m,) in standard deviations; infinite where nothing can be simulated, so that a step shortens."""
        if isinstance(self._rows_at(self._checked(x).tobytes()), Failure):
            return np.full(len(self._stacked(self.x)), np.inf)
        return self._stacked(x)[:, -1]

    def jacobian(self, x: ArrayLike) -> FloatArray:
        """Derivatives (m, k) of the residuals with respect to x.

        Raises
        ------
        SolveError
            If a recording cannot be simulated at x.
        """
        return self._stacked(x)[:, :-1]

    def raw_jacobian(self, x: ArrayLike) -> FloatArray:
        """Derivatives (m, k) of the samples in SI with respect to the values in SI, without those of priors.

        Raises
        ------
        ParameterError
            By 'shooting', whose residuals are no samples.
        SolveError
            If a recording cannot be simulated at x.
        """
        rows = self._rows(x)
        if rows.scales is None:
            raise ParameterError(
                "raw_jacobian: by 'shooting' the samples are eliminated with the states; use jacobian(x), or "
                "clutchid.simulate(problem.actuator_of(x), log, sensitivities=names)."
            )
        return np.asarray(rows.data[:, :-1] * rows.scales[:, None] / self.slopes(x))

    def cost(self, x: ArrayLike) -> float:
        """Half the sum of squared residuals, outliers counting linearly; infinite where nothing can be simulated."""
        rows = self._rows_at(self._checked(x).tobytes())
        return np.inf if isinstance(rows, Failure) else rows.cost

    @cached_property
    def covariance(self) -> FloatArray | None:
        """Covariance (k, k) of x behind the intervals of the fit; None if nothing was fitted.

        It is infinite where the data say nothing. The interval of a calibrated load has errors of the model besides.
        """
        if not self.is_fitted:
            return None
        result = FIT_METHODS[self.method].result(
            self._problem, Solution(self.x, self._near, "converged", 0), self.calibration, None
        )
        return None if isinstance(result, Failure) else result.covariance

    def log_density(self, x: ArrayLike) -> float:
        """Logarithm of the density at x, up to a constant; -infinity beyond bounds and where nothing is simulated."""
        return self._density(self._checked(x))[0]

    def log_density_gradient(self, x: ArrayLike) -> FloatArray:
        """Gradient (k,) of `log_density`; NaN where that is -infinity."""
        return self._density(self._checked(x))[1]

    def _density(self, x: FloatArray) -> tuple[float, FloatArray]:
        low, high = self.bounds
        inside = bool(np.all((x >= low) & (x <= high)))
        rows = self._rows_at(x.tobytes()) if inside else Failure("beyond a bound")
        if isinstance(rows, Failure):
            return -np.inf, np.full(x.size, np.nan)
        value, gradient = -rows.cost, -_gradient(rows)
        if self._curvatures is None:
            return value, gradient
        P, H = self._curvatures
        drop, d = value + self.cost(self.x), x - self.x
        of_P, of_H = float(d @ P @ d), float(d @ H @ d)
        if of_H < _NOTHING:
            return 0.0, np.zeros(x.size)
        return of_P / of_H * drop, of_P / of_H * gradient + 2.0 * drop / of_H * (P @ d - of_P / of_H * (H @ d))

    @cached_property
    def _curvatures(self) -> tuple[FloatArray, FloatArray] | None:
        """Inverse of the covariance, 0 where that is infinite, and ``J' J`` at `x`; None if not fitted."""
        if self.covariance is None:
            return None
        J, finite = self.jacobian(self.x), np.flatnonzero(np.isfinite(np.diag(self.covariance)))
        P = np.zeros_like(self.covariance)
        P[np.ix_(finite, finite)] = np.linalg.pinv(self.covariance[np.ix_(finite, finite)], hermitian=True)
        return P, J.T @ J

    def _stacked(self, x: ArrayLike) -> FloatArray:
        rows = self._rows(x)
        return np.vstack([rows.prior, rows.data])

    def _rows(self, x: ArrayLike) -> ResidualRows:
        rows = self._rows_at(self._checked(x).tobytes())
        if isinstance(rows, Failure):
            raise SolveError(rows.message)
        return rows

    @cached_property
    def _near(self) -> object:
        """The problem evaluated at `x`, from which all other points are."""
        near = FIT_METHODS[self.method].evaluated(self._problem, self.x, self.states)
        if isinstance(near, Failure):
            raise SolveError(near.message)
        return near

    @cached_property
    def _rows_at(self) -> Callable[[bytes], ResidualRows | Failure]:
        own = weakref.proxy(self)
        return lru_cache(maxsize=2)(lambda x: FIT_METHODS[own.method].rows(own._problem, np.frombuffer(x), own._near))

    def _checked(self, x: ArrayLike) -> FloatArray:
        values = np.ascontiguousarray(x, dtype=np.float64)
        if values.shape != self.x.shape:
            raise ParameterError(
                f"x has the shape {values.shape}; it must be {self.x.shape}: {', '.join(self.names)}, in the units of "
                "the search, see problem.values(x)."
            )
        return values


def _gradient(rows: ResidualRows) -> FloatArray:
    """Gradient (k,) of the cost."""
    return np.asarray(rows.prior[:, :-1].T @ rows.prior[:, -1] + rows.data[:, :-1].T @ rows.data[:, -1])


def _problem(
    method: str,
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None,
    scales: Mapping[str, float],
) -> Problem:
    problem = FIT_METHODS[method].problem(logs, actuator, free, calibration, None)
    return replace(problem, noise=replace(problem.noise, measured={**problem.noise.measured, **scales}))


def problem_of_request(logs: Sequence[Log], actuator: Actuator | None, request: FitRequest) -> FitProblem:
    """The problem of a request that is not fitted, at its start.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    recordings = ready(logs, actuator, request)
    request, name = recordings.request, recordings.method.name
    inputs = tuple(with_inputs(log) for log in recordings.logs)
    start, free, request = prepared(inputs, recordings.start, request)
    problem = recordings.method.problem(inputs, start, free, request.calibration, None)
    begin = recordings.method.start(problem, free)
    if isinstance(begin, Failure):
        raise SolveError(begin.message)
    scales = problem.noise.measured
    return _with_problem(FitProblem(name, inputs, start, free, request.calibration, scales, *begin), problem)


def problem_of_fit(fit: Fit) -> FitProblem:
    """The problem of a fit at its end, made anew from its recordings.

    Raises
    ------
    ParameterError
        If the fit failed, or is a load from position alone, which weighs hypotheses about changes.
    """
    if fit.request is None or fit.start is None:
        raise ParameterError("this fit failed before its search, so it has no problem; fit.message says why.")
    logs = tuple(with_inputs(recording.measured) for recording in fit.recordings.values())
    start, free, request = prepared(logs, fit.start, fit.request)
    if request.calibration is not None and free.reads_load(start):
        raise ParameterError(
            "a load from position alone weighs hypotheses about changes since its calibration, each with a problem of "
            "its own; clutchid.problem(logs, calibration) has that without a change."
        )
    problem = _problem(fit.method, logs, start, free, request.calibration, fit.scales)
    x, states = _end(fit, problem), _window_starts(fit, problem)
    at_end = FitProblem(fit.method, logs, start, free, request.calibration, fit.scales, x, states, is_fitted=True)
    return _with_problem(at_end, problem)


def _with_problem(public: FitProblem, problem: Problem) -> FitProblem:
    """`public` with the problem that its x was made from, so that the recordings are not prepared again."""
    vars(public)["_problem"] = problem
    return public


def _end(fit: Fit, problem: Problem) -> FloatArray:
    """x (k,) of a fit."""
    x = np.empty(len(problem.coordinates))
    for i, c in enumerate(problem.coordinates):
        if c.name in fit.parameters:
            x[i] = c.of(fit.parameters[c.name].value)
        else:  # the unknown start of a segment
            recording, _, segment = str(c.stem).rpartition(", segment ")
            x[i] = c.of(fit.recordings[recording].starts[int(segment)][c.base == PRESSURE_START])
    return x


def _window_starts(fit: Fit, problem: Problem) -> tuple[FloatArray, ...]:
    """States at the window starts of a fit by 'shooting', along its simulated recordings."""
    if fit.method != "shooting":
        return ()
    columns, states = [row.column for row in problem.actuator.state_rows.values()], []
    for track in problem.tracks:
        simulated = fit.recordings[problem.stems[track.log]].simulated
        time = track.measured.time[[window.start for window in track.windows]]
        states.append(np.column_stack([np.interp(time, simulated.time, simulated[name]) for name in columns]))
    return tuple(states)
