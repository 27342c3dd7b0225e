"""SI units as products of powers, and the unit of an expression: a check of the equations of an `OwnModel`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

import sympy as sp

from clutchid.codegen.system import Expr, System
from clutchid.log.states import STATES
from clutchid.model.own.system import BEFORE, canonical, combined_terms, ordered
from clutchid.parameters import Parameters

if TYPE_CHECKING:
    from clutchid.model.own.model import OwnModel

#: Exponents of kg, m, s and K; None is the unit of 0, which fits every one.
Dimension: TypeAlias = tuple[Fraction, ...] | None

_BASE = ("kg", "m", "s", "K")

#: Units that can be part of a unit, by their exponents of kg, m, s and K.
SI: Mapping[str, tuple[int, ...]] = MappingProxyType({
    "1": (0, 0, 0, 0), "rad": (0, 0, 0, 0), "kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0),
    "K": (0, 0, 0, 1), "Hz": (0, 0, -1, 0), "N": (1, 1, -2, 0), "Pa": (1, -1, -2, 0), "J": (1, 2, -2, 0),
    "W": (1, 2, -3, 0),
})  # fmt: skip

#: Units in messages, the simplest name first.
_SHOWN = (
    "1", "kg", "m", "s", "K", "N", "Pa", "J", "W", "1/s", "m/s", "m/s²", "m²", "m³", "kg/s", "kg/m³", "N/m", "N·s/m",
    "N/s", "Pa/s", "K/s", "1/m", "s/m", "N·s²/m²", "m³/(Pa·s)", "J/(kg·K)", "W/(m²·K)",
)  # fmt: skip

#: Units of the terms that a model may replace, of inputs and of the load.
TERM_UNITS: Mapping[str, str] = MappingProxyType({
    **dict.fromkeys(("f_f", "f_s", "f_h", "f_l", "F_p", "F_g"), "N"),
    **dict.fromkeys(("w_vs", "w_ve", "w_A0", "w_v", "w_r"), "kg/s"),
    **dict.fromkeys(("V_A", "V_B"), "m³"),
    **dict.fromkeys(("Q_A", "Q_B"), "W"),
    **dict.fromkeys(("p_A_dot", "p_B_dot"), "Pa/s"),
    "z_dot": "m/s", "T_r": "K",
    **dict.fromkeys(("u_vs", "u_ve", "c_pwm", "d_pwm", "u_vs1", "u_ve1"), "1"),
    **{f"{letter}_{valve}": "1" for letter in "yhqlcai" for valve in ("vs", "ve")},
    **{f"q_{valve}1": "1" for valve in ("vs", "ve")},
})  # fmt: skip

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_FACTOR = re.compile(r"([A-Za-z]+|1)(?:\^?([-⁻]?[0-9⁰¹²³⁴⁵⁶⁷⁸⁹]+))?")


def dimension_of(unit: str) -> Dimension:
    """Exponents of kg, m, s and K of an SI unit such as N·s/m, kg/m^3 or m³/(Pa·s).

    Raises
    ------
    ValueError
        If it is not a product of units of `SI`; the text says which part is unknown.

    Examples
    --------
    >>> dimension_of("N·s/m") == dimension_of("kg/s")
    True
    """
    above, *below = unit.replace(" ", "").replace("*", "·").split("/")
    if len(below) > 1:
        raise ValueError("more than one '/': write m³/(Pa·s)")
    total = [Fraction(0)] * len(_BASE)
    parts = [(part, 1) for part in above.split("·")]
    parts += [(part, -1) for under in below for part in under.removeprefix("(").removesuffix(")").split("·")]
    for part, sign in parts:
        match = _FACTOR.fullmatch(part)
        if match is None or match[1] not in SI:
            raise ValueError(f"'{part}' is not an SI unit; the known units are {', '.join(SI)}")
        power = sign * int((match[2] or "1").translate(_SUPERSCRIPTS))
        total = [old + power * exponent for old, exponent in zip(total, SI[match[1]], strict=True)]
    return tuple(total)


def _shown(dimension: Dimension) -> str:
    """A unit for the exponents of kg, m, s and K."""
    if dimension is None:
        return "any unit"
    named = next((unit for unit in _SHOWN if dimension_of(unit) == dimension), None)
    return named or "·".join(f"{unit}^{power}" for unit, power in zip(_BASE, dimension, strict=True) if power)


def _unit_of(value: Expr, units: Mapping[str, Dimension]) -> Dimension:
    """The unit of an expression of symbols with the `units` by name; numbers but 0 have the unit 1.

    Raises
    ------
    ValueError
        If units do not fit; the text says where.
    """
    if value.is_Symbol:
        return units[value.name]
    if value.is_number and value == 0:
        return None
    parts = [_condition_or_unit(argument, units) for argument in value.args]
    if value.is_Mul:
        dimensions = [part for part in parts if part is not None]
        return tuple(map(sum, zip(*dimensions, strict=True))) if len(dimensions) == len(parts) else None  # type: ignore[arg-type]
    if value.is_Pow:
        return _power(value, parts)
    if value.is_Add or isinstance(value, (sp.Abs, sp.Max, sp.Min, sp.Piecewise, sp.core.relational.Relational)):
        return _common(value, parts)
    for part in parts:
        _demand_number(value, part)
    return dimension_of("1")


def _condition_or_unit(value: Expr, units: Mapping[str, Dimension]) -> Dimension:
    """The unit of a part; conditions are checked and fit every unit."""
    if isinstance(value, sp.functions.elementary.piecewise.ExprCondPair):
        _condition_or_unit(value.cond, units)
        return _unit_of(value.expr, units)
    if isinstance(value, sp.logic.boolalg.Boolean) and not value.is_Symbol:
        for part in value.args if isinstance(value, sp.logic.boolalg.BooleanFunction) else ():
            _condition_or_unit(part, units)
        if isinstance(value, sp.core.relational.Relational):
            _unit_of(value, units)
        return None
    return _unit_of(value, units)


def _power(value: Expr, parts: list[Dimension]) -> Dimension:
    base, exponent = parts
    _demand_number(value, exponent)
    if value.exp.is_Rational and base is not None:
        return tuple(power * Fraction(int(value.exp.p), int(value.exp.q)) for power in base)
    _demand_number(value, base)
    return dimension_of("1")


def _common(value: Expr, parts: list[Dimension]) -> Dimension:
    terms = [(part, unit) for part, unit in zip(value.args, parts, strict=True) if unit is not None]
    for part, unit in terms[1:]:
        if unit != terms[0][1]:
            raise ValueError(
                f"{value} combines {_term(terms[0][0])} [{_shown(terms[0][1])}] with {_term(part)} [{_shown(unit)}]"
            )
    return terms[0][1] if terms else None


def _term(part: Expr) -> str:
    return str(part.args[0] if isinstance(part, sp.functions.elementary.piecewise.ExprCondPair) else part)


def _demand_number(value: Expr, unit: Dimension) -> None:
    if unit is not None and any(unit):
        raise ValueError(f"{value} needs a number without unit, it has [{_shown(unit)}]")


def unit_problems(model: OwnModel, base: System) -> Iterator[str]:
    """Terms and rates whose units do not fit, one sentence each."""
    rows: dict[str, str] = {**TERM_UNITS, **{BEFORE.format(name): unit for name, unit in TERM_UNITS.items()}}
    rows |= {name: Parameters.row(name).unit for name in Parameters.names()}
    rows |= {name: state.unit for name, state in STATES.items()}
    rows |= {name: state.unit for name, state in model.states.items()}
    rows |= {name: parameter.unit for name, parameter in model.parameters.items()}
    units = {name: dimension_of(unit) for name, unit in rows.items()}
    terms = combined_terms(model, base)
    for name in ordered(terms, [sp.Symbol(name, real=True) for name in model.terms]):
        if name in model.terms:
            unit, problem = _fitting(f"terms: {name}", terms[name], units, units.get(name))
            yield from problem
            units.setdefault(name, unit)
    for name, rate in model.rates.items():
        yield from _fitting(f"rates: {name}", canonical(rate), units, _per_second(units[name]))[1]


def _fitting(
    where: str, value: Expr, units: Mapping[str, Dimension], expected: Dimension
) -> tuple[Dimension, list[str]]:
    """The unit of `value`, and what is wrong with it; None where nothing can be said."""
    try:
        unit = _unit_of(value, units)
    except ValueError as error:
        return None, [f"{where}: the units do not fit: {error}."]
    if unit is None or expected is None or unit == expected:
        return unit, []
    return unit, [f"{where}: the expression is in {_shown(unit)}; {_shown(expected)} is needed."]


def _per_second(unit: Dimension) -> Dimension:
    return tuple(power - (name == "s") for name, power in zip(_BASE, unit or (), strict=True))
