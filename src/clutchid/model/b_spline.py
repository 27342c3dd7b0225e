"""A load on cubic B-splines, beyond the paper: free in form, twice differentiable, affine in its weights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import FloatArray

#: Knots in m: dense where the clutch takes hold and where the diaphragm spring turns, as wide as the change allows.
DEFAULT_KNOTS = tuple(
    mm * 1e-3
    for mm in (
        0.0,
        0.5,
        1.0,
        1.5,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
        7.0,
        8.0,
        9.0,
        10.0,
        12.0,
        14.0,
        16.0,
        18.0,
        20.0,
        22.5,
        25.0,
    )
)


def b_spline_table(knots: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    r"""Table of the clamped cubic B-splines on `knots`, continued as straight lines outside.

    .. math:: f_l(y) = \sum_i \theta_i B_{i,4}(y)

    Parameters
    ----------
    knots : m
        Strictly increasing, at least two, shape (m,).

    Returns
    -------
    breakpoints, coefficients : m, 1 over powers of m
        Shapes (s - 1,) and (m + 2, s, 4): powers of y - left breakpoint, the first segment about the first breakpoint.
        The B-splines add up to 1, so weights are forces, and the first one is the load at the first knot: the preload.

    References
    ----------
    de Boor, A Practical Guide to Splines, 1978.

    Examples
    --------
    >>> breakpoints, coefficients = b_spline_table([0.0, 0.01, 0.025])
    >>> coefficients[:, 1, 0].tolist()
    [1.0, 0.0, 0.0, 0.0, 0.0]
    """
    from scipy.interpolate import BSpline

    t = np.asarray(knots, dtype=np.float64)
    clamped = np.concatenate([[t[0]] * 3, t, [t[-1]] * 3])
    spline = BSpline(clamped, np.eye(t.size + 2), 3)
    factorial = (1.0, 1.0, 2.0, 6.0)
    inside = np.stack([spline(t[:-1], nu) / factorial[nu] for nu in range(4)], axis=-1)
    before, after = np.zeros((2, t.size + 2, 4))
    before[:, 0], before[:, 1] = spline(t[0]), spline(t[0], 1)
    after[:, 0], after[:, 1] = spline(t[-1]), spline(t[-1], 1)
    return t, np.concatenate([before[:, None], inside.transpose(1, 0, 2), after[:, None]], axis=1)
