"""Page of the study: method, results, and deviations from the paper with their reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

import numpy as np

from clutchid.documents.document import Bullets, Document, Markup, Notice, Picture, Section, Text
from clutchid.documents.style import BAR, MM
from clutchid.documents.tables import ReportTable
from clutchid.estimation import Fit
from clutchid.log import Log
from clutchid.study.paper.figures import CLOSE, SLOW
from clutchid.study.paper.results import PaperMethod, StudyResults, best_possible, load_error, rows_of
from clutchid.study.paper.tables import TABLE_2

_BALLISTIC, _PARTS_32 = PaperMethod("ballistic"), PaperMethod("parts", 32)

_READING = (
    "N is interpreted as the number of equal parts, for which the resets are visible; with “every N samples”, the "
    "fitted simulation coincides with the measurement. Both interpretations are in the tables."
)


def captions(study: StudyResults) -> dict[int, str]:
    """Caption in HTML by number of the figure."""
    return {
        2: (
            "The basis functions of Eqs. (15) to (17). With the stated conditions φ<sub>1</sub> and φ<sub>2</sub> add "
            "up to y; with the slope 0.001, from which the printed ξ<sub>2</sub> follows, φ<sub>2</sub> stays near "
            "zero up to t<sub>3</sub> = 8.5 mm and has a kink there. The two differ by up to 3.25 mm, so a weight "
            "is meaningless without its basis. φ<sub>3</sub> is a bump of 1 mm at t<sub>4</sub>."
        ),
        3: _figure_3(study),
        4: _figure_4(study),
        5: _figure_5(study),
        6: _states(study, 6),
        7: _states(study, 7),
        8: _figure_8(study),
    }


def _figure_3(study: StudyResults) -> str:
    case, parted = study.case(_BALLISTIC), study.case(_PARTS_32)
    error = case.fitted.simulated["position"] - case.fitted.measured["position"]
    worst = int(np.nanargmax(np.abs(error)))
    return (
        "Simulated and measured position on the first recording: the simulations that were fitted (top), their error "
        f"(middle), and the error of a ballistic run with the same θ (bottom). {_READING} The ballistic fit has an "
        f"rms error of {millimetres(case.fitted.errors.position_rms)}, at most {abs(error[worst]) / MM:.1f} mm at "
        f"{case.fitted.measured.time[worst]:.1f} s. With 32 parts the fitted simulation has "
        f"{millimetres(parted.fitted.errors.position_rms)}, a ballistic run with its θ "
        f"{millimetres(parted.ballistic.errors.position_rms)}: a reset hides previous errors."
    )


def _figure_4(study: StudyResults) -> str:
    case, parted = study.case(_BALLISTIC), study.case(_PARTS_32)
    text = "Simulated pressure in chamber A on the first recording, arranged as in Figure 3; no fit uses the pressure. "
    if case.fitted.errors.pressure_a_rms is None:
        return text + "It was not measured in this recording, so only simulations are shown."
    return text + (
        f"Ballistic: {bars(case.fitted.errors.pressure_a_rms)} rms; 32 parts: "
        f"{bars(parted.fitted.errors.pressure_a_rms)} in the fitted simulation, "
        f"{bars(parted.ballistic.errors.pressure_a_rms)} in a ballistic run with its θ. In the paper N = 32 had the "
        "smallest pressure error."
    )


def _figure_5(study: StudyResults) -> str:
    def spread(reading: str, carry: str) -> str:
        cases = [case for case in study.cases if (case.method.interpretation, case.method.carry) == (reading, carry)]
        at_8 = [case.fit.actuator.load.force(np.array([8e-3]))[0] for case in cases]
        return f"{min(at_8):.0f} to {max(at_8):.0f} N"

    text = (
        "The load characteristics; shaded: 5 to 8 mm, where the clutch engages. At 8 mm the estimates range from "
        f"{spread('parts', 'p')} in (a), {spread('every', 'p')} in (b) and {spread('every', 'q')} in (c), where the "
        "masses of air are carried. (d) shows the printed weights in their published basis; they belong to "
        "another truck, so nothing of this recording is beside them. "
    )
    if "pressure_a" in study.fit_log:
        text += (
            f"Dots in (a) to (c): Eq. (25) from the measured pressure where the piston is slower than {SLOW / MM:.0f} "
            f"mm/s; Coulomb friction shifts them by up to {study.case(_BALLISTIC).fit.actuator.parameters.F_C:.0f} N "
            "above or below the load. "
        )
    if study.truth is not None:
        error = load_error(study.case(_BALLISTIC), study.truth)
        text += (
            f"The true load is known here (orange): the rms error of the ballistic estimate is {error.engaging:.0f} N "
            f"between 5 and 8 mm and {error.everywhere:.0f} N overall; the smallest possible with these three splines "
            f"is {best_possible(study.truth):.0f} N overall."
        )
    return text


def _states(study: StudyResults, number: int) -> str:
    case = study.case(_BALLISTIC if number == 6 else _PARTS_32)
    errors = case.verified.errors
    which = "θ from the ballistic fit" if number == 6 else "θ from the fit with 32 equal parts, p carried"
    rms = errors.pressure_a_rms
    pressure = "pressure was not measured" if rms is None else f"{bars(rms)} rms in pressure"
    text = (
        f"All states on the second recording, which was not fitted; ballistic run with {which}. "
        f"{millimetres(errors.position_rms)} rms in position, {pressure}. "
    )
    if number == 7:
        return text + "In the paper this θ gave the smaller pressure error; compare with Figure 6."
    low, high = (f(case.verified.simulated["pressure_b"]) / 1e5 for f in (np.nanmin, np.nanmax))
    return text + (
        f"Pressure B stays between {low:.2f} and {high:.2f} bar. The seal deflection saturates at ± "
        "F<sub>C</sub>/K<sub>z</sub> = 0.2 mm while the piston slides, so its sign is that of the last motion."
    )


def _figure_8(study: StudyResults) -> str:
    text = (
        f"Pressure in chamber A from the load, on the second recording; right: {CLOSE:g} s around its fastest stroke. "
        "Eq. (26) neglects friction and acceleration; the full balance is Eq. (1) solved for p<sub>A</sub>. In (a) "
        "and (b) the motion is simulated, so the full balance reproduces the simulated pressure. In (c) the "
        "motion is measured, which needs no model of valves and air. "
    )
    whole, other = study.second[_BALLISTIC], study.second[_PARTS_32]
    if whole.measured is None:
        return text + "The pressure was not measured in this recording."
    return text + (
        f"Rms errors of (26) and of the full balance: (a) {bars(whole.rms('static_simulated'))} and "
        f"{bars(whole.rms('balanced_simulated'))}, (b) {bars(other.rms('static_simulated'))} and "
        f"{bars(other.rms('balanced_simulated'))}, (c) {bars(whole.rms('static_measured'))} and "
        f"{bars(whole.rms('balanced_measured'))}."
    )


#: One HTML sentence each; the full derivation is in the docstring of each equation.
DEVIATIONS = (
    "<b>Eq. (5), chamber B.</b> V<sub>B</sub> = V<sub>0B</sub> + A<sub>B</sub>(y<sub>max</sub> − y) with "
    "V<sub>0B</sub> as the dead volume at full stroke, y<sub>max</sub> = 25 mm; read literally, the volume turns "
    "negative at 10.13 mm.",
    "<b>Eq. (4), chamber A.</b> V<sub>A</sub> = V<sub>0A</sub> + A<sub>A</sub> y; the paper does not define it.",
    "<b>Eq. (10), density.</b> ρ<sub>0</sub> = 1.185 kg/m³ (reference air of ISO 6358) is missing from the Appendix.",
    "<b>Exhaust valve.</b> It flows from p<sub>A</sub> to P<sub>0</sub>; the printed p<sub>h,ve</sub> = "
    "P<sub>B</sub> would never empty chamber A.",
    "<b>Eqs. (12), (13), orifice of chamber B.</b> Printed without the upstream pressure, and with the same ratio "
    "both ways, so that the net flow would always be zero; corrected.",
    "<b>Flow near equal pressures.</b> Linear to zero above r = 0.999, where the printed curve has a vertical tangent.",
    "<b>B<sub>0</sub> = 0.582</b> as printed; 0.528 is the physical value, the effect is at most 0.083 mm.",
    "<b>φ<sub>2</sub>, Eqs. (16), (20), (21).</b> Slope 1 at t<sub>3</sub> by the stated conditions; the printed "
    "ξ<sub>2</sub> needs 0.001. Estimates on this page belong to slope 1, the printed Table 1 is drawn with slope "
    "0.001.",
    "<b>Eqs. (19), (20).</b> A<sub>3</sub> has shifted columns and B<sub>3</sub> is printed as zeros; both follow "
    "from the eight stated conditions.",
    "<b>Meaning of N.</b> “Number of partitions” beside Table 1, “after each N<sup>th</sup> simulation step” in "
    "Section 3.1: these contradict each other, so both are given.",
    "<b>Reset.</b> The paper takes the measured position and keeps the pressures; that creates or destroys air, so "
    "carrying q = pV is included too.",
    "<b>Start.</b> Eq. (24) where a recording starts vented and at rest; else position and pressure at its start are "
    "estimated.",
    "<b>Bounds.</b> θ<sub>1</sub> ≥ 0 and θ<sub>3</sub> ≥ 0, which the exact zeros of Table 1 suggest; θ<sub>2</sub> "
    "is free.",
    "<b>Table 2.</b> The “average errors” are sums of squares in m² and Pa²: as averages they would mean 10 to 23 "
    "bar rms.",
    "<b>Eqs. (25), (26).</b> They neglect friction and chamber B; the full balance of Eq. (1) is given too.",
    "<b>End stops.</b> At 0 and 25 mm; the printed model has none, and its load falls beyond 8.5 mm.",
    "<b>Section 3.2.</b> “The proposed model do represent the system completely” reads as “does not”: the sentence "
    "explains deviations.",
    "<b>Solver.</b> Classical Runge-Kutta with fixed steps and inputs held between samples, exact sensitivities; the "
    "paper used ode45 and lsqnonlin.",
)


_ALT = {
    2: "The three basis functions over the position", 3: "Measured and simulated positions over time",
    4: "Measured and simulated pressures over time", 5: "Estimated, printed and static clutch loads over the position",
    6: "All states over time, ballistic estimate", 7: "All states over time, estimate from 32 parts",
    8: "Pressure in chamber A from the load, over time",
}  # fmt: skip


def study_page(
    study: StudyResults, made: Mapping[str, ReportTable], figures: Mapping[int, bytes], command: str
) -> Document:
    """The page of the study, not yet rendered, with the tables by file stem and the figures by number."""
    words = captions(study)

    def figure(number: int) -> Picture:
        return Picture(figures[number], Markup(f"<b>Figure {number}.</b> {words[number]}"), _ALT[number])

    sections = (
        Section("Summary", (_text(_abstract(study)), _bullets(_findings(study)))),
        Section("Method", (_text(_data(study)), *_warnings(study), _text(_METHOD), _text(_READINGS))),
        Section("Basis functions, Eq. (21)", (figure(2), made["equation_21"])),
        Section("Estimated load, Table 1", (made["table_1"], made["table_1_carry_q"], figure(5), _table_1(study))),
        Section(
            "Errors on the first recording, Table 2",
            (made["table_2"], made["table_2_carry_q"], _table_2(study), figure(3), figure(4)),
        ),
        Section(
            "Verification on the second recording",
            (made["verification"], _verification(study), figure(6), figure(7)),
        ),
        Section("Pressure from the load, Eq. (26)", (figure(8), made["pressure_errors"])),
        Section("Why the results differ from the paper", (_text(_why(study)),)),
        Section("Deviations from the printed equations", (_bullets(DEVIATIONS),)),
        Section("Files", (_text(_files(made, figures)),)),
    )
    logs = [log for log in (study.fit_log, study.verify_log) if "sha256" in log.metadata]
    return Document(
        "Clutch load characteristics: the paper's study repeated",
        f"{_SIMULATED if study.truth is not None else ''}After Langjord, Johansen, Snare and Bratli, “Estimation of "
        "electropneumatic clutch actuator load characteristics”, Section 3",
        sections=lambda: sections,
        command=command,
        sources={log.metadata.get("source", log.name): log.metadata["sha256"] for log in logs},
    )


def _text(html: str) -> Text:
    return Text(Markup(html))


def _bullets(items: Iterable[str]) -> Bullets:
    return Bullets(tuple(map(Markup, items)))


def millimetres(value: float) -> str:
    """A length as text, as in ``0.93 mm``."""
    return f"{value / MM:.2f} mm"


def bars(value: float | None) -> str:
    """A pressure as text, as in ``0.25 bar``."""
    return "not measured" if value is None else f"{value / BAR:.2f} bar"


def _abstract(study: StudyResults) -> str:
    case = study.case(_BALLISTIC)
    load = case.fit.actuator.load
    y = case.fit.load_curve.position
    force = load.force(y)
    at = int(np.argmax(force))
    first, second = case.fitted.errors, case.verified.errors
    text = (
        f"The load of a clutch was estimated from <i>{escape(study.fit_log.name)}</i> ({_length(study.fit_log)}) with "
        f"the position as the only measured quantity, and checked on <i>{escape(study.verify_log.name)}</i> "
        f"({_length(study.verify_log)}), which was not fitted. The ballistic fit gives θ = ({_weights(case.fit)})·10⁵ "
        f"N/m (95 % intervals, noise only), a load with a peak of {force[at]:.0f} N at {y[at] / MM:.1f} mm. A "
        f"simulation with it has an rms position error of {millimetres(first.position_rms)} on the first recording and "
        f"{millimetres(second.position_rms)} on the second"
    )
    if first.pressure_a_rms is not None and second.pressure_a_rms is not None:
        text += f"; the rms pressure errors, not used in the fit, are {bars(first.pressure_a_rms)} and "
        text += bars(second.pressure_a_rms)
    return text + "."


def _length(log: Log) -> str:
    return f"{log.time[-1] - log.time[0]:.1f} s, {len(log)} samples"


def _weights(fit: Fit) -> str:
    return ", ".join(f"{e.value / 1e5:.3f} ± {e.half / 1e5:.3f}" for e in fit.parameters.values()).replace("-", "−")


def _warnings(study: StudyResults) -> tuple[Notice, ...]:
    """Warnings from reading and fitting the recordings."""
    texts = dict.fromkeys([*study.case(_BALLISTIC).fit.warnings, *study.verify_log.warnings])
    return tuple(Notice(text) for text in texts)


def _findings(study: StudyResults) -> tuple[str, ...]:
    items = []
    if study.truth is not None:
        error, peak = load_error(study.case(_BALLISTIC), study.truth), float(study.truth.force.max())
        items.append(
            "<b>Load.</b> The true load is known here. The rms error of the ballistic estimate is "
            f"{error.engaging:.0f} N where the clutch engages (5 to 8 mm) and {error.everywhere:.0f} N overall "
            f"({100 * error.everywhere / peak:.1f} % of the peak). {_coverage(study)}"
        )
    p, q = (study.case(PaperMethod("every", 2, carry)) for carry in ("p", "q"))
    text = (
        "<b>Resets.</b> Resetting the position at constant pressure, as the paper does, creates or destroys air. With "
        "a reset every 2 samples, a ballistic simulation with the estimated θ has an rms position error of "
        f"{millimetres(p.ballistic.errors.position_rms)}; if the masses of air are carried instead, "
        f"{millimetres(q.ballistic.errors.position_rms)}."
    )
    if study.truth is not None:
        far, near = (load_error(case, study.truth).engaging for case in (p, q))
        text += f" The rms errors of the load between 5 and 8 mm are then {far:.0f} N and {near:.0f} N."
    items.append(text)
    second = study.second[_BALLISTIC]
    if second.measured is not None:
        items.append(
            "<b>Pressure.</b> From the load and the measured position, Eq. (26) gives the pressure of the second "
            f"recording with an rms error of {bars(second.rms('static_measured'))}; the full force balance, with "
            f"friction and acceleration, with {bars(second.rms('balanced_measured'))}."
        )
    items.append(
        "<b>Two interpretations of N.</b> The paper describes N in two contradictory ways. Both are in the tables; the "
        f"order of the printed position errors is reproduced with {_reproducing(study)}."
    )
    return tuple(items)


def _reproducing(study: StudyResults) -> str:
    """Interpretations of N for which the position errors of ballistic runs have the printed order."""
    page = sorted(TABLE_2, key=lambda n: TABLE_2[n][0])
    names = {"parts": "N equal parts", "every": "every N samples"}
    same = []
    for reading, words in names.items():
        rows = [case for case in rows_of(study.cases, "p") if case.method.interpretation in ("ballistic", reading)]
        if [case.method.number for case in sorted(rows, key=lambda case: case.ballistic.errors.position_sse)] == page:
            same.append(words)
    return " and with ".join(same) or "neither"


def _coverage(study: StudyResults) -> str:
    assert study.truth is not None
    curve, truth = study.case(_BALLISTIC).fit.load_curve, study.truth
    low, high = (np.interp(truth.position, curve.position, edge) for edge in (curve.low, curve.high))
    inside = int(np.sum((truth.force >= low) & (truth.force <= high)))
    return (
        f"Its 95 % band contains the true load at {inside} of {truth.position.size} positions: the band accounts for "
        "noise and coloured residuals, not for model errors."
    )


def _data(study: StudyResults) -> str:
    if study.truth is None:
        return (
            f"First recording, fitted: <i>{escape(study.fit_log.name)}</i>. Second recording, simulated only: "
            f"<i>{escape(study.verify_log.name)}</i>. The true load is unknown, so only position and pressure errors "
            "are given."
        )
    return (
        "The recording comes with clutchid. It is <b>simulated, not measured</b>: a virtual truck that is more "
        "detailed than the paper's model (energy balance with heat to the walls, valves switched at 100 Hz, finite air "
        "supply, Stribeck friction, end stops, a load outside the span of the three splines, quantised and noisy "
        "position with engine vibration). Its true load is known and shown in Figure 5. It was divided at the rest "
        f"nearest to the middle, at {study.verify_log.time[0]:.2f} s: the first half was fitted, the second only "
        "simulated."
    )


#: Before the source, under the title.
_SIMULATED = "A simulated recording of a virtual truck, not the paper's data. "

_METHOD = (
    "The fifth-order model (23) with the parameters of the paper's Appendix was simulated with the recorded duty "
    "cycles, and θ<sub>1</sub>, θ<sub>2</sub>, θ<sub>3</sub> were estimated by least squares on the position error, in "
    "two stages as in the paper: coarse, then fine. θ<sub>1</sub> and θ<sub>3</sub> are at least 0. Standard "
    "errors allow for coloured residuals."
)

_READINGS = (
    "A ballistic simulation has no resets. A partitioned one resets the position to the measurement, after every N "
    "samples or at the starts of N equal parts: the paper describes both. All other states continue; across a reset "
    "either the pressures are carried (p, the paper) or the masses of air (q = p<sub>A</sub>V<sub>A</sub>, which "
    "conserves mass)."
)


def _table_1(study: StudyResults) -> Text:
    fit = study.case(_BALLISTIC).fit
    curve = fit.load_curve
    half = ((curve.high - curve.low) / 2)[(curve.position >= 5e-3) & (curve.position <= 8e-3)]
    at_bound = [c.method for c in study.cases if c.fit.parameters["theta_3"].value == 0.0]
    theta_3 = fit.parameters["theta_3"]
    text = (
        f"θ<sub>3</sub> is exactly at its bound 0 in {len(at_bound)} of {len(study.cases)} fits; in the paper in 3 "
        f"of 6 rows. In the ballistic fit it is {theta_3.value / 1e5:.2f}·10⁵ N/m with a standard error of "
        f"{theta_3.std / 1e5:.2f}·10⁵ N/m"
    )
    if np.isfinite(half).all():
        text += f", yet the 95 % band of the load itself is at most ± {half.max():.0f} N between 5 and 8 mm"
    return _text(text + ".")


def _table_2(study: StudyResults) -> Text:
    rows = rows_of(study.cases, "p")
    base = rows[0].ballistic.errors.position_sse
    best = min(rows, key=lambda case: case.ballistic.errors.position_sse)
    text = (
        "Σe² are <b>sums of squares</b> and increase with the number of samples; rms errors do not. Among ballistic "
        f"runs θ of the method “{best.method.label}” has the smallest position error; the ballistic fit minimises "
        "exactly this sum. "
    )
    measured = [case for case in rows if case.ballistic.errors.pressure_a_sse is not None]
    if measured:
        least = min(measured, key=lambda case: case.ballistic.errors.pressure_a_sse or 0.0)
        rms = bars(least.ballistic.errors.pressure_a_rms)
        text += f"For the pressure it is “{least.method.label}” ({rms} rms); in the paper N = 32. "
    ratios = {n: (study.case(PaperMethod("parts", n)), study.case(PaperMethod("every", n))) for n in (2, 32)}
    compared = "; ".join(
        f"N = {n}: printed {TABLE_2[n][0] / TABLE_2[None][0]:.0f}, parts {a.ballistic.errors.position_sse / base:.1f}, "
        f"every N samples {b.ballistic.errors.position_sse / base:.1f}"
        for n, (a, b) in ratios.items()
    )
    return _text(
        f"{text}In the paper the ballistic row has the smallest position error, which is necessary for ballistic runs "
        "with each θ, but not for partitioned simulations. This suggests, without proof, that Table 2 contains "
        "ballistic runs. Position error (sum of squares, ballistic runs) relative to the ballistic row: "
        f"{compared}."
    )


def _verification(study: StudyResults) -> Text:
    rows = rows_of(study.cases, "p")
    low, high = (f(rows, key=lambda case: case.verified.errors.position_rms) for f in (min, max))
    return _text(
        "With p carried, the position error on the second recording ranges from "
        f"{millimetres(low.verified.errors.position_rms)} rms ({low.method.label}) to "
        f"{millimetres(high.verified.errors.position_rms)} ({high.method.label})."
    )


def _why(study: StudyResults) -> str:
    floor = study.case(PaperMethod("every", 2)).fitted.errors.position_rms
    text = (
        "The paper's recording of the truck “Gamal” is not public; these data are from another actuator, so the "
        "printed values cannot be reproduced, only the conclusions can be tested. Sums of squares also depend on the "
        "number of samples, which the paper does not give. "
    )
    if study.truth is not None:
        text += (
            "The paper's parameters are not those of this truck, and its model lacks part of this truck's physics; in "
            "the model the pressure falls too slowly when the chamber is vented (Figures 4 and 6), and the estimated "
            "load compensates for that. "
        )
    return text + (
        f"With a reset every 2 samples the rms difference from the measurement is {floor / MM:.3f} mm, an upper bound "
        "of the noise; larger errors in the ballistic rows are errors of the model or of its parameters."
    )


def _files(made: Mapping[str, ReportTable], figures: Mapping[int, bytes]) -> str:
    names = [*(f"{stem}.csv" for stem in made), *(f"figure_{number}.png" for number in figures)]
    return "Tables in SI with all digits, and figures: " + ", ".join(f"<code>{name}</code>" for name in names) + "."
