"""The page of the study: what was done, what came out, and why it differs from the paper."""

from __future__ import annotations

import numpy as np

from clutchid.estimate import Fit
from clutchid.log import Log
from clutchid.report.html import Bullets, Notice, Page, Picture, Section, Text, escape
from clutchid.report.provenance import provenance
from clutchid.report.style import KN, MM
from clutchid.study.paper.captions import captions
from clutchid.study.paper.deviations import DEVIATIONS
from clutchid.study.paper.findings import Findings, bars, millimetres
from clutchid.study.paper.fits import Method, load_error
from clutchid.study.paper.printed import TABLE_2
from clutchid.study.paper.tables import rows_of

_BALLISTIC = Method("ballistic")

_ALT = {
    2: "The three basis functions over the position", 3: "Measured and simulated positions over time",
    4: "Measured and simulated pressures over time", 5: "Estimated, printed and static clutch loads over the position",
    6: "All states over time, ballistic estimate", 7: "All states over time, estimate from 32 parts",
    8: "Pressure in chamber A from the load, over time",
}  # fmt: skip


def study_page(found: Findings, command: str) -> Page:
    """The page of the study before it is rendered."""
    made, words = found.tables, captions(found)

    def figure(number: int) -> Picture:
        return Picture(found.figures[number], f"<b>Figure {number}.</b> {words[number]}", _ALT[number])

    sections = (
        Section("In short", (Text(_abstract(found)), Bullets(_findings(found)))),
        Section("What was done", (Text(_data(found)), *_warnings(found), Text(_METHOD), Text(_READINGS))),
        Section("Basis functions, Eq. (21)", (figure(2), made["equation_21"])),
        Section("Estimated load, Table 1", (made["table_1"], made["table_1_carry_q"], figure(5), _table_1(found))),
        Section(
            "Errors on the first recording, Table 2",
            (made["table_2"], made["table_2_carry_q"], _table_2(found), figure(3), figure(4)),
        ),
        Section(
            "Verification on the second recording",
            (made["verification"], _verification(found), figure(6), figure(7)),
        ),
        Section("Pressure from the load, Eq. (26)", (figure(8), made["pressure_errors"])),
        Section("Why the numbers differ from the print", (Text(_why(found)),)),
        Section("Deviations from the printed equations", (Bullets(DEVIATIONS),)),
        Section("Files beside this page", (Text(_files(found)),)),
    )
    return Page(
        "Clutch load characteristics: the paper's study repeated",
        "After Langjord, Johansen, Snare and Bratli, “Estimation of electropneumatic clutch actuator load "
        "characteristics”, Section 3",
        sections,
        provenance([found.fit_log, found.verify_log], command),
    )


def _abstract(found: Findings) -> str:
    case = found.case(_BALLISTIC)
    load = case.fit.actuator.load
    y = case.fit.load_curve.position
    force = load.force(y)
    at = int(np.argmax(force))
    first, second = case.fitted.errors, case.verified.errors
    text = (
        f"The load of a clutch was estimated from <i>{escape(found.fit_log.name)}</i> ({_length(found.fit_log)}) with "
        f"the position as the only measured quantity, and checked on <i>{escape(found.verify_log.name)}</i> "
        f"({_length(found.verify_log)}), which was not fitted. The ballistic fit gives θ = ({_weights(case.fit)})·10⁵ "
        f"N/m, a load with its peak of {force[at] / KN:.2f} kN at {y[at] / MM:.1f} mm. A simulation with it is "
        f"{millimetres(first.position_rms)} rms off in position on the first recording and "
        f"{millimetres(second.position_rms)} on the second"
    )
    if first.pressure_a_rms is not None and second.pressure_a_rms is not None:
        text += f"; in pressure, which was not used, {bars(first.pressure_a_rms)} and {bars(second.pressure_a_rms)}"
    return text + "."


def _length(log: Log) -> str:
    return f"{log.time[-1] - log.time[0]:.1f} s, {len(log)} samples"


def _weights(fit: Fit) -> str:
    return ", ".join(f"{e.value / 1e5:.3f} ± {e.std / 1e5:.3f}" for e in fit.parameters.values()).replace("-", "−")


def _warnings(found: Findings) -> tuple[Notice, ...]:
    """What reading and fitting had to say about the recordings."""
    texts = dict.fromkeys([*found.case(_BALLISTIC).fit.warnings, *found.verify_log.warnings])
    return tuple(Notice(text) for text in texts)


