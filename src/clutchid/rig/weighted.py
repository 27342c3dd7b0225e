"""Generalised least squares for a few means, and a test whether they are equal, with estimated variances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.log import FloatArray

#: Relative accuracy that no rig exceeds.
_NEGLIGIBLE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """One term of the covariance of the means, shape (k, k), and its degrees of freedom."""

    matrix: FloatArray
    degrees_of_freedom: float


@dataclass(frozen=True, slots=True)
class StudentEstimate:
    """An estimate with few degrees of freedom.

    Attributes
    ----------
    value : SI
        The estimate.
    std : SI
        Standard error.
    low, high : SI
        95 % interval.
    degrees_of_freedom : 1
        Of Student's distribution behind the interval.
    """

    value: float
    std: float
    low: float
    high: float
    degrees_of_freedom: float


@dataclass(frozen=True, slots=True)
class Equality:
    """Test of equal means.

    Attributes
    ----------
    statistic : 1
        F.
    degrees_of_freedom : 1
        Of numerator and denominator.
    p_value : 1
        Probability of such an F if the means are equal.
    """

    statistic: float
    degrees_of_freedom: tuple[float, float]
    p_value: float


def student(value: float, std: float, degrees_of_freedom: float) -> StudentEstimate:
    """95 % interval from Student's t distribution; infinite without degrees of freedom."""
    from scipy.special import stdtrit

    if not (degrees_of_freedom > 0.0 and np.isfinite(std)):
        return StudentEstimate(value, float("inf"), -float("inf"), float("inf"), 0.0)
    half = float(stdtrit(degrees_of_freedom, 0.975)) * std
    return StudentEstimate(value, std, value - half, value + half, degrees_of_freedom)


def satterthwaite(variances: Sequence[float], degrees_of_freedom: Sequence[float]) -> float:
    """Degrees of freedom of a sum of estimated variances (Welch and Satterthwaite)."""
    spread = sum(v**2 / n for v, n in zip(variances, degrees_of_freedom, strict=True))
    return sum(variances) ** 2 / spread if spread > 0.0 else float("inf")


def gls(X: FloatArray, means: FloatArray, parts: Sequence[Component]) -> list[StudentEstimate]:
    r"""Generalised least squares of `means` on the columns of X, with an interval for each coefficient.

    Parameters
    ----------
    X : (k, m)
        Regressors.
    means : (k,)
        In any unit.
    parts : Sequence[Component]
        Terms of their covariance.

    Returns
    -------
    coefficients : list of StudentEstimate

    Notes
    -----
    If the means scatter about the fit more than their variances imply, standard errors and degrees of freedom are those
    of the scatter, because the deviation of the levels from the line is not contained in the cycles.
    """
    weight = np.linalg.inv(_total(parts, means))
    P = np.linalg.inv(X.T @ weight @ X)
    influence = P @ X.T @ weight
    beta = influence @ means
    r, freedom = means - X @ beta, X.shape[0] - X.shape[1]
    scatter = float(r @ weight @ r) / freedom if freedom > 0 else 0.0
    estimates = []
    for i, row in enumerate(influence):
        variances = [float(row @ part.matrix @ row) for part in parts]
        within = satterthwaite(variances, [part.degrees_of_freedom for part in parts])
        estimates.append(
            student(float(beta[i]), float(np.sqrt(P[i, i] * max(1.0, scatter))), freedom if scatter > 1.0 else within)
        )
    return estimates


def equality(means: FloatArray, parts: Sequence[Component]) -> Equality:
    r"""Test whether means with estimated covariances are equal.

    .. math:: F = (R m)^T (R C R^T)^{-1} R m / c, \quad c = q + 2 A - 6 A / (q + 2)

    Parameters
    ----------
    means : (k,)
        At least two.
    parts : Sequence[Component]
        Terms of their covariance C: each the variance of one mean, or an error common to all.

    Returns
    -------
    equality : Equality

    Notes
    -----
    R contains differences of neighbours, q = k - 1, and A accounts for the uncertainty of the estimated variances. With
    one independent variance per mean this is Welch's analysis of variance.

    References
    ----------
    Johansen, Biometrika 67 (1980) 85-92; Welch, Biometrika 38 (1951) 330-336.

    Examples
    --------
    Two means, 3 standard errors of their difference apart, of ten cycles each:

    >>> one = [Component(np.diag([0.02, 0.0]), 9), Component(np.diag([0.0, 0.02]), 9)]
    >>> test = equality(np.array([4.0, 4.6]), one)
    >>> f"F = {test.statistic:.1f} with {test.degrees_of_freedom[1]:.0f} degrees of freedom: p = {test.p_value:.3f}"
    'F = 9.0 with 18 degrees of freedom: p = 0.008'
    """
    from scipy.special import fdtrc

    q = means.size - 1
    R = np.diff(np.eye(means.size), axis=0)
    inner = R.T @ np.linalg.inv(R @ _total(parts, means) @ R.T) @ R
    A = 0.0
    for part in parts:
        share = part.matrix @ inner
        A += 0.5 * float(np.trace(share @ share) + np.trace(share) ** 2) / part.degrees_of_freedom
    statistic = float(means @ inner @ means) / (q + 2 * A - 6 * A / (q + 2))
    last = q * (q + 2) / (3 * A) if A > 0.0 else 1e9
    return Equality(statistic, (float(q), last), float(fdtrc(q, last, max(statistic, 0.0))))


def _total(parts: Sequence[Component], means: FloatArray) -> FloatArray:
    """The covariance, regularised by a millionth of the largest mean and of the largest standard deviation.

    It can then be inverted if the means have no scatter, or a common error that is much larger than their own.
    """
    total: FloatArray = np.sum([part.matrix for part in parts], axis=0)
    floor = _NEGLIGIBLE**2 * (float(np.max(means**2)) + float(np.diag(total).max()) + 1e-200)
    return total + floor * np.eye(means.size)


def independent(values: FloatArray) -> bool:
    r"""Test whether consecutive values are independent; False if they drift, at 5 % significance.

    .. math:: \sum (x_{i+1} - x_i)^2 / \sum (x_i - \bar x)^2

    Parameters
    ----------
    values : (n,)
        Any unit. Fewer than four always count as independent.

    Returns
    -------
    independent : bool

    Notes
    -----
    Von Neumann's ratio against positive correlation. For normal values it has mean 2 and variance
    4 (n - 2) / (n² - 1); a quarter of it is taken as a beta variable with these moments.

    References
    ----------
    von Neumann, Annals of Mathematical Statistics 12 (1941) 367-395.

    Examples
    --------
    >>> independent(np.array([5.1, 5.2, 5.3, 5.4, 5.45, 5.5])), independent(np.array([5.1, 5.4, 5.2, 5.5, 5.3, 5.2]))
    (False, True)
    """
    from scipy.special import betainc

    n, spread = values.size, float(np.sum((values - values.mean()) ** 2))
    if n < 4 or not spread > 0.0:
        return True
    ratio = float(np.sum(np.diff(values) ** 2)) / spread
    shape = ((n**2 - 1) / (n - 2) - 1) / 2
    return bool(betainc(shape, shape, min(1.0, ratio / 4)) >= 0.05)
