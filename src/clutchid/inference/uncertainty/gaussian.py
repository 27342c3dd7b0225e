"""Gaussian posteriors: evidence, information in square-root form, covariance of correlated residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import triangular


class GaussianPosterior(NamedTuple):
    """Posterior of parameters: `step` (k,) to the mean, `covariance` (k, k), and the logarithm of the evidence.

    The evidence lacks what depends neither on the prior nor on the parameters.
    """

    step: FloatArray
    covariance: FloatArray
    log_evidence: float


def gaussian_posterior(data: FloatArray, prior: FloatArray, log_root: float, scatter: float = 1.0) -> GaussianPosterior:
    r"""Posterior of parameters from rows ``[J | r]`` of data and prior.

    .. math:: \log Z = -\tfrac12 \min_s |J s + r|^2 - \log |\det R| + \log |\det W|

    Parameters
    ----------
    data, prior : (m, k + 1)
        Rows with the residual last; R is the triangular factor of both.
    log_root : 1
        Logarithm of the determinant of the root W of the prior's information.
    scatter : 1
        Variance of the scores of the data over their information, 1 if the residuals are as assumed. It changes only
        the covariance, to that of the estimate (sandwich; White 1982).
    """
    k = data.shape[1] - 1
    factor = triangular(np.vstack([data, prior]))
    R, q = factor[:k, :k], factor[:k, k]
    rest = float(factor[k, k]) if factor.shape[0] > k else 0.0
    inverse = np.linalg.inv(R)
    log_evidence = -0.5 * rest**2 - float(np.sum(np.log(np.abs(np.diag(R))))) + log_root
    covariance = inverse @ inverse.T
    if scatter != 1.0:
        gains = np.vstack([np.sqrt(scatter) * data[:, :k], prior[:, :k]]) @ covariance
        covariance = gains.T @ gains
    return GaussianPosterior(-inverse @ q, covariance, log_evidence)


def square_root(covariance: FloatArray) -> FloatArray:
    """The lower triangular root L of a covariance L L', also where that is singular to rounding.

    Draws made with it are the same on every machine: eigenvectors have any sign, and any direction among equals.
    """
    values, vectors = np.linalg.eigh(covariance)
    upper = triangular((vectors * np.sqrt(np.maximum(values, 0.0))).T)
    return upper.T * np.where(np.diag(upper) < 0.0, -1.0, 1.0)


#: Natural size of a load weight by its unit.
_WEIGHT_SIZES = {"N/m": 1e5, "N": 1e3}


def natural_sizes(actuator: Actuator, names: Sequence[str]) -> FloatArray:
    """Sizes in SI that make parameters of order one: those of load weights, and the values of all others."""
    weight = _WEIGHT_SIZES[actuator.load.unit]
    return np.array([weight if n in actuator.load.names else abs(actuator.value(n)) or 1.0 for n in names])


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    r"""Information matrix :math:`R^T R` of the parameters `names`, as its square root.

    Parameters
    ----------
    names : names
        Of the columns of R.
    R : (m, k)
        Each row is the derivative of a residual of standard deviation 1 with respect to the parameters in their natural
        sizes. A column of zeros: there is no information about that parameter.
    """

    names: tuple[str, ...]
    R: FloatArray

    @classmethod
    def of_covariance(cls, names: Sequence[str], covariance: FloatArray, sizes: FloatArray) -> Information:
        """The inverse of a covariance in SI, shape (k, k); there is no information where a variance is infinite.

        Directions whose variance is below rounding get the information of rounding.
        """
        finite = np.flatnonzero((np.diag(covariance) > 0.0) & (np.diag(covariance) < np.inf))
        R = np.zeros((len(names), len(names)))
        if finite.size:
            at = np.ix_(finite, finite)
            std, values, vectors = spectrum(covariance[at])
            floor = np.finfo(float).eps * finite.size * values[-1]
            R[at] = (vectors / np.sqrt(np.maximum(values, floor))).T / std * sizes[finite]
        return cls(tuple(names), R)

    @property
    def determined(self) -> tuple[str, ...]:
        """Parameters about which there is any information."""
        return tuple(name for name, column in zip(self.names, self.R.T, strict=True) if np.any(column != 0.0))

    def columns(self, names: Sequence[str]) -> FloatArray:
        """Columns of R."""
        return self.R[:, [self.names.index(name) for name in names]]


def spectrum(covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard errors, and eigenvalues (ascending) and eigenvectors of the correlation matrix."""
    std = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    return std, values, vectors


#: Scores are summed in blocks, so that at most this many enter the lag sums.
_MAX_BLOCKS = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Covariance:
    """Covariance matrix of the estimate, shape (k, k), and its degrees of freedom.

    A parameter that the data do not determine has infinite variance and zero covariances.
    """

    matrix: FloatArray
    degrees_of_freedom: float

    def quantile(self) -> float:
        """Half width of a 95 % interval in standard deviations (Student's t)."""
        from scipy.special import stdtrit

        return float(stdtrit(max(1.0, self.degrees_of_freedom), 0.975))


