"""`Posterior`: what data and priors determine, and the `Fit` that is made of it: estimates, load, identifiability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clutchid.estimation.method import SearchResult
from clutchid.estimation.request import SearchState, ended
from clutchid.estimation.result import Compared, Fit, errors_over, load_curve, physical_limits, plan_warnings
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import condense, data_factor, linearise
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.smoother.rows import Eliminated, recover
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration, consider_parameters
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.inference.uncertainty.estimates import Estimate, LoadCurve
from clutchid.inference.uncertainty.gaussian import gaussian_posterior, square_root
from clutchid.inference.uncertainty.identifiability import listed
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import Solution
from clutchid.simulation.windows import units

#: A parameter is not identifiable if its standard deviation exceeds this fraction of that of its prior.
_PRIOR_DOMINATES = 0.9


def fit_of(
    method: str,
    search_result: SearchResult,
    solution: Solution[Any],
    uncertain: Posterior,
    calibration: Calibration | None,
    compared: Sequence[Compared],
) -> Fit:
    """The `Fit` at the solution of a search with priors, with the uncertainty of its x."""
    problem, x, matrix = search_result.problem, solution.x, uncertain.matrix
    theta = problem.actuator.load.theta
    bias = np.zeros(len(theta))
    if calibration and calibration.position_only and search_result.posterior is None:
        bias = calibration.position_only.shift((), problem.actuator.load.names)
    fitted = corrected(problem.actuator_of(x, problem.stems[0]), bias)
    converged = solution.status == "converged"
    not_converged = [] if converged else [f"the search {ended(solution.status, solution.evaluations)}."]
    warnings = (*plan_warnings(problem.plans), *_at_bounds(problem, x), *not_converged)
    covariance = matrix * np.outer(problem.slopes(x), problem.slopes(x))
    bases = [c.base for c in problem.coordinates]
    curve = load_curve(fitted, bases, covariance, QUANTILE, DEVIATION_FACTOR * bias)
    return Fit(
        status="warning" if warnings else "ok",
        message=ended(solution.status, solution.evaluations),
        actuator=fitted,
        parameters=_estimates(problem, x, uncertain, fitted),
        covariance=covariance,
        load_curve=curve if uncertain.mixture is None else _of_mixture(curve, uncertain.mixture, problem, x),
        recordings={recording.recording.measured.name: recording.recording for recording in compared},
        errors=errors_over(recording.shown for recording in compared),
        scales=dict(problem.noise.measured),
        bounds={c.name: (c.low, c.high) for c in problem.coordinates},
        evaluations=solution.evaluations,
        warnings=warnings,
        method=method,
        notes=_identifiable(problem, matrix),
        converged=converged,
        search=search_state(problem, solution),
    )


def corrected(actuator: Actuator, bias: FloatArray) -> Actuator:
    """`actuator` with the `bias` of its load weights, in their unit, subtracted."""
    load = actuator.load
    return replace(actuator, load=replace(load, theta=tuple((np.asarray(load.theta) - bias).tolist())))


def _of_mixture(curve: LoadCurve, mixture: Mixture, problem: Problem, x: FloatArray) -> LoadCurve:
    """The load curve with the interval of a mixture about x."""
    load = problem.actuator.load
    at = [i for i, c in enumerate(problem.coordinates) if c.base in load.names]
    rows = np.zeros((curve.position.size, x.size))
    rows[:, at] = load.phi(curve.position)[:, [load.names.index(problem.coordinates[i].base) for i in at]]
    rows *= problem.slopes(x)
    low, high = mixture.interval(rows)
    return replace(curve, low=curve.force + low - rows @ x, high=curve.force + high - rows @ x)


def _estimates(problem: Problem, x: FloatArray, uncertain: Posterior, fitted: Actuator) -> dict[str, Estimate]:
    """The free parameters in SI with their 95 % intervals, from x and its uncertainty."""
    estimates, deviations = {}, np.sqrt(np.diag(uncertain.matrix))
    ends = x - QUANTILE * deviations, x + QUANTILE * deviations
    if uncertain.mixture is not None:
        ends = uncertain.mixture.interval(np.eye(x.size))
    for i, c in enumerate(problem.coordinates):
        shift = fitted.value(c.base) - c.si(float(x[i])) if c.base in fitted.load.names else 0.0
        value, low, high = (c.si(float(at)) + shift for at in (x[i], ends[0][i], ends[1][i]))
        std = float(deviations[i]) * c.slope(float(x[i]))
        estimates[c.name] = Estimate(value, problem.actuator.unit(c.base), std, low, high)
    return estimates


def _at_bounds(problem: Problem, x: FloatArray) -> list[str]:
    """Free parameters at a bound that is no physical limit, as sentences."""
    low, high = problem.bounds()
    warnings = []
    for i, c in enumerate(problem.coordinates):
        limits = physical_limits(problem.actuator, c.base)
        for bound, end, word in ((low[i], c.low, "lower"), (high[i], c.high, "upper")):
            if np.isfinite(bound) and end not in limits and abs(x[i] - bound) < 1e-9:
                shown = f"{c.si(float(x[i])):g}{problem.actuator.unit_behind(c.base)}"
                warnings.append(f"{c.name} lies at its {word} bound {shown}.")
    return warnings


def search_state(problem: Problem, solution: Solution[Any]) -> SearchState:
    """End of the search, with the priors of its free parameters."""
    priors = {c.name: Prior(c.mean, c.width * c.mean if c.positive else c.width) for c in problem.coordinates}
    return SearchState(solution.status, solution.evaluations, tuple(priors), priors)


def _identifiable(problem: Problem, matrix: FloatArray) -> tuple[str, ...]:
    """Free parameters that the data determine, and those whose prior dominates, as sentences."""
    unnamed = {*problem.actuator.load.names, *problem.changing}
    from_prior = [
        c.name
        for i, c in enumerate(problem.coordinates)
        if not unnamed & {c.base, c.name} and np.sqrt(matrix[i, i]) > _PRIOR_DOMINATES
    ]
    determined = [c.name for c in problem.coordinates if not unnamed & {c.base, c.name} and c.name not in from_prior]
    notes = []
    if determined:
        notes.append(f"determined by the data: {listed(determined)}.")
    if from_prior:
        notes.append(f"not determined by the data, so that the prior applies: {listed(from_prior)}.")
    return tuple(notes)


#: Draws from the distribution of the states for the interval of the pressure.
DRAWS = 48


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Covariance of the free parameters x (k,) as square roots.

    `noise_root` (k, m) is that of the covariance due to noise; `consider_shift` (k, c) is the shift of x by the
    consider parameters, and `consider_root` (c, c) the root of their own covariance. `factor` multiplies all standard
    deviations. `chains` give the states of windows for drawn parameters of `problem`, by multiple shooting. `mixture`
    is the posterior over hypotheses about changes, where they were weighed: its covariance is that of x.
    """

    problem: Problem
    noise_root: FloatArray
    consider_shift: FloatArray
    consider_root: FloatArray
    factor: float = 1.0
    chains: tuple[Eliminated, ...] = ()
    mixture: Mixture | None = None

    @property
    def matrix(self) -> FloatArray:
        """Covariance of x, shape (k, k)."""
        noise, shift = self.noise_root, self.consider_shift
        covariance: FloatArray = self.factor**2 * (noise @ noise.T + shift @ shift.T)
        return covariance


