"""Eq. (21): computed and printed coefficients of the basis functions."""

from __future__ import annotations

from clutchid.model.weighted_load import PAPER_KNOTS
from clutchid.reports.tables import Cell, Column, Table
from clutchid.study.paper.printed import PRINTED_SLOPE, XI_1, XI_2, XI_3, XI_3_ORDER

_NAMES = ("a_1", "b_1", "c_1", "a_2", "b_2", "c_2", "d_2", *(f"{letter}_3" for letter in "abcdefgh"))


def computed(phi2_slope: float) -> dict[str, float]:
    """All coefficients by name, in SI, for the knots of the paper and a slope of phi_2 at t_3."""
    import sympy as sp

    from clutchid.model.load import xi_1, xi_2, xi_3

    t_1, t_2, t_3, t_4 = (sp.Rational(round(knot * 1e7), 10**7) for knot in PAPER_KNOTS)
    slope = sp.Rational(round(phi2_slope * 1e3), 1000)
    values = [*xi_1(t_1, t_2, t_3), *xi_2(t_2, t_3, slope), *xi_3(t_2, t_4)]
    return {name: float(value) for name, value in zip(_NAMES, values, strict=True)}


def printed() -> dict[str, tuple[float | None, str]]:
    """Printed value and its position in the paper, by the name of the coefficient."""
    found: dict[str, tuple[float | None, str]] = {
        name: (value, f"ξ₁, {place + 1} of 3") for place, (name, value) in enumerate(zip(_NAMES[:3], XI_1, strict=True))
    }
    found |= {"a_2": (XI_2[0], "ξ₂, 1 of 3"), "b_2": (None, "lost, see below")}
    found |= {"c_2": (XI_2[1], "ξ₂, 2 of 3, see below"), "d_2": (XI_2[2], "ξ₂, 3 of 3")}
    for place, (name, value) in enumerate(zip(XI_3_ORDER, XI_3, strict=True)):
        found[name] = value, f"ξ₃, {place + 1} of 8"
    return found


def equation_21() -> Table:
    """Each coefficient computed for both slopes of phi_2, printed, and their relative difference."""
    stated, published, page = computed(1.0), computed(PRINTED_SLOPE), printed()
    rows: list[tuple[Cell, ...]] = []
    for name in _NAMES:
        value, where = page[name]
        difference = None if value is None or name == "c_2" else value / published[name] - 1.0
        rows.append((name, _unit(name), stated[name], published[name], value, difference, where))
    columns = (
        Column("coefficient", "coefficient"), Column("unit", "unit"),
        Column("stated_conditions", "slope 1,\nstated", significant=7, group="computed, slope of φ₂ at t₃"),
        Column("as_published", "slope 0.001,\nas published", significant=7, group="computed, slope of φ₂ at t₃"),
        Column("printed", "value", significant=0, group="printed in Eq. (21)"),
        Column("relative_difference", "relative\ndifference [10⁻⁶]", 1e-6, 0, group="printed in Eq. (21)"),
        Column("place", "position in the paper"),
    )  # fmt: skip
    note = (
        "The printed vectors follow from the slope 0.001, not from the stated slope 1; this affects ξ₂ only. ξ₂ is "
        "printed with three entries instead of four: the second has the sign of b_2 and the power of ten of c_2, "
        "so one of the two is lost. ξ₃ is printed in the order b, a, c, g, d, h, f, e. The last column is relative to "
        "slope 0.001; the remaining differences are rounding errors in the paper."
    )
    return Table("Equation (21), coefficients of the basis functions", columns, tuple(rows), (3, 7), note)


def _unit(name: str) -> str:
    power = {"1": "abc", "2": "abc", "3": "abcdefgh"}[name[2]].find(name[0])
    if name == "d_2":
        return "m"
    cubic = ("1/m²", "1/m", "1", "m")
    return cubic[power % 4] if name[2] == "3" else cubic[power + 1]
