"""Uncertainty of a fit by multiple shooting: measurement noise, consider parameters, and autocorrelated residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.inference.smoother.problem import FitProblem, condense, data_factor, linearise
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.smoother.rows import Eliminated, recover
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import Calibration, consider_parameters
from clutchid.inference.uncertainty.gaussian import gaussian_posterior, square_root
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units

#: Draws from the distribution of the states for the interval of the pressure.
DRAWS = 48


@dataclass(frozen=True, slots=True, eq=False)
class ParameterUncertainty:
    """Covariance of the free parameters x in two parts, and the chains to draw states for given parameters.

    `noise_root` is the square root of the covariance due to noise, `consider_shift` the shift of x by the consider
    parameters, and `consider_root` the square root of their covariance.
    """

    problem: FitProblem
    chains: tuple[Eliminated, ...]
    noise_root: FloatArray
    consider_shift: FloatArray
    consider_root: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """Covariance of x, shape (k, k)."""
        noise, shift = self.noise_root, self.consider_shift
        return noise @ noise.T + shift @ shift.T


def parameter_uncertainty(
    problem: FitProblem,
    solution: ShootingSolution,
    calibration: Calibration | None,
    covariance: FloatArray | None = None,
) -> ParameterUncertainty | Failure:
    """Uncertainty of the free parameters at a solution; with a known `covariance` of x, that of the states remains.

    Consider parameters (Schmidt 1966) are fixed at uncertain values; their covariance shifts the estimate through the
    joint information matrix.
    """
    k = len(problem.coordinates)
    none = np.zeros((k, 0)), np.zeros((0, 0))
    if covariance is not None:
        _, chains = condense(problem, solution.at)
        return ParameterUncertainty(problem, tuple(chains), square_root(covariance), *none)
    extra, consider_root = consider_parameters(problem.actuator, problem.coordinates, calibration)
    wide = problem.widened(extra)
    linear = linearise(wide, np.concatenate([solution.x, np.zeros(len(extra))]), solution.X)
    if isinstance(linear, Failure):
        return linear
    without_extra = [*range(k), *range(k + len(extra), linear.prior.shape[0])]
    factor, chains = condense(wide, replace(linear, prior=linear.prior[without_extra]))
    consider_shift = -np.linalg.pinv(factor[:k, :k]) @ factor[:k, k : k + len(extra)] @ consider_root
    data = data_factor(problem, solution.at) / np.sqrt(dispersion(problem, solution.at))
    noise_root = square_root(gaussian_posterior(data, solution.at.prior, 0.0).covariance)
    return ParameterUncertainty(wide, tuple(chains), noise_root, consider_shift, consider_root)


def pressure_deviations(uncertain: ParameterUncertainty) -> list[FloatArray]:
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
