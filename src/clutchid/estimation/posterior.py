"""`Posterior`: uncertainty of the free parameters and states by data and priors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import condense, data_factor, linearise
from clutchid.inference.smoother.residuals import dispersion
from clutchid.inference.smoother.rows import Eliminated, recover
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import Calibration, consider_parameters
from clutchid.inference.uncertainty.gaussian import gaussian_posterior, square_root
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units

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
