"""Supply pressure implied by the data: the plateau of the chamber pressure behind an open supply valve."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.direction import direction
from clutchid.inspection.pressure_unit import pressure_unit
from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.signal import run_ends
from clutchid.log import FloatArray

CHECK = "supply pressure"

#: Opening from which the supply valve counts as fully open.
OPEN = 0.9

#: Length in s of the final part that must be flat, and least number of samples in it.
END, FEWEST = 0.03, 4

#: Largest remaining flow, as a fraction of the choked flow, of a full chamber: within 1 % of the supply pressure.
TRICKLE = 0.05

#: Relative difference between the supply pressure of the vehicle and of the actuator that a fit tolerates.
TOLERANCE = 0.02


def supply_pressure(reading: Reading) -> Check:
    """Plateau of the pressure behind a supply valve that is open for long, or else a lower bound."""
    if "pressure_a" not in reading.measured or not reading.driven:
        sentence = "without the chamber pressure the supply pressure cannot be checked; a fit keeps its start value."
        return Check(CHECK, "-", "undetermined", sentence)
    if pressure_unit(reading).grade != "good" or direction(reading).grade == "bad":
        sentence = (
            "the unit of the pressure or the sign of the position is wrong, so the supply pressure cannot be checked."
        )
        return Check(CHECK, "-", "undetermined", sentence)
    plateaus, known = _plateaus(reading), reading.actuator.parameters.P_S
    if plateaus.size:
        return _compared(float(np.median(plateaus)), plateaus.size, known)
    # noise alone lifts one of a thousand samples by three standard deviations
    pressure = reading.log["pressure_a"]
    least = float(np.nanquantile(pressure, 0.999)) - 3 * float(np.nan_to_num(reading.noises["pressure_a"]))
    value = f"at least {least * 1e-5:.3g} bar"
    if least > (1 + TOLERANCE) * known:
        sentence = (
            f"the chamber reaches {least * 1e-5:.3g} bar, more than the supply pressure of the actuator, "
            f"{known * 1e-5:.3g} bar: a fit would underestimate the air flow; set P_S in the start file, or "
            "free it."
        )
        return Check(CHECK, value, "bad", sentence)
    sentence = (
        "the supply valve is never open long enough to fill the chamber, so all that is known is that the supply "
        f"pressure is above {least * 1e-5:.3g} bar; hold the supply valve open for a second at the end of the stroke."
    )
    return Check(CHECK, value, "undetermined", sentence)


def _compared(implied: float, count: int, known: float) -> Check:
    value = f"{implied * 1e-5:.3g} bar ({count} plateau{'' if count == 1 else 's'})"
    facts = f"an open supply valve fills the chamber to {implied * 1e-5:.3g} bar"
    if abs(implied - known) <= TOLERANCE * known:
        return Check(CHECK, value, "good", f"{facts}, the actuator has {known * 1e-5:.3g} bar.")
    grade: Grade = "suspect"
    sentence = (
        f"{facts}, but the actuator has P_S = {known * 1e-5:.3g} bar: a fit with this value attributes the difference "
        f"to the load; set P_S = {implied:.4g} Pa in the start file, or free it."
    )
    return Check(CHECK, value, grade, sentence)


def _plateaus(reading: Reading) -> FloatArray:
    """Pressure in Pa at the end of each interval in which the open supply valve has filled the chamber."""
    p, log = reading.actuator.parameters, reading.log
    first, stop = run_ends((reading.supply >= OPEN) & (reading.exhaust <= 0))
    choked = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0
    # the pressure is also constant while the chamber volume grows: wait until the full volume could have been filled
    fill = p.P_S * (p.V_0A + p.A_A * p.y_max) / choked if choked > 0 else np.inf
    long = np.flatnonzero(log.time[stop - 1] - log.time[first] > fill + END)
    volume = p.V_0A + p.A_A * np.clip(log["position"], 0.0, p.y_max) if "position" in log else None
    found = []
    for i in long[spread_over(long.size)]:
        begin = max(int(first[i]), int(np.searchsorted(log.time, log.time[stop[i] - 1] - END)))
        end = slice(begin, int(stop[i]))
        pressure = log["pressure_a"][end]
        content = pressure * (p.V_0A if volume is None else volume[end])
        known = np.isfinite(content)
        if known.sum() < FEWEST:
            continue
        flow = float(np.polyfit(log.time[end][known] - log.time[begin], content[known], 1)[0])
        if abs(flow) < TRICKLE * choked:
            found.append(float(np.mean(pressure[known])))
    return np.array(found)
