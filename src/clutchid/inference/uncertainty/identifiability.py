"""Parameters that a recording does not determine, from the Jacobian of its residuals; sentences for the user."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator

#: Two estimates with a correlation above this, in magnitude, cannot be estimated separately.
CORRELATION = 0.98

#: A singular value of the Jacobian with unit columns below this is a direction that is not identifiable.
_SINGULAR = 1e-3

#: A parameter is not identifiable if a change by its natural scale changes the norm of the residuals by less than this
#: many noise scales: even alone, its standard error would exceed that scale.
_LEAST_NORM = 1.0


#: A condition index above this is a near dependency, shared by parameters with more than the share of their variance
#: in it (Belsley, Kuh and Welsch 1980, section 3.2).
_CONDITION, _VARIANCE_SHARE = 30.0, 0.5


class RankedParameter(NamedTuple):
    """A parameter in the order in which the data determine it.

    Attributes
    ----------
    name
        NAME or NAME@STEM.
    alone, ranked : SI
        Standard deviation by the data alone, without its prior, for independent residuals of the stated size: with all
        others known, and with those before it estimated too. Infinite where the data say nothing.
    collinearity : 1
        Index of it and of those before it: by what factor a change of one can be made up for by the others; 1 for
        none, and above 10 to 15 they are hardly identifiable together.
    """

    name: str
    alone: float
    ranked: float
    collinearity: float


class NearDependency(NamedTuple):
    """A combination of parameters that the data hardly determine.

    Attributes
    ----------
    condition : 1
        Condition index: the greatest singular value of the scaled Jacobian over that of the combination.
    names
        Parameters that share it.
    """

    condition: float
    names: tuple[str, ...]


class Identifiability(NamedTuple):
    """Which parameters the data determine, and which only together.

    Attributes
    ----------
    ranking
        The best determined parameter first, then the one that the data determine best beside those before it.
    dependencies
        Near dependencies, the worst first.
    """

    ranking: tuple[RankedParameter, ...]
    dependencies: tuple[NearDependency, ...]


def identifiability(R: FloatArray, names: Sequence[str], slopes: FloatArray) -> Identifiability:
    """Ranking, collinearity and near dependencies of parameters from the data alone.

    Parameters
    ----------
    R : (m, k)
        Jacobian of the residuals of the data, in standard deviations, or its triangular factor.
    names : names
        Of the columns.
    slopes : (k,), SI
        Derivatives of the values with respect to the parameters of R.

    References
    ----------
    Ranking by pivoted QR: Burth, Verghese and Velez-Reyes 1999. Collinearity index: Brun, Reichert and Kunsch 2001.
    Condition indices and shares of variance: Belsley, Kuh and Welsch 1980.
    """
    from scipy.linalg import qr  # on use: a command that only reads files starts faster

    norms = np.sqrt(np.sum(R**2, axis=0))
    informed = np.flatnonzero(norms > 0.0)
    unit = R[:, informed] / norms[informed]
    # columns are compared by what a change of a prior's width, or of the natural size, does to the residuals
    left, order = qr(R[:, informed], mode="r", pivoting=True)
    sizes = [np.linalg.svd(unit[:, order[: k + 1]], compute_uv=False) for k in range(order.size)]
    ranking = [
        RankedParameter(names[i], float(slopes[i] / norms[i]), _over(slopes[i], left[k, k]), _over(1.0, sizes[k][-1]))
        for k, i in enumerate(informed[order].tolist())
    ]
    ranking += [RankedParameter(names[i], np.inf, np.inf, 1.0) for i in np.flatnonzero(norms == 0.0).tolist()]
    _, s, Vt = np.linalg.svd(unit, full_matrices=False)
    conditions = s[0] / np.maximum(s, 1e-12 * s[0]) if s.size else s
    shares = (Vt * conditions[:, None]) ** 2
    shares /= np.maximum(shares.sum(axis=0), 1e-300)
    dependencies = [
        NearDependency(
            float(conditions[j]), tuple(names[informed[i]] for i in np.flatnonzero(shares[j] > _VARIANCE_SHARE))
        )
        for j in reversed(range(s.size))
        if conditions[j] > _CONDITION
    ]
    return Identifiability(tuple(ranking), tuple(group for group in dependencies if len(group.names) > 1))


def _over(size: float, by: float) -> float:
    return float(size / abs(by)) if by else np.inf


def identifiability_warnings(
    R: FloatArray, names: Sequence[str], actuator: Actuator, reach: float, with_pressure: bool
) -> list[str]:
    """Warnings about parameters that are not identifiable, or that cannot be estimated separately.

    Parameters
    ----------
    R : (k, k)
        Triangular factor of the Jacobian with respect to dimensionless parameters, the first of which are `names`.
    reach : m
        Furthest position in the recording.
    with_pressure : bool
        Whether the measured pressure is used already.
    """
    determined = identifiable(R)
    warnings = _not_identifiable([name for i, name in enumerate(names) if not determined[i]], actuator, reach)
    others = np.flatnonzero(determined).tolist()
    if len(others) > 1:
        correlation = correlations(R[:, others])
        pairs = [
            (names[others[i]], names[others[j]], correlation[i, j])
            for i in range(len(others))
            for j in range(i)
            if others[i] < len(names) and others[j] < len(names) and abs(correlation[i, j]) > CORRELATION
        ]
        warnings += _correlated(pairs, actuator, reach, with_pressure)
        warnings += _combinations(R[:, others], [names[i] if i < len(names) else "" for i in others])
    return warnings


def _combinations(R: FloatArray, names: Sequence[str]) -> list[str]:
    """Warning about three or more parameters of which only combinations are identifiable."""
    group = [names[i] for i in collinear(R) if names[i]]
    if len(group) < 3:
        return []
    return [
        f"only combinations of {in_words(group)} are identifiable from this recording: they can change together "
        "without changing the simulation; fix some of them, because their individual values and intervals are "
        "meaningless."
    ]


def collinear(R: FloatArray) -> list[int]:
    """Parameters that are identifiable in combination only, from the factor R of the Jacobian without zero columns."""
    _, s, Vt = np.linalg.svd(R / np.sqrt(np.sum(R**2, axis=0)))
    members = {int(i) for row in np.flatnonzero(s < _SINGULAR) for i in np.flatnonzero(np.abs(Vt[row]) > 0.1)}
    return sorted(members)


def identifiable(R: FloatArray) -> NDArray[np.bool_]:
    """Mask of the identifiable dimensionless parameters, shape (k,), from the factor R of the Jacobian."""
    result: NDArray[np.bool_] = np.sqrt(np.sum(R**2, axis=0)) >= _LEAST_NORM
    return result


def correlations(R: FloatArray) -> FloatArray:
    """Correlation matrix of the estimates, from the factor R of the Jacobian."""
    norms = np.sqrt(np.sum(R**2, axis=0))
    _, s, Vt = np.linalg.svd(R / norms)
    covariance = (Vt.T / np.maximum(s, 1e-12 * s[0]) ** 2) @ Vt
    std = np.sqrt(np.diag(covariance))
    result: FloatArray = covariance / np.outer(std, std)
    return result


def _not_identifiable(names: list[str], actuator: Actuator, reach: float) -> list[str]:
    if not names:
        return []
    text = f"the recording contains no information about {in_words(names)}"
    begun = np.abs(actuator.load.phi(np.linspace(0.0, reach, 101))).max(axis=0) > 0.0
    acts = dict(zip(actuator.load.names, begun.tolist(), strict=True))
    if not any(acts.get(name, True) for name in names):
        text += f": it reaches y = {reach * 1e3:.1f} mm, below the position from which they act"
    return [f"{text}; the interval is infinite."]


def _correlated(
    pairs: list[tuple[str, str, float]], actuator: Actuator, reach: float, with_pressure: bool
) -> list[str]:
    warnings = []
    for second, first, correlation in sorted(pairs, key=lambda pair: -abs(pair[2]))[:5]:
        text = (
            f"{first} and {second} cannot be estimated separately from this recording (correlation {correlation:+.3f})"
        )
        if second.startswith("theta_") and first.startswith("theta_"):
            needed = actuator.load.knots[-1]
            if reach < needed:
                text += f": it reaches {reach * 1e3:.1f} mm; record strokes to {needed * 1e3:.1f} mm or more"
            else:
                text += ": record slow strokes over the full travel as well"
        else:
            text += ": fix one of them" + ("" if with_pressure else ", or measure the pressure and fit with it")
        warnings.append(f"{text}. Their intervals are wide for this reason; the load curve may still be accurate.")
    if len(pairs) > 5:
        warnings.append(f"{len(pairs) - 5} more pairs of parameters have a correlation above {CORRELATION}.")
    return warnings


def in_words(names: Sequence[str]) -> str:
    """Names in a sentence: ``a``, ``a and b``, ``a, b and c``."""
    return "".join(names) if len(names) < 2 else f"{', '.join(names[:-1])} and {names[-1]}"
