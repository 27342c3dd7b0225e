"""What a recording cannot tell, in the user's words; computed from the information that the recording carries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.model.actuator import Actuator

FloatArray = NDArray[np.float64]

#: Two estimates that correlate more than this, in magnitude, are told as one sum only.
CORRELATION = 0.98

#: The recording says nothing about a number whose change by its natural size moves all residuals together by less
#: than this many noise scales: alone, its standard error would exceed that size.
SILENT = 1.0


def cannot_tell(
    R: FloatArray, names: Sequence[str], actuator: Actuator, reach: float, with_pressure: bool
) -> list[str]:
    """Warnings about parameters that the recording says nothing about, or cannot tell apart.

    Parameters
    ----------
    R : (k, k)
        Triangular factor of the Jacobian to dimensionless numbers, the first of which are `names`.
    reach : m
        Furthest position in the recording.
    with_pressure : bool
        Whether the measured pressure is in use already.
    """
    silent = ~heard(R)
    warnings = _silence([name for i, name in enumerate(names) if silent[i]], reach)
    others = np.flatnonzero(~silent)
    if others.size > 1:
        correlation = correlations(R[:, others])
        pairs = [
            (names[others[i]], names[others[j]], correlation[i, j])
            for i in range(others.size)
            for j in range(i)
            if others[i] < len(names) and others[j] < len(names) and abs(correlation[i, j]) > CORRELATION
        ]
        warnings += _alike(pairs, actuator, reach, with_pressure)
    return warnings


def heard(R: FloatArray) -> NDArray[np.bool_]:
    """Which dimensionless numbers the recording says anything about, shape (k,), from the factor R of the Jacobian."""
    result: NDArray[np.bool_] = np.sqrt(np.sum(R**2, axis=0)) >= SILENT
    return result


def correlations(R: FloatArray) -> FloatArray:
    """Correlation matrix of the estimates, from the factor R of the Jacobian."""
    norms = np.sqrt(np.sum(R**2, axis=0))
    _, s, Vt = np.linalg.svd(R / norms)
    covariance = (Vt.T / np.maximum(s, 1e-12 * s[0]) ** 2) @ Vt
    std = np.sqrt(np.diag(covariance))
    result: FloatArray = covariance / np.outer(std, std)
    return result


def _silence(names: list[str], reach: float) -> list[str]:
    if not names:
        return []
    text = f"the recording says nothing about {_listed(names)}"
    if all(name.startswith("theta_") for name in names):
        text += f": it reaches y = {reach * 1e3:.1f} mm, where their part of the load has not begun"
    return [f"{text}; the interval is infinite."]


def _alike(pairs: list[tuple[str, str, float]], actuator: Actuator, reach: float, with_pressure: bool) -> list[str]:
    warnings = []
    for one, other, correlation in sorted(pairs, key=lambda pair: -abs(pair[2]))[:5]:
        text = f"{other} and {one} cannot be told apart by this recording (correlation {correlation:+.3f})"
        if one.startswith("theta_") and other.startswith("theta_"):
            wanted = actuator.load.knots[-1]
            if reach < wanted:
                text += f": it reaches {reach * 1e3:.1f} mm, drive it to {wanted * 1e3:.1f} mm or more"
            else:
                text += ": add slow strokes over the whole travel"
        else:
            text += ": fix one of them" + ("" if with_pressure else ", or measure the pressure and fit with it")
        warnings.append(f"{text}; their intervals are wide for that reason, the load curve may still be well known.")
    if len(pairs) > 5:
        warnings.append(f"{len(pairs) - 5} more pairs of parameters correlate above {CORRELATION}.")
    return warnings


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
