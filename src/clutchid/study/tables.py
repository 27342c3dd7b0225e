"""Tables of the study: Tables 1 and 2 with the printed values, verification, and pressure from the load.

Keys of the tables are the paper's N; None is the ballistic row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain

from clutchid.documents.style import BAR, MM
from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.estimation.result import Errors
from clutchid.model.weighted_load import PAPER_KNOTS
from clutchid.study.bundled import TrueLoad
from clutchid.study.pressure import pressures
from clutchid.study.results import Carry, Case, StudyResults, load_error, table_rows

#: Table 1, theta_1, theta_2, theta_3 in N/m; they belong to the basis with `PRINTED_SLOPE`.
TABLE_1: Mapping[int | None, tuple[float, float, float]] = {
    None: (9.3850e5, -0.5817e5, 0.3909e5),
    2: (8.4554e5, -0.1678e5, 0.0971e5),
    4: (8.5581e5, -0.2233e5, 0.0),
    8: (9.8251e5, -0.3468e5, 0.5386e5),
    16: (8.9178e5, -0.3527e5, 0.0),
    32: (8.8767e5, -0.5476e5, 0.0),
}

#: Table 2, position error in m² and pressure error in Pa²; printed without a unit, as "average errors".
TABLE_2: Mapping[int | None, tuple[float, float]] = {
    None: (0.2678e-4, 2.7602e12),
    2: (8.8691e-4, 1.7203e12),
    4: (8.7327e-4, 1.7330e12),
    8: (3.3932e-4, 5.3149e12),
    16: (2.5684e-4, 2.1805e12),
    32: (4.1361e-3, 1.020e12),
}

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
    names = (*_NAMES[:4], "c_2", "d_2", *XI_3_ORDER)
    vectors = (("ξ₁", XI_1), ("ξ₂", XI_2), ("ξ₃", XI_3))
    entries = [(value, f"{xi}, {i} of {len(all_)}") for xi, all_ in vectors for i, value in enumerate(all_, 1)]
    page = dict(zip(names, entries, strict=True))
    return {**page, "b_2": (None, "lost"), "c_2": (XI_2[1], f"{page['c_2'][1]}")}


def equation_21() -> ReportTable:
    """Each coefficient computed for both slopes of phi_2, printed, and their relative difference."""
    stated, published, page = computed(1.0), computed(PRINTED_SLOPE), printed()
    units = dict(zip(_NAMES, ("1/m", "1", "m", "1/m", "1", "m", "m", *("1/m²", "1/m", "1", "m") * 2), strict=True))
    rows: list[tuple[Cell, ...]] = []
    for name in _NAMES:
        value, where = page[name]
        difference = None if value is None or name == "c_2" else value / published[name] - 1.0
        rows.append((name, units[name], stated[name], published[name], value, difference, where))
    columns = (
        Column("coefficient", "coefficient"), Column("unit", "unit"),
        Column("stated_conditions", "slope 1,\nstated", significant=7, group="computed, slope of φ₂ at t₃"),
        Column("as_published", "slope 0.001,\nas published", significant=7, group="computed, slope of φ₂ at t₃"),
        Column("printed", "value", significant=0, group="printed in Eq. (21)"),
        Column("relative_difference", "relative\ndifference [10⁻⁶]", 1e-6, 0, group="printed in Eq. (21)"),
        Column("place", "position in the paper"),
    )  # fmt: skip
    return ReportTable("Equation (21), coefficients of the basis functions", columns, tuple(rows), (3, 7))


#: Display units: sums of squares in 10⁻⁴ m² and 10¹² Pa², weights in 10⁵ N/m, as in the paper.
_M2, _PA2, _WEIGHT = 1e-4, 1e12, 1e5

_CARRIED = {
    "p": "the pressures are carried across a reset (the paper)",
    "q": "the masses of air are carried across a reset",
}

#: Estimates of the pressure: attributes of `Pressures`.
_WAYS = ("static_simulated", "balanced_simulated", "static_measured", "balanced_measured")
_HEADINGS = {"static": "Eq. (26)\n[bar]", "balanced": "full balance\n[bar]"}


def table_1(cases: Sequence[Case], carry: Carry) -> ReportTable:
    """Table 1: estimated weights with standard errors, and the printed ones."""
    names = ("theta_1", "theta_2", "theta_3")
    columns = [Column("method", "method")]
    for i, name in enumerate(names):
        for kind, heading in (("", "estimate"), ("_std", "standard\nerror"), ("_printed", "printed")):
            group = f"θ{'₁₂₃'[i]} [10⁵ N/m]"
            columns.append(Column(f"{name}{kind} [N/m]", heading, _WEIGHT, 4, group=group))
    rows: list[tuple[Cell, ...]] = []
    for case in table_rows(cases, carry):
        estimates = [case.fit.parameters[name] for name in names]
        cells = [(e.value, e.std, page) for e, page in zip(estimates, TABLE_1[case.method.number], strict=True)]
        rows.append((case.method.label, *chain.from_iterable(cells)))
    title = f"Table 1. Estimated weights of the load; {_CARRIED[carry]}"
    return ReportTable(title, tuple(columns), tuple(rows), (1, 6))


def table_2(cases: Sequence[Case], carry: Carry) -> ReportTable:
    """Table 2: sums of squares and rms errors of the fitted simulation and of a ballistic run."""
    columns = (
        Column("method", "method"), *_error_columns("fitted_", "fitted simulation"),
        *_error_columns("ballistic_", "ballistic run with the same θ"),
        Column("printed_position [m2]", "y\n[10⁻⁴ m²]", _M2, 4, group="printed"),
        Column("printed_pressure_a [Pa2]", "p\n[10¹² Pa²]", _PA2, 4, group="printed"),
    )  # fmt: skip
    rows = tuple(
        (case.method.label, *_cells(case.fitted.errors), *_cells(case.ballistic.errors), *TABLE_2[case.method.number])
        for case in table_rows(cases, carry)
    )
    return ReportTable(f"Table 2. Errors on the first recording; {_CARRIED[carry]}", columns, rows, (1, 6))


def _error_columns(prefix: str, group: str) -> tuple[Column, ...]:
    return (
        Column(f"{prefix}position_sse [m2]", "Σe² y\n[10⁻⁴ m²]", _M2, 2, group=group),
        Column(f"{prefix}position_rms [m]", "rms y\n[mm]", MM, 3, group=group),
        Column(f"{prefix}pressure_a_sse [Pa2]", "Σe² p\n[10¹² Pa²]", _PA2, 2, group=group),
        Column(f"{prefix}pressure_a_rms [Pa]", "rms p\n[bar]", BAR, 3, group=group),
    )


def _cells(errors: Errors) -> tuple[Cell, ...]:
    return errors.position_sse, errors.position_rms, errors.pressure_a_sse, errors.pressure_a_rms


def _verification(cases: Sequence[Case], truth: TrueLoad | None) -> ReportTable:
    """Errors of ballistic runs on the verification recording, and of the load if its truth is known."""
    columns = [Column("method", "method"), Column("carry", "carried")]
    columns += _error_columns("", "second recording, ballistic run")
    if truth is not None:
        columns += [
            Column("load_rms_engaging [N]", "rms 5–8 mm\n[N]", decimals=0, group="load error"),
            Column("load_rms [N]", "rms all\n[N]", decimals=0, group="load error"),
            Column("load_rms_of_peak [1]", "all, of peak\n[%]", 0.01, 1, group="load error"),
        ]
    rows = []
    for case in cases:
        cells: tuple[Cell, ...] = ()
        if truth is not None:
            error = load_error(case, truth)
            cells = error.engaging, error.everywhere, error.everywhere / float(truth.force.max())
        carried = "–" if case.method.partition is None else case.method.carry
        rows.append((case.method.label, carried, *_cells(case.verified.errors), *cells))
    return ReportTable("Verification on the second recording", tuple(columns), tuple(rows), (1, 6, 11, 16))


def pressure_errors(cases: Sequence[Case]) -> ReportTable:
    """Rms errors of the pressure from the load, on both recordings."""
    columns = [Column("method", "method")]
    columns += [
        Column(f"{which}_{name} [Pa]", _HEADINGS[way], BAR, 3, group=f"{which} recording, {motion} motion")
        for which in ("first", "second")
        for name in _WAYS
        for way, motion in [name.split("_")]
    ]
    rows: list[tuple[Cell, ...]] = []
    for case in cases:
        both = [pressures(case.fit.actuator, run) for run in (case.ballistic, case.verified)]
        rows.append((case.method.label, *(samples.rms(name) for samples in both for name in _WAYS)))
    return ReportTable("Pressure in chamber A from the load, rms errors", tuple(columns), tuple(rows), (1, 6))


#: Tables by file stem.
TABLES: Mapping[str, Callable[[StudyResults], ReportTable]] = {
    "equation_21": lambda _: equation_21(),
    "table_1": lambda study: table_1(study.cases, "p"),
    "table_1_carry_q": lambda study: table_1(study.cases, "q"),
    "table_2": lambda study: table_2(study.cases, "p"),
    "table_2_carry_q": lambda study: table_2(study.cases, "q"),
    "verification": lambda study: _verification(study.cases, study.truth),
    "pressure_errors": lambda study: pressure_errors(table_rows(study.cases, "p")),
}
