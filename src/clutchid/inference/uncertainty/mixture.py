"""`Mixture`: the posterior over hypotheses about changes, its moments, and quantiles of what is linear in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchid.inference.uncertainty.change_prior import Hypothesis
from clutchid.log import FloatArray

#: Bisections of a quantile, whose error then is a millionth of a standard deviation.
_BISECTIONS = 24

#: Standard deviations beyond all means between which a quantile is searched.
_BEYOND = 8.0


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Posterior of parameters x (k,): a normal distribution under each of h hypotheses, and their probabilities.

    The mean is that by the probabilities. Covariance and intervals are about it with `weights` that are less sure of
    the best hypothesis: what explains a recording nearly as well may be off by several standard deviations.

    Parameters
    ----------
    hypotheses : h sets of groups
        That have changed.
    probabilities, weights : (h,)
        Of the hypotheses, for the mean and for the spread about it, each with a sum of 1.
    means : (h, k)
        Means of x.
    covariances : (h, k, k)
        Covariances of x.
    """

    hypotheses: tuple[Hypothesis, ...]
    probabilities: FloatArray
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    @property
    def x(self) -> FloatArray:
        """Mean of x, shape (k,)."""
        return self.probabilities @ self.means

    @property
    def covariance(self) -> FloatArray:
        """Covariance of x about its mean, shape (k, k): inside the hypotheses, and between them."""
        apart = self.means - self.x
        inside = np.einsum("h,hij->ij", self.weights, self.covariances)
        covariance: FloatArray = inside + np.einsum("h,hi,hj->ij", self.weights, apart, apart)
        return covariance

    def of_group(self, group: str) -> float:
        """Probability that a group has changed."""
        return float(sum(p for h, p in zip(self.hypotheses, self.probabilities.tolist(), strict=True) if group in h))

    def moved(self, step: FloatArray) -> Mixture:
        """The mixture with `step` (k,) added to x."""
        return replace(self, means=self.means + step)

    def slope(self, places: Sequence[int], change: FloatArray) -> FloatArray:
        """Change of x, shape (k,), if x[places] were known to change by `change` (places,)."""
        at = [*places]
        slopes = [P[:, at] @ np.linalg.solve(P[np.ix_(at, at)], change) for P in self.covariances]
        slope: FloatArray = self.probabilities @ np.array(slopes)
        return slope

    def interval(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Ends of the 95 % interval of each of ``rows @ x``, of shape (n, k): the 2.5 and 97.5 % quantiles.

        A mixture is lopsided where its hypotheses differ, so that its standard deviation is too much on one side and
        too little on the other. The mean lies inside.
        """
        means, mean = rows @ self.means.T, rows @ self.x
        std = np.sqrt(np.maximum(np.einsum("ni,hij,nj->nh", rows, self.covariances, rows), np.finfo(float).tiny))
        low, high = (self._quantile(means, std, level) for level in (0.025, 0.975))
        return np.minimum(low, mean), np.maximum(high, mean)

    def _quantile(self, mean: FloatArray, std: FloatArray, level: float) -> FloatArray:
        """Quantiles of the n mixtures of normal distributions with means and standard deviations of shape (n, h)."""
        from scipy.special import ndtr

        low, high = np.min(mean - _BEYOND * std, axis=1), np.max(mean + _BEYOND * std, axis=1)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            below = ndtr((middle[:, None] - mean) / std) @ self.weights < level
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        quantile: FloatArray = 0.5 * (low + high)
        return quantile
