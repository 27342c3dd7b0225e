"""Time shift between command and motion: delay of the measured motion relative to the model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clutchid.inspection.carrier import on_grid, period
from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading
from clutchid.inspection.strokes import AFTER, level, starts
from clutchid.log import FloatArray

CHECK = "time shift"

#: Least number of strokes for a standard deviation.
FEWEST = 3

#: Largest lag of a position sensor in s.
LAG = 2e-3

#: Largest delay of a switched valve until it is half open, as a fraction of its period; usual period in s, 100 Hz.
VALVE, PERIOD = 0.2, 0.01

#: Relative change of the start delay if supply pressure, dead volume, mass and valve together differ by 30 % from the
#: model: it depends on their third root.
ALIKE = 0.1

#: Longest usable interval between values in s: a stroke that starts within 20 ms has one sample then.
LONGEST_INTERVAL = 0.02


@dataclass(frozen=True, slots=True)
class Allowed:
    """Plausible shifts in s: `early` from friction and sampling, `late` also from valve and sensor."""

    early: float
    late: float


def time_shift(reading: Reading) -> Check:
    """Delay of the measured motion relative to the simulated one over all strokes, with its standard deviation."""
    if not reading.driven or "position" not in reading.measured:
        return Check(CHECK, "-", "undetermined", "the time shift check needs a position and both duty cycles.")
    found = starts(reading)
    moved = np.isfinite(found.measured)
    count, total = int(moved.sum()), found.measured.size
    if total >= FEWEST and 2 * count < total:
        sentence = (
            f"in {total - count} of {total} strokes the piston does not move within {AFTER * 1e3:g} ms after the "
            "supply valve opens fully: the time axes, the sign or the unit of the position are wrong, so a fit cannot "
            "estimate the load; check that the channels belong together."
        )
        return Check(CHECK, f"no motion in {total - count} of {total} strokes", "bad", sentence)
    if count < FEWEST:
        sentence = (
            f"{count or 'no'} stroke{'' if count == 1 else 's'} from rest with a fully opened supply valve and motion: "
            f"{FEWEST} are needed."
        )
        return Check(CHECK, "-", "undetermined", sentence)
    late = found.measured[moved] - found.simulated[moved] - reading.actuator.parameters.tau_y
    usual = float(np.median(found.simulated[moved]))
    if reading.update_interval > LONGEST_INTERVAL:
        sentence = (
            f"the interval of {reading.update_interval * 1e3:.3g} ms between samples is too long: in the model a "
            f"stroke starts within {usual * 1e3:.2g} ms of its command."
        )
        return Check(CHECK, "-", "undetermined", sentence)
    return _compared(reading, late, _allowed(reading, float(np.std(late, ddof=1)), usual))


def _compared(reading: Reading, late: FloatArray, allowed: Allowed) -> Check:
    """Compare the shift of each stroke in s with the plausible ones."""
    shift, spread, count = float(np.median(late)), float(np.std(late, ddof=1)), late.size
    # standard error of a median; agreement below the sampling interval is by chance
    error = 2 * 1.25 * max(spread, reading.update_interval / math.sqrt(12)) / math.sqrt(count)
    value = f"{shift * 1e3:+.1f} ms (spread {spread * 1e3:.1f} ms, {count} strokes)"
    beyond = max(shift - error - allowed.late, -shift - error - allowed.early)
    grade: Grade = "good" if beyond <= 0 else "bad" if beyond > allowed.late else "suspect"
    facts = (
        f"the piston moves {abs(shift) * 1e3:.1f} ms {'later' if shift >= 0 else 'earlier'} than in the model after "
        f"the same command (standard deviation {spread * 1e3:.1f} ms over {count} strokes)"
    )
    if grade == "good":
        return Check(CHECK, value, grade, f"{facts}; valve and sensor explain that.")
    why = f"valve and sensor explain {allowed.late * 1e3:.1f} ms" if shift > 0 else "no valve opens before its command"
    sentence = (
        f"{facts}; {why}: the channels do not share one clock, and a fit attributes the shift to friction and load; "
        f"move the position by {-shift * 1e3:+.1f} ms, or give its channel that delay in the channel map."
    )
    return Check(CHECK, value, grade, sentence)


def _allowed(reading: Reading, spread: float, usual: float) -> Allowed:
    """Plausible shifts, for strokes with a standard deviation `spread` and a usual delay `usual`, both in s."""
    p = reading.actuator.parameters
    # friction may be twice that of the model and the load 50 % larger: time of an open valve to supply that force
    rise = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / p.V_0A
    load = float(reading.actuator.load.force(np.array([level(reading)]))[0])
    force = math.hypot(p.F_C, load / 2) / p.A_A / rise if rise > 0 else 0.0
    # half a step in the rest and half a step at the level; a motion that grows with the third power of time is at three
    # times its mean speed there
    rounding = reading.quanta["position"] / (3 * level(reading) / usual)
    either = math.hypot(force, reading.update_interval, rounding, ALIKE * usual)
    valve = 0.0 if p.T_pwm > 0 else VALVE * period(reading, PERIOD) / 2
    lag = 0.0 if p.tau_y else LAG / 2
    wait = 0.0 if on_grid(reading) else math.sqrt(3 * max(0.0, spread**2 - reading.update_interval**2 / 12))
    return Allowed(either, valve + lag + wait + math.hypot(either, valve, lag))
