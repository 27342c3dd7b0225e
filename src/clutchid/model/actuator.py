"""`Load`, weights with the basis they belong to, and `Actuator` = model variant + parameters + load."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.model.b_spline import DEFAULT_KNOTS, b_spline_table
from clutchid.model.compiled import check_variant, functions, kernels, parameter_names, state_rows
from clutchid.model.equipment import Equipment
from clutchid.parameters import Parameters, Row, unknown_name
from clutchid.states import State

#: Knots of the paper in m, Section 2.5.
PAPER_KNOTS = (0.0, 2e-3, 8.5e-3, 11.5e-3)

#: Bases of the load by name.
BASES = ("paper", "b-spline")


@cache
def _weight_names(count: int) -> tuple[str, ...]:
    """theta_1, theta_2, ...; made once, as a search asks for them at every step."""
    return tuple(f"theta_{i + 1}" for i in range(count))


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
        Eqs. (15)-(17), or `clutchid.model.b_spline`.

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
        if self.basis not in BASES:
            raise ParameterError(unknown_name(str(self.basis), BASES, "load basis"))
        paper = self.basis == "paper"
        count = 3 if paper else len(self.knots) + 2
        if len(self.theta) != count or not all(math.isfinite(value) for value in self.theta):
            number = "three" if paper else str(count)
            problems.append(f"theta = {self.theta}: {number} finite weights in {self.unit} are needed.")
        increasing = all(a < b for a, b in zip(self.knots, self.knots[1:], strict=False))
        enough = len(self.knots) == 4 if paper else len(self.knots) >= 2
        if not enough or not increasing or not all(math.isfinite(knot) for knot in self.knots):
            problems.append(
                f"knots = {self.knots} m: {'four' if paper else 'two or more'} strictly increasing positions are "
                f"needed, all of them finite; the paper has {PAPER_KNOTS}."
            )
        if not math.isfinite(self.phi2_slope):
            problems.append(f"phi2_slope = {self.phi2_slope}: 1 (stated conditions) or 0.001 (as published).")
        if problems:
            raise ParameterError("\n".join(problems))
        object.__setattr__(self, "theta", tuple(float(value) for value in self.theta))
        object.__setattr__(self, "knots", tuple(float(value) for value in self.knots))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the weights: theta_1, theta_2, ..."""
        return _weight_names(len(self.theta))

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
        y = np.asarray(y, dtype=np.float64)
        segment = np.searchsorted(self.breakpoints, y, side="right")
        offset = y - self.breakpoints[np.maximum(segment - 1, 0)]
        c = self.coefficients[:, segment]
        result: FloatArray = (2 * c[..., 2] + 6 * offset * c[..., 3]).T
        return result

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        return _paper_table(self.knots, self.phi2_slope) if self.basis == "paper" else _b_splines(self.knots)

    @property
    def breakpoints(self) -> FloatArray:
        """Positions in m where the polynomials change, shape (s - 1,)."""
        return self._table[0]

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients of every basis function, shape (n_theta, s, 4), in powers of y - left breakpoint."""
        return self._table[1]

    def combined(self, theta: FloatArray | None = None) -> FloatArray:
        """Coefficients of the load itself, shape (s, 4), with the weights `theta` in place of the own ones."""
        weights = np.asarray(self.theta if theta is None else theta, dtype=np.float64)
        result: FloatArray = np.tensordot(weights, self.coefficients, axes=1)
        return result

    def phi(self, y: FloatArray) -> FloatArray:
        """Basis functions in m at the positions `y` in m, shape (n, n_theta)."""
        y = np.asarray(y, dtype=np.float64)
        segment = np.searchsorted(self.breakpoints, y, side="right")
        offset = y - self.breakpoints[np.maximum(segment - 1, 0)]
        c = self.coefficients[:, segment]
        result: FloatArray = (c[..., 0] + offset * (c[..., 1] + offset * (c[..., 2] + offset * c[..., 3]))).T
        return result

    def force(self, y: FloatArray) -> FloatArray:
        """Load in N at the positions `y` in m, shape (n,)."""
        result: FloatArray = self.phi(y) @ np.asarray(self.theta)
        return result


@cache
def _paper_table(knots: tuple[float, ...], phi2_slope: float) -> tuple[FloatArray, FloatArray]:
    breakpoints, coefficients = functions().paper_table(*knots, phi2_slope)
    return _frozen(np.array(breakpoints, dtype=np.float64), np.array(coefficients, dtype=np.float64))


@cache
def _b_splines(knots: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    return _frozen(*b_spline_table(knots))


def _frozen(*table: FloatArray) -> tuple[FloatArray, FloatArray]:
    breakpoints, coefficients = (np.ascontiguousarray(array) for array in table)  # the layout that kernels read
    for array in (breakpoints, coefficients):
        array.flags.writeable = False
    return breakpoints, coefficients


@dataclass(frozen=True)
class Actuator:
    """An actuator: model variant, parameters and load, and which chambers and valves there are.

    Parameters of a chamber or valve that does not exist have the values that stand for that.

    Raises
    ------
    ParameterError
        If there is no such variant.

    Examples
    --------
    >>> Actuator().value("C_vs")
    1.9e-08
    """

    parameters: Parameters = field(default_factory=Parameters)
    load: Load = field(default_factory=Load)
    model: str = "isothermal"
    equipment: Equipment = field(default_factory=Equipment)

    def __post_init__(self) -> None:
        check_variant(self.model)
        object.__setattr__(self, "parameters", self.equipment.fitted(self.parameters))

    @property
    def names(self) -> tuple[str, ...]:
        """All names that `value` and `replace` know: the parameters, then the load weights."""
        return (*self.parameter_names, *self.load.names)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of `array`."""
        return parameter_names(self.model)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the model's states, in the order of its kernels."""
        return tuple(self.state_rows)

    @property
    def state_rows(self) -> Mapping[str, State]:
        """The rows of the model's states by name, in the order of its kernels."""
        return state_rows(self.model)

    @property
    def in_equations(self) -> frozenset[str]:
        """Names of the parameters that the model's equations hold."""
        names = self.parameter_names
        return frozenset(names[q] for _, q in kernels(self.model).SLOTS)

    def array(self) -> FloatArray:
        """Values of the parameters in the order of `parameter_names`, shape (n_parameters,)."""
        return self.parameters.array()

    def row(self, name: str) -> Row:
        """Unit, meaning, admissible range and source of a parameter.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        return Parameters.row(name)

    def default(self, name: str) -> float:
        """The default of a parameter."""
        result: float = getattr(Parameters(), name)
        return result

    def value(self, name: str) -> float:
        """Value of a parameter or load weight, in SI.

        Raises
        ------
        ParameterError
            For an unknown name; the text has the nearest known one.
        """
        if name in self.load.names:
            return self.load.theta[self.load.names.index(name)]
        if name not in Parameters.names():
            raise ParameterError(unknown_name(name, self.names))
        result: float = getattr(self.parameters, name)
        return result

    def unit(self, name: str) -> str:
        """Unit of a parameter or load weight."""
        return self.load.unit if name in self.load.names else self.row(name).unit

    def unit_behind(self, name: str) -> str:
        """Unit of a parameter or load weight as it stands behind its value, with a space; empty where it has none."""
        unit = self.unit(name)
        return "" if unit == "1" else f" {unit}"

    def replace(self, changes: dict[str, float]) -> Actuator:
        """A copy with other parameter values or load weights, checked again.

        Raises
        ------
        ParameterError
            For an unknown name, a value outside its range, or a chamber or valve that does not exist.
        """
        theta = tuple(changes.get(name, value) for name, value in zip(self.load.names, self.load.theta, strict=True))
        others = {name: value for name, value in changes.items() if name not in self.load.names}
        problems = [unknown_name(name, self.names) for name in others if name not in Parameters.names()]
        problems += [sentence for name in others if (sentence := self.equipment.missing(name))]
        if problems:
            raise ParameterError("\n".join(problems))
        return replace(self, parameters=self.parameters.replace(others), load=replace(self.load, theta=theta))
