"""Free parameters as dimensionless coordinates with a prior of mean 0 and standard deviation 1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator

#: Prior standard deviation of the curvature of a load in N/m²: the load of a 5 kN clutch bends over 4 mm.
CURVATURE = 3e8

#: Relative standard deviation of the parameters of a new actuator from Appendix A or a data sheet; the prior is
#: log-normal. Areas and stroke are known from the drawing. Reasons: docs/derivations.md.
SHARES: Mapping[str, float] = {
    "A_A": 0.001, "A_B": 0.001, "V_0A": 0.15, "V_0B": 0.15, "P_0": 0.003, "T_0": 0.02, "R": 0.002, "M": 0.15,
    "P_S": 0.05, "D_v": 0.4, "K_z": 0.3, "D_zdot": 0.3, "F_C": 0.4, "C_vs": 0.15, "C_ve": 0.15, "C_r": 0.4,
    "rho_0": 0.02, "y_max": 0.02, "K_stop": 0.5, "D_stop": 0.5, "d_stop": 0.5, "T_w": 0.03, "h_A": 0.5,
    "h_B": 0.5, "V_S": 0.6, "tau_S": 0.6, "v_S": 0.7, "c_F": 0.7, "B_0": 0.1,
    "m_vs": 0.25, "m_ve": 0.25, "K_h": 0.5, "F_h": 0.5, "tau_G": 0.5, "n_vs": 0.2, "n_ve": 0.2,
    "tau_vs": 0.5, "tau_ve": 0.5,
}  # fmt: skip

#: Standard deviation of parameters that may be 0 or change sign, in their unit; the prior is normal.
WIDTHS: Mapping[str, float] = {
    "R_0vs": 0.03, "R_0ve": 0.03, "R_1vs": 0.05, "R_1ve": 0.05, "B_vs": 0.8, "B_ve": 0.8, "B_in": 0.3, "B_out": 0.3,
    "R_S": 0.3, "s_vs": 0.1, "s_ve": 0.1, "s_pwm": 0.03, "tau_y": 2e-3, "tau_p": 2e-3, "e_y": 2e-5, "e_p": 2e3,
    "r_lam": 1e-3, "a_0vs": 0.1, "t_vs": 0.05, "t_ve": 0.05, "b_vs": 0.15, "b_ve": 0.15, "mu_h": 0.02, "a_0ve": 0.1,
    "gamma": 0.1, "C_A0": 1e-12,
}  # fmt: skip

#: Prior standard deviation of a load weight by its unit: N/m for the paper's splines, N for B-splines.
WEIGHT_WIDTHS = {"N/m": 5e5, "N": 2e3}


@dataclass(frozen=True, slots=True)
class Prior:
    """Prior of a parameter: mean and standard deviation in SI."""

    mean: float
    std: float


#: Standard deviation in m of the far stop from its position by the drawing, or by the reach of a recording.
STOP_STD = 5e-4


def far_stop(actuator: Actuator, reach: float) -> Prior:
    """Prior of the stroke: that of the drawing, or the reach of recordings in m if it is larger.

    The zero of the position is the engaged rest, which shifts with wear; the position of the far stop shifts with it.
    """
    return Prior(max(actuator.parameters.y_max, reach), STOP_STD)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One free parameter, shared by all recordings or of the recording `stem`.

    Its value is ``mean exp(width x)`` if `positive`, else ``mean + width x``, within the bounds. The prior of x is
    0 with a standard deviation of 1.
    """

    base: str
    stem: str | None
    mean: float
    width: float
    positive: bool
    low: float
    high: float

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
    low, high = (-np.inf, np.inf) if weight else actuator.row(base).limits
    if limits is not None:
        low, high = max(low, limits[0]), min(high, limits[1])
    mean = value if prior is None else prior.mean
    own = actuator.own_row(base)
    positive = (own.positive if own else base in SHARES) and mean > 0.0
    if prior is not None:
        width = prior.std / mean if positive else prior.std
    elif weight:
        width = WEIGHT_WIDTHS[actuator.load.unit]
    elif own and own.std:
        width = own.std / mean if positive else own.std
    elif not own and (positive or base in WIDTHS):
        width = SHARES[base] if positive else WIDTHS[base]
    else:
        raise ParameterError(f"{name}: there is no default prior; give --prior {name}=VALUE±STD.")
    if not low <= mean <= high:
        raise ParameterError(f"{name}: the prior mean {mean:g} lies outside its bounds {low:g} to {high:g}.")
    return Coordinate(base, stem or None, mean, width, positive, low, high)


def measured_rows(coordinates: Sequence[Coordinate], known: Mapping[str, Prior], x: FloatArray) -> FloatArray:
    """Rows ``[d r / d x | r]`` at x of measurements `known` of coordinates by their name, shape (m, k + 1).

    They are linear in x; a standard deviation is that at the measured value.
    """
    at = [i for i, c in enumerate(coordinates) if c.name in known]
    rows = np.zeros((len(at), x.size + 1))
    for row, i in zip(rows, at, strict=True):
        measured = known[coordinates[i].name]
        mean = coordinates[i].of(measured.mean)
        row[i] = coordinates[i].slope(mean) / measured.std
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
