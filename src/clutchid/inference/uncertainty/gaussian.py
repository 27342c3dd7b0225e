"""Linear least squares as Bayesian inference: posterior and evidence of Gaussian rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray
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
    """A root L of a covariance, L L', also of one that is singular to rounding."""
    values, vectors = np.linalg.eigh(covariance)
    result: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))
    return result
