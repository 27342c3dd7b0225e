"""Supply pressure that the data imply: where an open supply valve fills the chamber no further."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.direction import direction
from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.pressure_unit import pressure_unit
from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.signal import stretches
from clutchid.log import FloatArray

CHECK = "supply pressure"

#: Opening from which the supply valve counts as fully open.
OPEN = 0.9

#: Length in s of the end of a stretch that must be flat, and samples in it at least.
END, FEWEST = 0.03, 4

#: Part of the choked flow that may still pass where the chamber is full: the pressure is then within 1 % of the supply.
TRICKLE = 0.05

#: Share by which the supply pressure of a vehicle may lie beside that of the actuator before a fit must know.
BESIDE = 0.02


def supply_pressure(reading: Reading) -> Finding:
    """The plateau of the pressure behind a supply valve that is open for long, or else what it is above."""
    if "pressure_a" not in reading.measured or not reading.driven:
        sentence = "without the chamber's pressure no plateau shows the supply pressure; a fit keeps that of its start."
        return Finding(CHECK, "-", "not tellable", sentence)
    if pressure_unit(reading).verdict != "good" or direction(reading).verdict == "bad":
        sentence = "the unit of the pressure or the sign of the position is wrong, so they tell no supply pressure."
        return Finding(CHECK, "-", "not tellable", sentence)
    plateaus, known = _plateaus(reading), reading.actuator.parameters.P_S
    if plateaus.size:
        return _judged(float(np.median(plateaus)), plateaus.size, known)
    # noise alone lifts one of a thousand samples by three standard deviations
    pressure = reading.log["pressure_a"]
    least = float(np.nanquantile(pressure, 0.999)) - 3 * float(np.nan_to_num(reading.noises["pressure_a"]))
    value = f"at least {least * 1e-5:.3g} bar"
    if least > (1 + BESIDE) * known:
        sentence = (
            f"the chamber reaches {least * 1e-5:.3g} bar, more than the supply pressure of the actuator, "
            f"{known * 1e-5:.3g} bar: a fit takes too little air for a weak load; set P_S in the start file, or "
            "free it."
        )
        return Finding(CHECK, value, "bad", sentence)
    sentence = (
        "no supply valve is open long enough to fill the chamber, so the supply pressure is above "
        f"{least * 1e-5:.3g} bar and no more is known; hold the supply valve open for a second at the "
        "end of the stroke."
    )
    return Finding(CHECK, value, "not tellable", sentence)


def _judged(implied: float, count: int, known: float) -> Finding:
    value = f"{implied * 1e-5:.3g} bar ({count} plateau{'' if count == 1 else 's'})"
    facts = f"an open supply valve fills the chamber to {implied * 1e-5:.3g} bar"
    if abs(implied - known) <= BESIDE * known:
        return Finding(CHECK, value, "good", f"{facts}, the actuator has {known * 1e-5:.3g} bar.")
    verdict: Verdict = "look"
    sentence = (
        f"{facts}, but the actuator has P_S = {known * 1e-5:.3g} bar: a fit that keeps it takes the difference for "
        f"load; set P_S = {implied:.4g} Pa in the start file, or free it."
    )
    return Finding(CHECK, value, verdict, sentence)


def _plateaus(reading: Reading) -> FloatArray:
    """Pressure at the end of each stretch with an open supply valve that fills the chamber no further, in Pa."""
    p, log = reading.actuator.parameters, reading.log
    first, stop = stretches((reading.supply >= OPEN) & (reading.exhaust <= 0))
    choked = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0
    # a chamber that still grows holds its pressure too: wait until all of it could have been filled
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
