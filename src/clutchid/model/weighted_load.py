"""`Load`: weights on the paper's splines or on cubic B-splines, and their tables for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from clutchid.arguments import is_number
from clutchid.errors import ParameterError
from clutchid.log import FloatArray, read_only
from clutchid.model.compiled import compiled_functions
from clutchid.names import check_names

#: Knots in m: dense where the clutch takes hold and where the diaphragm spring turns, as wide as the change allows.
DEFAULT_KNOTS = tuple(mm * 1e-3 for mm in (0, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 22.5, 25))


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
    t = np.asarray(knots, dtype=np.float64)
    clamped = np.concatenate([[t[0]] * 3, t, [t[-1]] * 3])
    powers = np.zeros((clamped.size - 1, t.size - 1, 4))  # by function and interval; each of degree 0 is 1 in its own
    powers[np.arange(3, t.size + 2), np.arange(t.size - 1), 0] = 1.0
    for degree in (1, 2, 3):  # the recursion of Cox and de Boor, in powers of u = y - left breakpoint
        width = clamped[degree:] - clamped[:-degree]
        powers /= np.where(width > 0, width, 1.0)[:, None, None]
        times_u = np.roll(powers, 1, axis=-1)
        rising = (t[:-1] - clamped[: -degree - 1, None])[..., None] * powers[:-1] + times_u[:-1]
        powers = rising + (clamped[degree + 1 :, None] - t[:-1])[..., None] * powers[1:] - times_u[1:]
    before, after = np.zeros((2, t.size + 2, 4))
    before[:2, 1] = after[:-3:-1, 1] = -3.0, 3.0
    before[:, 1] /= t[1] - t[0]
    after[:, 1] /= t[-2] - t[-1]
    before[0, 0] = after[-1, 0] = 1.0
    return t, np.concatenate([before[:, None], powers, after[:, None]], axis=1)


#: Knots of the paper in m, Section 2.5.
PAPER_KNOTS = (0.0, 2e-3, 8.5e-3, 11.5e-3)

#: Bases of the load by name.
_BASES = ("paper", "b-spline")

#: A knot beyond both, a position in m and so many strokes, cannot be meant: a knot in mm is a thousand times too far.
_FAR, _FAR_STROKES = 0.5, 20.0

#: Knots that a load may have: more of them make a fit slow and no better.
MOST_KNOTS = 500


@cache
def _names(count: int) -> tuple[str, ...]:
    """theta_1, theta_2, ...; made once, as a search asks for them at every step."""
    return tuple(f"theta_{1 + i}" for i in range(count))


def in_metres(knots: Sequence[float], stroke: float = 0.0) -> str:
    """Hint for knots that are far beyond the stroke, probably because they are in mm.

    Parameters
    ----------
    knots : m
        Positions as they were given.
    stroke : m
        Stroke of the piston; 0 where it is not known.

    Returns
    -------
    sentence : str
        Empty where the knots can be meant.

    Examples
    --------
    >>> in_metres((2.0, 8.5, 11.5))
    ' Knots are in m, and these look like mm: (0.002, 0.0085, 0.0115) was probably meant.'
    >>> in_metres(PAPER_KNOTS)
    ''
    """
    far = max(_FAR, _FAR_STROKES * stroke)
    if not any(far < knot < math.inf for knot in knots):
        return ""
    meant = ", ".join(f"{knot / 1e3:g}" for knot in knots)
    return f" Knots are in m, and these look like mm: ({meant}) was probably meant."


@dataclass(frozen=True)
class Load:
    r"""The clutch load over the piston position, Eq. (14).

    .. math:: f_l(y) = \sum_i \theta_i \phi_i(y)

    Parameters
    ----------
    theta : N/m or N
        Weights: three in N/m for the paper's splines, number of knots + 2 in N for B-splines. A weight means nothing
        without its basis, so basis, knots and slope are kept with it.
    knots : m
        Strictly increasing positions: four, t_1 ... t_4, for the paper's splines, at least two for B-splines.
    phi2_slope : 1
        1 by the paper's stated conditions, 0.001 as published; see `clutchid.model.load.xi_2`. Paper's splines only.
    basis : 'paper' or 'b-spline'
        Eqs. (15)-(17), or `clutchid.model.weighted_load`.

    Raises
    ------
    ParameterError
        If knots do not increase, the number of weights does not fit, or a number is not finite.

    Examples
    --------
    The paper's ballistic estimate peaks at 5.0 kN, 4 bar on the piston:

    >>> load = Load((9.3850e5, -0.5817e5, 0.3909e5), phi2_slope=0.001)
    >>> f"{load.force(np.array([8.5e-3]))[0]:.0f} N"
    '4957 N'
    """

    theta: tuple[float, ...] = (9e5, 0.0, 0.0)
    knots: tuple[float, ...] = PAPER_KNOTS
    phi2_slope: float = 1.0
    basis: str = "paper"

    def __post_init__(self) -> None:
        problems = []
        check_names([self.basis], _BASES, "load basis")
        if len(self.knots) > MOST_KNOTS:
            raise ParameterError(f"{len(self.knots):,} knots: at most {MOST_KNOTS} are allowed; about ten are usual.")
        paper = self.basis == "paper"
        count = 3 if paper else len(self.knots) + 2
        if len(self.theta) != count or not all(is_number(value) and math.isfinite(value) for value in self.theta):
            number = "three" if paper else str(count)
            problems.append(f"theta = {self.theta}: {number} finite weights in {self.unit} are needed.")
        finite = all(is_number(knot) and math.isfinite(knot) for knot in self.knots)
        increasing = finite and all(a < b for a, b in zip(self.knots, self.knots[1:], strict=False))
        enough = len(self.knots) == 4 if paper else len(self.knots) >= 2
        if not enough or not increasing:
            problems.append(
                f"knots = {self.knots} m: {'four' if paper else 'two or more'} strictly increasing positions in m are "
                f"needed, all of them finite; the paper has {PAPER_KNOTS}.{in_metres(self.knots) if finite else ''}"
            )
        if not math.isfinite(self.phi2_slope):
            problems.append(f"phi2_slope = {self.phi2_slope}: 1 (stated conditions) or 0.001 (as published).")
        ParameterError.raise_for(problems)
        object.__setattr__(self, "theta", tuple(float(value) for value in self.theta))
        object.__setattr__(self, "knots", tuple(float(value) for value in self.knots))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the weights: theta_1, theta_2, ..."""
        return _names(len(self.theta))

    @classmethod
    def on_b_splines(cls, other: Load | None = None, knots: tuple[float, ...] = DEFAULT_KNOTS) -> Load:
        """A load on cubic B-splines that comes as near as it can to `other`, by default to the paper's start.

        Raises
        ------
        ParameterError
            If knots do not increase.

        Examples
        --------
        >>> load = Load.on_b_splines(Load((9.385e5, 0.0, 0.0)))
        >>> f"{load.force(np.array([8.5e-3]))[0]:.0f} N"
        '4927 N'
        """
        blank = cls((0.0,) * (len(knots) + 2), tuple(knots), 1.0, "b-spline")
        y = np.linspace(knots[0], knots[-1], 20 * len(knots))
        wanted = (cls() if other is None else other).force(y)
        return replace(blank, theta=tuple(np.linalg.lstsq(blank.phi(y), wanted, rcond=None)[0].tolist()))

    @property
    def unit(self) -> str:
        """Unit of the weights."""
        return "N/m" if self.basis == "paper" else "N"

    def curvature(self, y: FloatArray) -> FloatArray:
        """Second derivatives of the basis functions at the positions `y` in m, shape (n, n_theta)."""
        offset, c = self._pieces(y)
        return (2 * c[..., 2] + 6 * offset * c[..., 3]).T

    def _pieces(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances of positions to the breakpoints on their left, and coefficients of all basis functions there."""
        y = np.asarray(y, dtype=np.float64)
        segment = np.searchsorted(self.breakpoints, y, side="right")
        return y - self.breakpoints[np.maximum(segment - 1, 0)], self.coefficients[:, segment]

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        return _basis_table(self.basis, self.knots, self.phi2_slope)

    @property
    def breakpoints(self) -> FloatArray:
        """Positions in m where the polynomials change, shape (s - 1,)."""
        return self._table[0]

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients of every basis function, shape (n_theta, s, 4), in powers of y - left breakpoint."""
        return self._table[1]

    def combined(self, theta: FloatArray | None = None) -> FloatArray:
        """Coefficients of the load itself, shape (..., s, 4), with the weights `theta` (..., n) in place of its own."""
        weights = np.asarray(self.theta if theta is None else theta, dtype=np.float64)
        table = self.coefficients
        combined = weights @ table.reshape(len(table), -1)
        return combined.reshape(*weights.shape[:-1], *table.shape[1:])

    def phi(self, y: FloatArray) -> FloatArray:
        """Basis functions in m at the positions `y` in m, shape (n, n_theta)."""
        offset, c = self._pieces(y)
        return (c[..., 0] + offset * (c[..., 1] + offset * (c[..., 2] + offset * c[..., 3]))).T

    def force(self, y: FloatArray) -> FloatArray:
        """Load in N at the positions `y` in m, shape (n,)."""
        result: FloatArray = self.phi(y) @ np.asarray(self.theta)
        return result


@cache
def _basis_table(basis: str, knots: tuple[float, ...], phi2_slope: float) -> tuple[FloatArray, FloatArray]:
    table = compiled_functions().paper_table(*knots, phi2_slope) if basis == "paper" else b_spline_table(knots)
    return read_only(table[0]), read_only(table[1])