def sandwich(
    R: FloatArray,
    scores: Sequence[FloatArray],
    determined: NDArray[np.bool_] | None = None,
    shared: int | None = None,
    constants: FloatArray | None = None,
) -> Covariance:
    r"""Covariance of a least-squares estimate with autocorrelated residuals.

    .. math:: P = H^{-1} \Big( C C^T + \sum_{|l| \le b} (1 - |l| / (b + 1)) \sum_t s_t s_{t+l}^T \Big) H^{-1},
        \quad H = R^T R

    Parameters
    ----------
    R : (k, k)
        Triangular factor of the Jacobian of the scaled residuals.
    scores : (n_i, k) per segment
        ``J_t r_t``, sample by sample; segments are taken as independent.
    determined : (k,), optional
        Parameters that the data say something about; by default those with a Jacobian column above rounding.
    shared : int, optional
        The first `shared` parameters belong to all segments, the others to one each: only the first cost degrees of
        freedom of the whole, and only their scores choose the bandwidth. By default all.
    constants : (k, c), optional
        C: the gradient of the cost by a change of one standard deviation of each constant that is known with an error
        only, such as a measured start; the errors are independent.

    Notes
    -----
    Bartlett weights (Newey and West 1987), bandwidth b by Andrews (1991) with a first-order autoregression for each
    parameter's score. Simulation errors stay correlated for seconds: the usual formula for white residuals would give
    intervals many times too narrow. C is that of a consider covariance (Tapley, Schutz and Born 2004, section 6.2).
    """
    k = R.shape[0]
    common = k if shared is None or shared == 0 else shared
    norms = np.sqrt(np.sum(R**2, axis=0))
    identifiable = norms > 1e-9 * max(float(norms.max(initial=0.0)), 1e-300)
    determined = identifiable if determined is None else identifiable & determined
    matrix = np.full((k, k), 0.0)
    matrix[~determined, ~determined] = np.inf
    total = sum(s.shape[0] for s in scores)
    if not determined.any() or total <= k:
        np.fill_diagonal(matrix, np.inf)
        return Covariance(matrix, 1.0)
    inverse = _pseudo_inverse(R[:, determined] / norms[determined])
    size = max(1, -(-total // _MAX_BLOCKS))
    blocks = [_block_sums(s[:, determined] / norms[determined], size) for s in scores]
    influence = np.concatenate(blocks) @ inverse
    leading = influence[:, : max(1, int(determined[:common].sum()))]
    bandwidth = _bandwidth(leading)
    middle = sum((_lag_sum(block, bandwidth) for block in blocks), np.zeros((determined.sum(), determined.sum())))
    count = sum(block.shape[0] for block in blocks)
    root = (inverse / norms[determined]).T @ square_root(0.5 * (middle + middle.T))
    inner = root @ root.T * count / max(1.0, count - common)
    if constants is not None:
        shift = (inverse / norms[determined]).T @ (constants[determined] / norms[determined, None])
        inner += shift @ shift.T
    matrix[np.ix_(determined, determined)] = inner
    return Covariance(matrix, max(1.0, 1.5 * count / (bandwidth + 1) - common))


def _pseudo_inverse(R: FloatArray) -> FloatArray:
    """Inverse of R^T R by singular values, with a floor that keeps the variance of unidentifiable directions finite."""
    _, s, Vt = np.linalg.svd(R)
    s = np.maximum(s, 1e-12 * s[0])
    result: FloatArray = (Vt.T / s**2) @ Vt
    return result


def _block_sums(scores: FloatArray, size: int) -> FloatArray:
    if size == 1:
        return scores
    starts = np.arange(0, scores.shape[0], size)
    return np.add.reduceat(scores, starts, axis=0)


def _bandwidth(scores: FloatArray) -> int:
    """Andrews' bandwidth for Bartlett weights, from a first-order autoregression of every column."""
    n = scores.shape[0]
    before, after = scores[:-1], scores[1:]
    power = np.maximum(np.sum(before**2, axis=0), 1e-300)
    rho = np.clip(np.sum(before * after, axis=0) / power, -0.97, 0.97)
    sigma2 = np.mean((after - rho * before) ** 2, axis=0)
    weight = 1 / np.maximum(np.mean(scores**2, axis=0), 1e-300) ** 2
    top = np.sum(weight * 4 * rho**2 * sigma2**2 / ((1 - rho) ** 6 * (1 + rho) ** 2))
    bottom = np.sum(weight * sigma2**2 / (1 - rho) ** 4)
    alpha = top / max(bottom, 1e-300)
    return int(min(n // 4, 1.1447 * (alpha * n) ** (1 / 3)))


def _lag_sum(scores: FloatArray, bandwidth: int) -> FloatArray:
    """Lagged products with Bartlett weights: those of the sums over a moving window of ``bandwidth + 1`` samples."""
    length = bandwidth + 1
    total = np.cumsum(np.pad(scores, ((length, bandwidth), (0, 0))), axis=0)
    windows = total[length:] - total[:-length]
    return windows.T @ windows / length
