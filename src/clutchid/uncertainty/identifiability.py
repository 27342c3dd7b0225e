"""What a recording cannot tell, in the user's words; computed from the information that the recording carries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator

#: Two estimates that correlate more than this, in magnitude, are told as one sum only.
CORRELATION = 0.98

#: A singular value of the Jacobian with columns of length one below this is a direction that is not told.
SINGULAR = 1e-3

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
    warnings = _silence([name for i, name in enumerate(names) if silent[i]], actuator, reach)
    others = np.flatnonzero(~silent).tolist()
    if len(others) > 1:
        correlation = correlations(R[:, others])
        pairs = [
            (names[others[i]], names[others[j]], correlation[i, j])
            for i in range(len(others))
            for j in range(i)
            if others[i] < len(names) and others[j] < len(names) and abs(correlation[i, j]) > CORRELATION
        ]
        warnings += _alike(pairs, actuator, reach, with_pressure)
        warnings += _together(R[:, others], [names[i] if i < len(names) else "" for i in others])
    return warnings


def _together(R: FloatArray, names: Sequence[str]) -> list[str]:
    """Warnings about three or more parameters of which only a combination is told."""
    group = [names[i] for i in entangled(R) if names[i]]
    if len(group) < 3:
        return []
    return [
        f"of {listed(group)} only combinations are told by this recording: one change of them together leaves the "
        "simulation as it is; fix some of them, their single values and intervals mean nothing."
    ]


def entangled(R: FloatArray) -> list[int]:
    """Which dimensionless numbers are told in combination only, from the factor R of the Jacobian; no column is 0."""
    _, s, Vt = np.linalg.svd(R / np.sqrt(np.sum(R**2, axis=0)))
    members = {int(i) for row in np.flatnonzero(s < SINGULAR) for i in np.flatnonzero(np.abs(Vt[row]) > 0.1)}
    return sorted(members)


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


def _silence(names: list[str], actuator: Actuator, reach: float) -> list[str]:
    if not names:
        return []
    text = f"the recording says nothing about {listed(names)}"
    begun = np.abs(actuator.load.phi(np.linspace(0.0, reach, 101))).max(axis=0) > 0.0
    acts = dict(zip(actuator.load.names, begun.tolist(), strict=True))
    if not any(acts.get(name, True) for name in names):
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


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: ``a``, ``a and b``, ``a, b and c``."""
    return "".join(names) if len(names) < 2 else f"{', '.join(names[:-1])} and {names[-1]}"
