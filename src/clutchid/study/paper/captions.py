"""Captions of the figures, with the results of this run."""

from __future__ import annotations

import numpy as np

from clutchid.reports.style import MM
from clutchid.study.paper.figures import CLOSE, SLOW
from clutchid.study.paper.fits import PaperMethod, best_possible, load_error
from clutchid.study.paper.results import StudyResults, bars, millimetres

_BALLISTIC, _PARTS_32 = PaperMethod("ballistic"), PaperMethod("parts", 32)

_READING = (
    "N is interpreted as the number of equal parts, for which the resets are visible; with “every N samples”, the "
    "fitted simulation coincides with the measurement. Both interpretations are in the tables."
)


def captions(found: StudyResults) -> dict[int, str]:
    """Caption in HTML by number of the figure."""
    return {
        2: (
            "The basis functions of Eqs. (15) to (17). With the stated conditions φ<sub>1</sub> and φ<sub>2</sub> add "
            "up to y; with the slope 0.001, from which the printed ξ<sub>2</sub> follows, φ<sub>2</sub> stays near "
            "zero up to t<sub>3</sub> = 8.5 mm and has a kink there. The two differ by up to 3.25 mm, so a weight "
            "is meaningless without its basis. φ<sub>3</sub> is a bump of 1 mm at t<sub>4</sub>."
        ),
        3: _figure_3(found),
        4: _figure_4(found),
        5: _figure_5(found),
        6: _states(found, 6),
        7: _states(found, 7),
        8: _figure_8(found),
    }


def _figure_3(found: StudyResults) -> str:
    case, parted = found.case(_BALLISTIC), found.case(_PARTS_32)
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


def _figure_4(found: StudyResults) -> str:
    case, parted = found.case(_BALLISTIC), found.case(_PARTS_32)
    text = "Simulated pressure in chamber A on the first recording, arranged as in Figure 3; no fit uses the pressure. "
    if case.fitted.errors.pressure_a_rms is None:
        return text + "It was not measured in this recording, so only simulations are shown."
    return text + (
        f"Ballistic: {bars(case.fitted.errors.pressure_a_rms)} rms; 32 parts: "
        f"{bars(parted.fitted.errors.pressure_a_rms)} in the fitted simulation, "
        f"{bars(parted.ballistic.errors.pressure_a_rms)} in a ballistic run with its θ. In the paper N = 32 had the "
        "smallest pressure error."
    )


def _figure_5(found: StudyResults) -> str:
    def spread(reading: str, carry: str) -> str:
        cases = [case for case in found.cases if (case.method.reading, case.method.carry) == (reading, carry)]
        at_8 = [case.fit.actuator.load.force(np.array([8e-3]))[0] for case in cases]
        return f"{min(at_8):.0f} to {max(at_8):.0f} N"

    text = (
        "The load characteristics; shaded: 5 to 8 mm, where the clutch engages. At 8 mm the estimates range from "
        f"{spread('parts', 'p')} in (a), {spread('every', 'p')} in (b) and {spread('every', 'q')} in (c), where the "
        "masses of air are carried. (d) shows the printed weights in their published basis; they belong to "
        "another truck. "
    )
    if "pressure_a" in found.fit_log:
        text += (
            f"Dots: Eq. (25) from the measured pressure where the piston is slower than {SLOW / MM:.0f} mm/s; Coulomb "
            f"friction shifts them by up to {found.case(_BALLISTIC).fit.actuator.parameters.F_C:.0f} N above or below "
            "the load. "
        )
    if found.truth is not None:
        error = load_error(found.case(_BALLISTIC), found.truth)
        text += (
            f"The true load is known here: the rms error of the ballistic estimate is {error.engaging:.0f} N between 5 "
            f"and 8 mm and {error.everywhere:.0f} N overall; the smallest possible with these three splines is "
            f"{best_possible(found.truth):.0f} N overall."
        )
    return text


def _states(found: StudyResults, number: int) -> str:
    case = found.case(_BALLISTIC if number == 6 else _PARTS_32)
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


def _figure_8(found: StudyResults) -> str:
    text = (
        f"Pressure in chamber A from the load, on the second recording; right: {CLOSE:g} s around its fastest stroke. "
        "Eq. (26) neglects friction and acceleration; the full balance is Eq. (1) solved for p<sub>A</sub>. In (a) "
        "and (b) the motion is simulated, so the full balance reproduces the simulated pressure. In (c) the "
        "motion is measured, which needs no model of valves and air. "
    )
    one, other = found.second[_BALLISTIC], found.second[_PARTS_32]
    if one.measured is None:
        return text + "The pressure was not measured in this recording."
    return text + (
        f"Rms errors of (26) and of the full balance: (a) {bars(one.rms('static_simulated'))} and "
        f"{bars(one.rms('balanced_simulated'))}, (b) {bars(other.rms('static_simulated'))} and "
        f"{bars(other.rms('balanced_simulated'))}, (c) {bars(one.rms('static_measured'))} and "
        f"{bars(one.rms('balanced_measured'))}."
    )
