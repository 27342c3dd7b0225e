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


def considering(
    problem: Problem, x: FloatArray, calibration: Calibration | None
) -> tuple[Problem, FloatArray, FloatArray]:
    """`problem` and `x` with the consider parameters, and the root of their covariance (c, c).

    Consider parameters (Schmidt 1966) are fixed at uncertain values; their covariance shifts the estimate.
    """
    extra, root = consider_parameters(problem.actuator, problem.coordinates, calibration)
    return problem.widened(extra), np.concatenate([x, np.zeros(len(extra))]), root


def consider_shift(factor: FloatArray, root: FloatArray) -> FloatArray:
    """Shift of x (k, c) by the consider parameters, through the joint information ``[R | q]`` with x before them."""
    k = factor.shape[1] - 1 - len(root)
    shift: FloatArray = -np.linalg.pinv(factor[:k, :k]) @ factor[:k, k:-1] @ root
    return shift


def parameter_uncertainty(
    problem: Problem,
    solution: ShootingSolution,
    calibration: Calibration | None,
    mixture: Mixture | None = None,
) -> Posterior | Failure:
    """Uncertainty of the free parameters at a solution; with a `mixture`, which has it, that of the states."""
    if mixture is not None:
        _, chains = condense(problem, solution.at)
        none = np.zeros((solution.x.size, 0)), np.zeros((0, 0))
        return Posterior(problem, square_root(mixture.covariance), *none, chains=tuple(chains), mixture=mixture)
    wide, x, consider_root = considering(problem, solution.x, calibration)
    linear = linearise(wide, x, solution.at.X)
    if isinstance(linear, Failure):
        return linear
    factor, chains = condense(wide, linear)
    data = data_factor(problem, solution.at) / np.sqrt(dispersion(problem, solution.at))
    noise_root = square_root(gaussian_posterior(data, solution.at.prior, 0.0).covariance)
    return Posterior(wide, noise_root, consider_shift(factor, consider_root), consider_root, chains=tuple(chains))


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
