"""Free parameters as dimensionless coordinates with a prior of mean 0 and standard deviation 1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.arguments import check_fields
from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator

#: Prior standard deviation of the curvature of a load in N/m²: the load of a 5 kN clutch bends over 4 mm.
CURVATURE = 3e8

#: Prior standard deviation of a load weight by its unit: N/m for the paper's splines, N for B-splines.
_WEIGHT_WIDTHS = {"N/m": 5e5, "N": 2e3}


@dataclass(frozen=True, slots=True)
class Prior:
    """Prior of a parameter.

    Parameters
    ----------
    mean : SI
        Most likely value before the recordings are seen.
    std : SI
        Standard deviation, above 0.

    Raises
    ------
    ParameterError
        If one of them is not finite, or the standard deviation not above 0.

    Examples
    --------
    A supply regulated to 9 bar, with 0.5 bar of doubt:

    >>> supply = Prior(9e5, 5e4)
    >>> f"{(supply.mean - 1.96 * supply.std) / 1e5:.1f} to {(supply.mean + 1.96 * supply.std) / 1e5:.1f} bar"
    '8.0 to 10.0 bar'
    """

    mean: float
    std: float

    def __post_init__(self) -> None:
        check_fields(self)
        if not (math.isfinite(self.mean) and 0.0 < self.std < math.inf):
            got = f"Prior({self.mean:g}, {self.std:g})"
            raise ParameterError(f"{got}: a finite mean and a standard deviation above 0 are needed, in SI.")


#: Standard deviation in m of the far stop from its position by the drawing, or by the reach of a recording.
STOP_STD = 5e-4


def far_stop(actuator: Actuator, reach: float) -> Prior:
    """Prior of the stroke: that of the drawing, or the reach of recordings in m if it is larger.

    The zero of the position is the engaged rest, which shifts with wear; the position of the far stop shifts with it.
    """
    return Prior(max(actuator.parameters.y_max, reach), STOP_STD)


#: Bound of every free parameter in standard deviations of its prior. Without it, parameters that the data do not
#: determine drift to absurd values: a calibration once sealed chamber B and made it twenty times too large.
PRIOR_LIMIT = 5.0


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One free parameter, shared by all recordings or of the recording `stem`.

    Its value is ``mean exp(width x)`` if `positive`, else ``mean + width x``, within the bounds. The prior of x is
    0 with a standard deviation of 1, and x at most `limit` from it; a coordinate without a prior has no limit.
    """

    base: str
    stem: str | None
    mean: float
    width: float
    positive: bool
    low: float
    high: float
    limit: float = PRIOR_LIMIT

    @property
    def name(self) -> str:
        """Name for the user: NAME, or NAME@STEM."""
        return self.base if self.stem is None else f"{self.base}@{self.stem}"

    def si(self, x: float) -> float:
        """Value in SI."""
        step = self.width * x
        value = self.mean * math.exp(min(max(step, -50.0), 50.0)) if self.positive else self.mean + step
        return min(max(value, self.low), self.high)

    def slope(self, x: float) -> float:
        """Derivative of the value with respect to x."""
        return self.width * self.si(x) if self.positive else self.width

    def of(self, value: float) -> float:
        """The coordinate of a value in SI."""
        if not self.positive:
            return (value - self.mean) / self.width
        return float(np.log(value / self.mean)) / self.width


def coordinates(
    actuator: Actuator,
    names: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
    priors: Mapping[str, Prior],
) -> tuple[Coordinate, ...]:
    """Coordinates of the free `names`, NAME or NAME@STEM; default priors are centred on the values of the actuator.

    Raises
    ------
    ParameterError
        If there is neither a default prior nor a given one, or the mean of a prior is outside the bounds.
    """
    return tuple(_coordinate(actuator, name, bounds.get(name), priors.get(name)) for name in names)


def _coordinate(actuator: Actuator, name: str, limits: tuple[float, float] | None, prior: Prior | None) -> Coordinate:
    base, _, stem = name.partition("@")
    value = actuator.value(base)
    weight = base in actuator.load.names
    row = None if weight else actuator.row(base)
    low, high = (-np.inf, np.inf) if row is None else row.limits
    if limits is not None:
        low, high = max(low, limits[0]), min(high, limits[1])
    mean = value if prior is None else prior.mean
    positive = row is not None and row.log_normal and mean > 0.0
    if prior is not None:
        width = prior.std / mean if positive else prior.std
    elif row is None:
        width = _WEIGHT_WIDTHS[actuator.load.unit]
    elif row.spread and not row.spread.share:
        width = row.spread.std / mean if positive else row.spread.std
    elif row.spread and positive:
        width = row.spread.std
    else:
        raise ParameterError(f"{name}: there is no default prior; give --prior {name}=VALUE±STD.")
    if not low <= mean <= high:
        raise ParameterError(f"{name}: the prior mean {mean:g} lies outside its bounds {low:g} to {high:g}.")
    return Coordinate(base, stem or None, mean, width, positive, low, high)


def measured_rows(coordinates: Sequence[Coordinate], measured: Mapping[str, Prior], x: FloatArray) -> FloatArray:
    """Rows ``[d r / d x | r]`` at x of measurements `measured` of coordinates by their name, shape (m, k + 1).

    They are linear in x; a standard deviation is that at the measured value.
    """
    at = [i for i, c in enumerate(coordinates) if c.name in measured]
    rows = np.zeros((len(at), x.size + 1))
    for row, i in zip(rows, at, strict=True):
        prior = measured[coordinates[i].name]
        mean = coordinates[i].of(prior.mean)
        row[i] = coordinates[i].slope(mean) / prior.std
        row[-1] = row[i] * (x[i] - mean)
    return rows


def smoothness(actuator: Actuator, names: Sequence[str], reference: Sequence[float], curvature: float) -> FloatArray:
    """Rows ``[d r / d theta | r]`` of a prior on the curvature of a B-spline load, centred on that of `reference`.

    The prior standard deviation of the second derivative at a knot is `curvature` N/m², over a millimetre; shape
    (m, k + 1), with derivatives with respect to the weights among `names` in SI, zero for the rest.
    """
    load = actuator.load
    knots = np.asarray(load.knots)
    weight = np.sqrt(np.gradient(knots) / 1e-3) / curvature
    inside = np.append(knots[:-1], np.nextafter(knots[-1], knots[0]))  # beyond the last knot the load is straight
    second = load.curvature(inside) * weight[:, None]
    rows = np.zeros((knots.size, len(names) + 1))
    for column, name in enumerate(names):
        if name in load.names:
            rows[:, column] = second[:, load.names.index(name)]
    rows[:, -1] = second @ (np.asarray(load.theta) - np.asarray(reference))
    return rows