def _findings(found: Findings) -> tuple[str, ...]:
    items = []
    if found.truth is not None:
        error, peak = load_error(found.case(_BALLISTIC), found.truth), float(found.truth.force.max())
        items.append(
            f"<b>Load.</b> Against the true load, known here, the ballistic estimate is {error.engaging:.0f} N rms "
            f"off where the clutch engages (5 to 8 mm) and {error.everywhere:.0f} N over all "
            f"({100 * error.everywhere / peak:.1f} % of the peak). {_coverage(found)}"
        )
    p, q = (found.case(Method("every", 2, carry)) for carry in ("p", "q"))
    text = (
        "<b>Resets.</b> Taking the measured position at constant pressure, as the paper does, creates or destroys air "
        "at each reset. With a reset every 2 samples, a ballistic run with the estimated θ is "
        f"{millimetres(p.ballistic.errors.position_rms)} rms off; where the masses of air are carried instead, "
        f"{millimetres(q.ballistic.errors.position_rms)}."
    )
    if found.truth is not None:
        far, near = (load_error(case, found.truth).engaging for case in (p, q))
        text += f" The load is then {far:.0f} N and {near:.0f} N rms off between 5 and 8 mm."
    items.append(text)
    second = found.second[_BALLISTIC]
    if second.measured is not None:
        items.append(
            "<b>Pressure.</b> From the load and the measured position, Eq. (26) gives the pressure of the second "
            f"recording to {bars(second.rms('static_measured'))} rms; the full balance of forces, with friction and "
            f"acceleration, to {bars(second.rms('balanced_measured'))}."
        )
    items.append(
        "<b>Two readings of N.</b> The paper describes N in two ways that contradict each other. Both are in the "
        f"tables; the order of the printed errors in position comes out with {_reproducing(found)}."
    )
    return tuple(items)


def _reproducing(found: Findings) -> str:
    """Which readings put the position errors of ballistic runs in the order of the print."""
    page = sorted(TABLE_2, key=lambda n: TABLE_2[n][0])
    names = {"parts": "N equal parts", "every": "every N samples"}
    same = []
    for reading, words in names.items():
        rows = [case for case in rows_of(found.cases, "p") if case.method.reading in ("ballistic", reading)]
        if [case.method.number for case in sorted(rows, key=lambda case: case.ballistic.errors.position_sse)] == page:
            same.append(words)
    return " and with ".join(same) or "neither"


def _coverage(found: Findings) -> str:
    assert found.truth is not None
    curve, truth = found.case(_BALLISTIC).fit.load_curve, found.truth
    low, high = (np.interp(truth.position, curve.position, edge) for edge in (curve.low, curve.high))
    inside = int(np.sum((truth.force >= low) & (truth.force <= high)))
    return (
        f"Its 95 % band holds the true load at {inside} of {truth.position.size} positions: the band counts noise and "
        "coloured residuals, not what the model leaves out."
    )


def _data(found: Findings) -> str:
    if found.truth is None:
        return (
            f"First recording, fitted: <i>{escape(found.fit_log.name)}</i>. Second recording, simulated only: "
            f"<i>{escape(found.verify_log.name)}</i>. The true load is not known, so errors are those of position and "
            "pressure."
        )
    return (
        "The recording comes with clutchid. It is <b>simulated, not measured</b>: a virtual truck whose physics is "
        "richer than the paper's model (energy balance with heat to the walls, valves switched at 100 Hz, finite air "
        "supply, Stribeck friction, end stops, a load outside the span of the three splines, quantised and noisy "
        "position with engine vibration). Its true load is known and drawn in Figure 5. It was cut at the rest "
        f"nearest to the middle, at {found.verify_log.time[0]:.2f} s: the first half was fitted, the second only "
        "simulated."
    )


_METHOD = (
    "The fifth-order model (23) with the parameters of the paper's Appendix was simulated with the recorded duty "
    "cycles, and θ<sub>1</sub>, θ<sub>2</sub>, θ<sub>3</sub> were found by least squares on the position error, twice "
    "as in the paper: coarsely from afar, then finely. θ<sub>1</sub> and θ<sub>3</sub> are at least 0. Standard "
    "errors allow for coloured residuals."
)

