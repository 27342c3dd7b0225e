"""`Estimate` of a parameter and `LoadCurve`, each with its 95 % interval, as every result has them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import FloatArray

#: An interval is shown by its ends where its shorter side is less than this share of its longer one.
_SYMMETRIC = 0.9


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimate with standard error and 95 % interval, which are infinite if the data do not determine it.

    Attributes
    ----------
    value : unit
        The estimate.
    unit
        In SI.
    std : unit
        Standard error.
    low, high : unit
        95 % interval.

    Examples
    --------
    As text it has the 95 % interval, not the standard error; one without symmetry, as a profile's, has both ends:

    >>> print(Estimate(8.9e5, "Pa", 1e3, 8.8804e5, 8.9196e5))
    8.9e+05 ± 2e+03 Pa
    >>> print(Estimate(8.9e5, "Pa", 1e3, 8.89e5, 8.95e5))
    8.9e+05 (8.89e+05 to 8.95e+05) Pa
    """

    value: float
    unit: str
    std: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half width of the 95 % interval; its wider side where it ends at a bound."""
        return max(self.high - self.value, self.value - self.low)

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not np.isfinite(self.half):
            return "not determined"
        if min(self.high - self.value, self.value - self.low) < _SYMMETRIC * self.half:
            return f"{self.value:.4g} ({self.low:.4g} to {self.high:.4g}){unit}"
        return f"{self.value:.4g} ± {self.half:.2g}{unit}"


#: Points of a load curve, from 0 to the full stroke.
POINTS = 101


@dataclass(frozen=True, slots=True, eq=False)
class LoadCurve:
    """The load over the position with its pointwise 95 % interval, from 0 to the full stroke.

    Attributes
    ----------
    position : m, (101,)
        From 0 to y_max.
    force : N, (101,)
        The load.
    low, high : N, (101,)
        95 % interval; infinite where a weight is not determined.
    """

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray

    def __repr__(self) -> str:
        at = self.peak(float(self.position[-1]))
        return (
            f"LoadCurve({self.position.size} points from {self.position[0] * 1e3:g} to {self.position[-1] * 1e3:g} mm, "
            f"greatest {self.force[at] / 1e3:.3g} kN at {self.position[at] * 1e3:.3g} mm)"
        )

    def table(self) -> FloatArray:
        """Position, force, and the ends of its interval as columns, shape (n, 4)."""
        return np.column_stack([self.position, self.force, self.low, self.high])

    def widened(self, by: FloatArray | float) -> LoadCurve:
        """This load with an interval that has another independent error, of the half width `by` in N."""
        low = self.force - np.hypot(self.force - self.low, by)
        return replace(self, low=low, high=self.force + np.hypot(self.high - self.force, by))

    def peak(self, furthest: float) -> int:
        """Index of the greatest load up to position `furthest` in m, among points with an interval if any has one."""
        inside = self.position <= max(furthest, float(self.position[0]))
        bounded = inside & np.isfinite(self.high - self.low)
        return int(np.argmax(np.where(bounded if bounded.any() else inside, self.force, -np.inf)))
