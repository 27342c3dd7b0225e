"""Values printed in the paper: Table 1, Table 2 and Eq. (21), and Eq. (21) computed.

Keys of the tables are the paper's N; None is the ballistic row.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from clutchid.model.weighted_load import PAPER_KNOTS
from clutchid.reports.tables import Cell, Column, ReportTable

#: Table 1, theta_1, theta_2, theta_3 in N/m; they belong to the basis with `PRINTED_SLOPE`.
TABLE_1: Mapping[int | None, tuple[float, float, float]] = MappingProxyType(
    {
        None: (9.3850e5, -0.5817e5, 0.3909e5),
        2: (8.4554e5, -0.1678e5, 0.0971e5),
        4: (8.5581e5, -0.2233e5, 0.0),
        8: (9.8251e5, -0.3468e5, 0.5386e5),
        16: (8.9178e5, -0.3527e5, 0.0),
        32: (8.8767e5, -0.5476e5, 0.0),
    }
)

#: Table 2, position error in m² and pressure error in Pa²; printed without a unit, as "average errors".
TABLE_2: Mapping[int | None, tuple[float, float]] = MappingProxyType(
    {
        None: (0.2678e-4, 2.7602e12),
        2: (8.8691e-4, 1.7203e12),
        4: (8.7327e-4, 1.7330e12),
        8: (3.3932e-4, 5.3149e12),
        16: (2.5684e-4, 2.1805e12),
        32: (4.1361e-3, 1.020e12),
    }
)

#: Slope of phi_2 at t_3 with which the printed xi_2 was computed; 1 by the stated conditions.
PRINTED_SLOPE = 0.001

#: Eq. (21), in the order of the page.
XI_1 = (-76.92308, 1.3077, -3.0769e-4)
XI_2 = (7.6923e-2, -3.0769e-7, -8.4968e-3)
XI_3 = (47.2372, -2.3327e3, -0.1610, 1.6900, 1.5163e-4, -6.9439e-3, -113.7192, 2.3327e3)

#: Order of the coefficients in the printed xi_3.
XI_3_ORDER = ("b_3", "a_3", "c_3", "g_3", "d_3", "h_3", "f_3", "e_3")


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


def equation_21() -> ReportTable:
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
    return ReportTable("Equation (21), coefficients of the basis functions", columns, tuple(rows), (3, 7), note)


def _unit(name: str) -> str:
    power = {"1": "abc", "2": "abc", "3": "abcdefgh"}[name[2]].find(name[0])
    if name == "d_2":
        return "m"
    cubic = ("1/m²", "1/m", "1", "m")
    return cubic[power % 4] if name[2] == "3" else cubic[power + 1]