_READINGS = (
    "A ballistic simulation runs through. A partitioned one takes the measured position again, after every N samples "
    "or at the starts of N equal parts: the paper says both. All other states go on; across a reset either the "
    "pressures are carried (p, the paper) or the masses of air (q = p<sub>A</sub>V<sub>A</sub>, so that no air "
    "appears or vanishes)."
)


def _table_1(found: Findings) -> Text:
    fit = found.case(_BALLISTIC).fit
    curve = fit.load_curve
    half = ((curve.high - curve.low) / 2)[(curve.position >= 5e-3) & (curve.position <= 8e-3)]
    at_bound = [c.method for c in found.cases if c.fit.parameters["theta_3"].value == 0.0]
    theta_3 = fit.parameters["theta_3"]
    text = (
        f"θ<sub>3</sub> lies exactly at its bound 0 in {len(at_bound)} of {len(found.cases)} fits; in the print in 3 "
        f"of 6 rows. In the ballistic fit it is {theta_3.value / 1e5:.2f}·10⁵ N/m with a standard error of "
        f"{theta_3.std / 1e5:.2f}·10⁵ N/m"
    )
    if np.isfinite(half).all():
        text += f", yet the 95 % band of the load itself is at most ± {half.max():.0f} N between 5 and 8 mm"
    return Text(text + ".")


def _table_2(found: Findings) -> Text:
    rows = rows_of(found.cases, "p")
    base = rows[0].ballistic.errors.position_sse
    best = min(rows, key=lambda case: case.ballistic.errors.position_sse)
    text = (
        "Σe² are <b>sums of squares</b> and grow with the number of samples; rms errors do not. Among ballistic runs "
        f"θ of the method “{best.method.label}” has the smallest error in position; the ballistic fit minimises just "
        "that sum. "
    )
    measured = [case for case in rows if case.ballistic.errors.pressure_a_sse is not None]
    if measured:
        least = min(measured, key=lambda case: case.ballistic.errors.pressure_a_sse or 0.0)
        rms = bars(least.ballistic.errors.pressure_a_rms)
        text += f"In pressure it is “{least.method.label}” ({rms} rms); in the print N = 32. "
    ratios = {n: (found.case(Method("parts", n)), found.case(Method("every", n))) for n in (2, 32)}
    compared = "; ".join(
        f"N = {n}: printed {TABLE_2[n][0] / TABLE_2[None][0]:.0f}, parts {a.ballistic.errors.position_sse / base:.1f}, "
        f"every N samples {b.ballistic.errors.position_sse / base:.1f}"
        for n, (a, b) in ratios.items()
    )
    return Text(
        f"{text}In the print the ballistic row has the smallest position error of all, as ballistic runs with each θ "
        "must give and partitioned simulations need not: this suggests, without proving it, that Table 2 was made "
        "with ballistic runs. Position error (sum of squares, ballistic runs) over that of the ballistic row: "
        f"{compared}."
    )


def _verification(found: Findings) -> Text:
    rows = rows_of(found.cases, "p")
    low, high = (f(rows, key=lambda case: case.verified.errors.position_rms) for f in (min, max))
    return Text(
        "With p carried, the error in position on the second recording goes from "
        f"{millimetres(low.verified.errors.position_rms)} rms ({low.method.label}) to "
        f"{millimetres(high.verified.errors.position_rms)} ({high.method.label})."
    )


def _why(found: Findings) -> str:
    floor = found.case(Method("every", 2)).fitted.errors.position_rms
    text = (
        "The paper's recording of the truck “Gamal” is not public; these are other data of another actuator, so its "
        "numbers cannot come out again, only its statements can be tried. Sums of squares also depend on the number "
        "of samples, which the paper does not give. "
    )
    if found.truth is not None:
        text += (
            "The paper's parameters are not those of this truck, and its model lacks part of this truck's physics; "
            "the pressure falls too slowly in the model when the chamber empties (Figures 4 and 6), and the load has "
            "to make up for it. "
        )
    return text + (
        f"With a reset every 2 samples the simulation stays {floor / MM:.3f} mm rms from the measurement, which "
        "bounds the noise; all that is above it in the ballistic rows is error of the model or of its parameters."
    )


def _files(found: Findings) -> str:
    names = [*(f"{stem}.csv" for stem in found.tables), *(f"figure_{number}.png" for number in found.figures)]
    return "Tables in SI with all digits, and figures: " + ", ".join(f"<code>{name}</code>" for name in names) + "."
