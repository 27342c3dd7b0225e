"""Position at which a load reaches half its peak, and its interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.estimation import LoadCurve
from clutchid.log import FloatArray


class HalfLoad(NamedTuple):
    """Position where the rising load reaches half its peak, and its 95 % interval from the band, in m; or NaN."""

    position: float
    low: float
    high: float


def half_load(position: FloatArray, force: FloatArray) -> float:
    """Position in m where the rising load first reaches half its peak, by linear interpolation; else NaN.

    Examples
    --------
    >>> half_load(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 2.0, 4.0, 1.0]))
    1.0
    """
    return _passes(position, force, _half(force))


def half_load_band(curve: LoadCurve, reach: float) -> HalfLoad:
    """Position where the rising load first reaches half its peak within `reach` in m, and those of its band limits.

    Parameters
    ----------
    curve : LoadCurve
        Load curve with its band.
    reach : m
        Largest recorded position.

    Returns
    -------
    half : HalfLoad
        A limit is NaN if that limit of the band does not reach half the peak within the reach.

    Notes
    -----
    Half the peak is treated as fixed, because errors shift the load curve more than they tilt it.

    Examples
    --------
    >>> y = np.array([0.0, 1e-3, 2e-3, 3e-3])
    >>> f = np.array([0.0, 2e3, 4e3, 1e3])
    >>> [f"{at * 1e3:.2f}" for at in half_load_band(LoadCurve(y, f, f - 100.0, f + 100.0), 3e-3)]
    ['1.00', '0.95', '1.05']
    """
    inside = curve.position <= reach
    y, half = curve.position[inside], _half(curve.force[inside])
    # the upper limit of the band reaches it first
    return HalfLoad(*(_passes(y, force[inside], half) for force in (curve.force, curve.high, curve.low)))


def _half(force: FloatArray) -> float:
    """Half the peak; NaN if no force is known."""
    return 0.5 * float(np.nanmax(force)) if np.isfinite(force).any() else float("nan")


def _passes(position: FloatArray, force: FloatArray, level: float) -> float:
    """First position where the force passes `level` from below, by linear interpolation; else NaN."""
    above = int(np.argmax(force >= level)) if np.isfinite(level) else 0
    if above == 0 or not np.isfinite(force[above - 1 : above + 1]).all():
        return float("nan")
    y0, y1, f0, f1 = position[above - 1], position[above], force[above - 1], force[above]
    return float(y0 + (level - f0) / (f1 - f0) * (y1 - y0))
