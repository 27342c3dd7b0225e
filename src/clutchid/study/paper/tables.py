"""Tables of the study: Tables 1 and 2 with the printed values, verification, and pressure from the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from clutchid.estimation.result import Errors
from clutchid.reports.style import BAR, MM
from clutchid.reports.tables import Cell, Column, Table
from clutchid.study.paper.fits import Carry, Case, Method, chosen, load_error
from clutchid.study.paper.pressure import Pressures
from clutchid.study.paper.printed import TABLE_1, TABLE_2
from clutchid.study.paper.recording import TrueLoad

#: Display units: sums of squares in 10⁻⁴ m² and 10¹² Pa², weights in 10⁵ N/m, as in the paper.
_M2, _PA2, _WEIGHT = 1e-4, 1e12, 1e5

_CARRIED = {
    "p": "the pressures are carried across a reset (the paper)",
    "q": "the masses of air are carried across a reset",
}

#: Estimates of the pressure: attribute of `Pressures`, heading, motion.
WAYS = (
    ("static_simulated", "Eq. (26)\n[bar]", "simulated motion"),
    ("balanced_simulated", "full balance\n[bar]", "simulated motion"),
    ("static_measured", "Eq. (26)\n[bar]", "measured motion"),
    ("balanced_measured", "full balance\n[bar]", "measured motion"),
)


def rows_of(cases: Sequence[Case], carry: Carry) -> tuple[Case, ...]:
    """The rows of a table: ballistic, N parts, every N samples."""
    return chosen(cases, "ballistic", "parts", "every", carry=carry)


def table_1(cases: Sequence[Case], carry: Carry) -> Table:
    """Table 1: estimated weights with standard errors, and the printed ones."""
    columns = [Column("method", "method")]
    for i in (1, 2, 3):
        group = f"θ{'₁₂₃'[i - 1]} [10⁵ N/m]"
        columns += [
            Column(f"theta_{i} [N/m]", "estimate", _WEIGHT, 4, group=group),
            Column(f"theta_{i}_std [N/m]", "standard\nerror", _WEIGHT, 4, group=group),
            Column(f"theta_{i}_printed [N/m]", "printed", _WEIGHT, 4, group=group),
        ]
    rows = []
    for case in rows_of(cases, carry):
        estimates, page = case.fit.parameters, TABLE_1[case.method.number]
        row: list[Cell] = [case.method.label]
        for i, name in enumerate(("theta_1", "theta_2", "theta_3")):
            row += [estimates[name].value, estimates[name].std, page[i]]
        rows.append(tuple(row))
    note = (
        "Estimates belong to the basis of the stated conditions (slope 1 of φ₂ at t₃), printed weights to the basis "
        "as published (slope 0.001) and to another truck. The printed N is given for both interpretations, "
        "because the paper describes both."
    )
    title = f"Table 1. Estimated weights of the load; {_CARRIED[carry]}"
    return Table(title, tuple(columns), tuple(rows), (1, 6), note)


def table_2(cases: Sequence[Case], carry: Carry) -> Table:
    """Table 2: sums of squares and rms errors of the fitted simulation and of a ballistic run."""
    columns = [Column("method", "method")]
    for prefix, group in (("fitted", "fitted simulation"), ("ballistic", "ballistic run with the same θ")):
        columns += [
            Column(f"{prefix}_position_sse [m2]", "Σe² y\n[10⁻⁴ m²]", _M2, 2, group=group),
            Column(f"{prefix}_position_rms [m]", "rms y\n[mm]", MM, 3, group=group),
            Column(f"{prefix}_pressure_a_sse [Pa2]", "Σe² p\n[10¹² Pa²]", _PA2, 2, group=group),
            Column(f"{prefix}_pressure_a_rms [Pa]", "rms p\n[bar]", BAR, 3, group=group),
        ]
    columns += [
        Column("printed_position [m2]", "y\n[10⁻⁴ m²]", _M2, 4, group="printed"),
        Column("printed_pressure_a [Pa2]", "p\n[10¹² Pa²]", _PA2, 4, group="printed"),
    ]
    rows = tuple(
        (case.method.label, *_cells(case.fitted.errors), *_cells(case.ballistic.errors), *TABLE_2[case.method.number])
        for case in rows_of(cases, carry)
    )
    note = (
        "Only the ballistic columns compare methods: a partitioned simulation is reset to the measured position, so "
        "its position error is small with frequent resets, whatever θ is. The printed values are sums of squares in m² "
        "and Pa² of another recording of unknown length."
    )
    return Table(f"Table 2. Errors on the first recording; {_CARRIED[carry]}", tuple(columns), rows, (1, 6), note)


def _cells(errors: Errors) -> tuple[Cell, ...]:
    return errors.position_sse, errors.position_rms, errors.pressure_a_sse, errors.pressure_a_rms


def verification(cases: Sequence[Case], truth: TrueLoad | None) -> Table:
    """Errors of ballistic runs on the verification recording, and of the load if the true one is known."""
    run, load = "second recording, ballistic run", "load error"
    columns = [
        Column("method", "method"), Column("carry", "carried"),
        Column("position_sse [m2]", "Σe² y\n[10⁻⁴ m²]", _M2, 2, group=run),
        Column("position_rms [m]", "rms y\n[mm]", MM, 3, group=run),
        Column("pressure_a_sse [Pa2]", "Σe² p\n[10¹² Pa²]", _PA2, 2, group=run),
        Column("pressure_a_rms [Pa]", "rms p\n[bar]", BAR, 3, group=run),
    ]  # fmt: skip
    if truth is not None:
        columns += [
            Column("load_rms_engaging [N]", "rms 5–8 mm\n[N]", decimals=0, group=load),
            Column("load_rms [N]", "rms all\n[N]", decimals=0, group=load),
            Column("load_rms_of_peak [1]", "all, of peak\n[%]", 0.01, 1, group=load),
        ]
    rows = []
    for case in cases:
        cells: tuple[Cell, ...] = ()
        if truth is not None:
            error = load_error(case, truth)
            cells = error.engaging, error.everywhere, error.everywhere / float(truth.force.max())
        carried = "–" if case.method.partition is None else case.method.carry
        rows.append((case.method.label, carried, *_cells(case.verified.errors), *cells))
    note = "Only the initial position and pressure are estimated here, if the recording starts under pressure."
    return Table("Verification on the second recording", tuple(columns), tuple(rows), (1, 6, 11, 16), note)


def pressure_errors(
    cases: Sequence[Case], first: Mapping[Method, Pressures], second: Mapping[Method, Pressures]
) -> Table:
    """Rms errors of the pressure from the load, on both recordings."""
    both = {"first": first, "second": second}
    columns = [Column("method", "method")]
    columns += [
        Column(f"{which}_{name} [Pa]", heading, BAR, 3, group=f"{which} recording, {motion}")
        for which in both
        for name, heading, motion in WAYS
    ]
    rows = tuple(
        (case.method.label, *(found[case.method].rms(name) for found in both.values() for name, *_ in WAYS))
        for case in cases
    )
    note = (
        "Relative to the measured pressure. Simulated motion: states of the ballistic run; the full balance reproduces "
        "the simulated pressure, up to the numerical derivative of the velocity. Measured motion: position as "
        "measured, velocity and acceleration derived from it, seal deflection by Eq. (3), chamber B from the "
        "simulation. The pressures are carried across a reset."
    )
    return Table("Pressure in chamber A from the load, rms errors", tuple(columns), rows, (1, 6), note)