def parameter_uncertainty(
    problem: Problem,
    solution: ShootingSolution,
    calibration: Calibration | None,
    mixture: Mixture | None = None,
) -> Posterior | Failure:
    """Uncertainty of the free parameters at a solution; that of a `mixture` is known, and that of the states remains.

    Consider parameters (Schmidt 1966) are fixed at uncertain values; their covariance shifts the estimate through the
    joint information matrix.
    """
    k = len(problem.coordinates)
    none = np.zeros((k, 0)), np.zeros((0, 0))
    if mixture is not None:
        _, chains = condense(problem, solution.at)
        return Posterior(problem, square_root(mixture.covariance), *none, chains=tuple(chains), mixture=mixture)
    extra, consider_root = consider_parameters(problem.actuator, problem.coordinates, calibration)
    wide = problem.widened(extra)
    linear = linearise(wide, np.concatenate([solution.x, np.zeros(len(extra))]), solution.at.X)
    if isinstance(linear, Failure):
        return linear
    without_extra = [*range(k), *range(k + len(extra), linear.prior.shape[0])]
    factor, chains = condense(wide, replace(linear, prior=linear.prior[without_extra]))
    consider_shift = -np.linalg.pinv(factor[:k, :k]) @ factor[:k, k : k + len(extra)] @ consider_root
    data = data_factor(problem, solution.at) / np.sqrt(dispersion(problem, solution.at))
    noise_root = square_root(gaussian_posterior(data, solution.at.prior, 0.0).covariance)
    return Posterior(wide, noise_root, consider_shift, consider_root, chains=tuple(chains))


def pressure_deviations(uncertain: Posterior) -> list[FloatArray]:
    """Standard deviation of the pressure at the start of every window in Pa, one array per track."""
    rng = np.random.default_rng(0)
    noise_root, problem = uncertain.noise_root, uncertain.problem
    considered = rng.standard_normal((uncertain.consider_root.shape[0], DRAWS))
    theta = noise_root @ rng.standard_normal((noise_root.shape[0], DRAWS)) + uncertain.consider_shift @ considered
    at = problem.actuator.states.index("p_A")
    unit = units(problem.actuator)[at]
    result = []
    for chain in uncertain.chains:
        rows = chain.state_rows.copy()
        rows[:, :, -1] = 0.0
        noise = rng.standard_normal((*rows.shape[:2], DRAWS))
        draws = recover(
            replace(chain, state_rows=rows), np.vstack([theta, uncertain.consider_root @ considered]), noise
        )
        result.append(np.std(draws[:, at, :], axis=1) * unit)
    return result
