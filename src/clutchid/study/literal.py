"""The paper as printed: readings that run, with their effects, and what cannot run, with the numbers that show it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from clutchid.documents.html import html_templates
from clutchid.documents.style import BAR, MM
from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import PAPER_KNOTS, Load
from clutchid.simulation import simulate
from clutchid.simulation.stiffness import STABLE_STEP
from clutchid.study.pressure import pressures
from clutchid.study.results import BALLISTIC, NUMBERS, Case, PaperMethod, StudyResults, case_of
from clutchid.study.tables import PRINTED_SLOPE, TABLE_1, TABLE_2, XI_2, XI_3, computed


def readings(used: Actuator) -> list[tuple[tuple[str, str, str], Actuator]]:
    """Readings of equations and of the Appendix: subject, reading, the one that is used; and the actuator of each."""
    p = used.parameters
    values = (
        ("V_0B", 1.2e-3 - p.A_B * p.y_max, "for 1.2·10⁻³ m³ at y = 0"),
        ("B_0", 0.528, "critical ratio of air"),  # (2 / 2.4)^3.5
        ("P_0", 1.01325e5, "standard atmosphere"),
        ("D_v", 2000.0, "least of the virtual trucks"),
        ("rho_0", 1.01325e5 / (p.R * p.T_0), "at standard atmosphere"),
        ("rho_0", p.P_0 / (p.R * p.T_0), "at P_0"),
        ("r_lam", 0.9999, "nearer to the print"),
    )
    slope = replace(used, load=replace(used.load, phi2_slope=PRINTED_SLOPE))
    rows = [(("φ₂", f"slope {PRINTED_SLOPE}, printed ξ₂", f"slope {used.load.phi2_slope:g}, stated"), slope)]
    for name, value, why in values:
        both = ((value, why), (used.value(name), used.row(name).source.split(",")[0].split(";")[0]))
        reading, beside = (f"{x:.6g}{used.unit_behind(name)}, {words}" for x, words in both)
        rows.append(((name, reading, beside), used.replace({name: value})))
    return rows


def as_printed(study: StudyResults) -> ReportTable:
    """Effects of each reading that runs: on the estimated weights, the load, and errors on the first recording."""
    logs, used = (study.fit_log, study.verify_log), study.case(BALLISTIC)
    pairs = [(words, case_of(BALLISTIC, *logs, start), used) for words, start in readings(Actuator())]
    for n in NUMBERS:
        parts, every, mass = (study.case(PaperMethod(*way)) for way in (("parts", n), ("every", n), ("every", n, "q")))
        pairs.append(((f"N = {n}", "every N samples", "N equal parts"), every, parts))
        pairs.append(((f"reset, N = {n}", "air masses kept", "pressures kept, printed"), mass, every))
    pairs.sort(key=lambda pair: pair[0][0].startswith("reset"))
    rms = map(pressures(used.fit.actuator, used.ballistic).rms, ("static_measured", "balanced_measured"))
    rows: list[tuple[Cell, ...]] = [(*words, *_effects(reading, beside)) for words, reading, beside in pairs]
    rows.append(("Eq. (26)", "static, printed", "full balance of Eq. (1)", *[None] * 7, *rms))
    sides = (("", "reading"), ("compared_", "compared"))
    columns = (
        Column("subject", "subject"), Column("reading", "reading"), Column("compared_with", "compared with"),
        *(Column(f"theta_{i}_change [1]", f"θ{'₁₂₃'[i - 1]}", 0.01, 1, group="change of θ [%]") for i in (1, 2, 3)),
        Column("load_change [N]", "load,\nlargest [N]", decimals=0, group="difference"),
        Column("position_change [m]", "y,\nlargest [mm]", MM, 3, group="difference"),
        *(Column(f"{which}position_rms [m]", words, MM, 3, group="rms y [mm]") for which, words in sides),
        *(Column(f"{which}pressure_a_rms [Pa]", words, BAR, 3, group="rms p [bar]") for which, words in sides),
    )  # fmt: skip
    return ReportTable("Readings that run, estimated anew", columns, tuple(rows), (1, 8, 13, 18))


def _effects(reading: Case, beside: Case) -> tuple[Cell, ...]:
    load, other = (case.fit.actuator.load for case in (reading, beside))
    changes = (a / b - 1.0 if b else None for a, b in zip(load.theta, other.theta, strict=True))
    y = np.linspace(0.0, float(np.nanmax(beside.fitted.measured["position"])), 401)
    apart = reading.ballistic.simulated["position"] - beside.ballistic.simulated["position"]
    mine, its = reading.ballistic.errors, beside.ballistic.errors
    largest = (float(np.nanmax(np.abs(difference))) for difference in (load.force(y) - other.force(y), apart))
    return *changes, *largest, mine.position_rms, its.position_rms, mine.pressure_a_rms, its.pressure_a_rms


def printed_weights(study: StudyResults) -> ReportTable:
    """The printed weights of Table 1 in both bases: loads, their peaks, and simulated positions."""
    y, rows = np.linspace(0.0, 0.025, 2501), list[tuple[Cell, ...]]()
    for number, theta in TABLE_1.items():
        both = [Actuator(load=Load(theta, phi2_slope=slope)) for slope in (PRINTED_SLOPE, 1.0)]
        forces = [actuator.load.force(y) for actuator in both]
        positions = [simulate(actuator, study.fit_log).log["position"] for actuator in both]
        load, apart = (np.abs(first - second) for first, second in (forces, positions))
        peaks = (float(y[np.argmax(force)]) for force in forces)
        sizes = float(load.max()), float(load.max()) / both[0].parameters.A_A, *peaks
        spans = float(np.sqrt(np.nanmean(apart**2))), float(np.nanmax(apart))
        rows.append(("ballistic" if number is None else f"N = {number}", *sizes, *spans))
    columns = (
        Column("method", "method"), Column("load_difference [N]", "load\n[N]", decimals=0, group="largest difference"),
        Column("pressure_difference [Pa]", "load / A_A\n[bar]", BAR, 2, group="largest difference"),
        Column("peak_published [m]", "slope 0.001\n[mm]", MM, 2, group="peak of the load"),
        Column("peak_stated [m]", "slope 1\n[mm]", MM, 2, group="peak of the load"),
        Column("position_difference_rms [m]", "rms\n[mm]", MM, 3, group="difference of simulated y"),
        Column("position_difference [m]", "largest\n[mm]", MM, 3, group="difference of simulated y"),
    )  # fmt: skip
    return ReportTable("Printed weights of Table 1 in both bases of φ₂", columns, tuple(rows))


def failures() -> ReportTable:
    """Table of what cannot run as printed, with the numbers at which it fails."""
    text = html_templates("clutchid.study").get_template("as_printed.html.j2").render(failing_numbers())
    rows = tuple(tuple(cell.strip() for cell in line.split("|")) for line in text.splitlines() if "|" in line)
    names = ("place", "printed", "used", "as printed")
    return ReportTable("What cannot run as printed", tuple(Column(name, name) for name in names), rows)


def failing_numbers() -> dict[str, Any]:
    """Runs of printed equations, and numbers from which the words of `failures` are computed."""
    import sympy as sp

    from clutchid.model.own import OwnModel
    from clutchid.model.valves import orifice_flow, psi

    used = Actuator(load=Load(TABLE_1[None], phi2_slope=PRINTED_SLOPE))
    y, V_0B, A_B, y_ve, rho_0, C_r, P_0, p_B, *B, C_ve, B_ve, B_0, r_lam = sp.symbols(
        "y V_0B A_B y_ve rho_0 C_r P_0 p_B B_in B_out C_ve B_ve B_0 r_lam"
    )
    w_in, w_out = (rho_0 * C_r * psi(p_B / P_0, shape, B_0, r_lam) for shape in B)
    t = np.arange(0.0, 1.2, 1e-3)
    held = Log(t, {"duty_supply": np.ones(t.size), "duty_exhaust": np.zeros(t.size)}).slice(0, 400)
    pulses = Log(t, {"duty_supply": np.where(t < 0.1, 1.0, 0.0), "duty_exhaust": np.where(t < 0.4, 0.0, 1.0)})

    def run(log: Log, actuator: Actuator = used, **terms: Any) -> Log:
        model = OwnModel("isothermal", terms=terms) if terms else "isothermal"
        states = simulate(replace(actuator, model=model), log, on_failure="return").log
        return states.slice(0, int(np.isfinite(states["position"]).sum()))

    return {
        "p": used.parameters, "psi": psi, "MM": MM, "BAR": BAR, "stable": STABLE_STEP / 1e-3, "knots": PAPER_KNOTS,
        "TABLE_1": TABLE_1, "TABLE_2": TABLE_2, "XI_2": XI_2, "XI_3": XI_3, "xi": computed(1.0), "used": run(pulses),
        "literal": run(held, V_B=V_0B - A_B * y), "sealed": run(held, w_r=P_0 * (w_in - w_out)),
        "free": run(held, used.replace(K_stop=100.0, D_stop=0.0)),  # the least stiffness that is admitted
        "shut": run(pulses, w_ve=y_ve * orifice_flow(p_B, P_0, C_ve, B_ve, rho_0, B_0, r_lam)),
    }  # fmt: skip


#: Tables of the paper as printed by file stem.
LITERAL_TABLES: Mapping[str, Callable[[StudyResults], ReportTable]] = {
    "as_printed": as_printed,
    "as_printed_table_1": printed_weights,
    "as_printed_failures": lambda _: failures(),
}
