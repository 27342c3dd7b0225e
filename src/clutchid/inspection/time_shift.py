"""Time shift between command and motion: how much later than in the model the piston moves in the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clutchid.inspection.carrier import on_grid, period
from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading
from clutchid.inspection.strokes import AFTER, level, starts
from clutchid.log import FloatArray

CHECK = "time shift"

#: Strokes that tell a spread.
FEWEST = 3

#: Lag of a position sensor in s, at most.
LAG = 2e-3

#: Part of its period that a switched valve takes at most until it is half open; the usual period in s, 100 Hz.
VALVE, PERIOD = 0.2, 0.01

#: What supply pressure, dead volume, mass and valve, together 30 % beside those of the model, change of the time in
#: which a motion begins: it goes with their third root.
ALIKE = 0.1

#: Longest raster in s that tells: a stroke that begins in 20 ms has one sample.
RASTER = 0.02


@dataclass(frozen=True, slots=True)
class Allowed:
    """Shifts in s that need no explanation: `early` by friction and raster, `late` by valve and sensor as well."""

    early: float
    late: float


def time_shift(reading: Reading) -> Finding:
    """How much later than the simulated piston the measured one moves, over all strokes, with its spread."""
    if not reading.driven or "position" not in reading.measured:
        return Finding(CHECK, "-", "not tellable", "the time shift needs a position and both duty cycles.")
    found = starts(reading)
    seen = np.isfinite(found.measured)
    count, total = int(seen.sum()), found.measured.size
    if total >= FEWEST and 2 * count < total:
        sentence = (
            f"in {total - count} of {total} strokes no motion is seen within {AFTER * 1e3:g} ms of a supply valve that "
            "opens wide: the time axes, the sign or the unit of the position are wrong, and a fit finds no load; check "
            "that the channels belong together."
        )
        return Finding(CHECK, f"no motion in {total - count} of {total} strokes", "bad", sentence)
    if count < FEWEST:
        sentence = (
            f"{count or 'no'} stroke{'' if count == 1 else 's'} from rest with a supply valve that opens wide and a "
            f"motion that is seen: {FEWEST} are needed."
        )
        return Finding(CHECK, "-", "not tellable", sentence)
    late = found.measured[seen] - found.simulated[seen] - reading.actuator.parameters.tau_y
    usual = float(np.median(found.simulated[seen]))
    if reading.raster > RASTER:
        sentence = (
            f"samples every {reading.raster * 1e3:.3g} ms are too slow: in the model a stroke starts within "
            f"{usual * 1e3:.2g} ms of its command."
        )
        return Finding(CHECK, "-", "not tellable", sentence)
    return _judged(reading, late, _allowed(reading, float(np.std(late, ddof=1)), usual))


def _judged(reading: Reading, late: FloatArray, allowed: Allowed) -> Finding:
    """The finding for the shift of each stroke in s and what needs no explanation."""
    shift, spread, count = float(np.median(late)), float(np.std(late, ddof=1)), late.size
    # of a median; strokes that agree better than the raster do so by chance
    error = 2 * 1.25 * max(spread, reading.raster / math.sqrt(12)) / math.sqrt(count)
    value = f"{shift * 1e3:+.1f} ms (spread {spread * 1e3:.1f} ms, {count} strokes)"
    beyond = max(shift - error - allowed.late, -shift - error - allowed.early)
    verdict: Verdict = "good" if beyond <= 0 else "bad" if beyond > allowed.late else "look"
    facts = (
        f"the piston moves {abs(shift) * 1e3:.1f} ms {'later' if shift >= 0 else 'earlier'} than the model does after "
        f"the same command (spread {spread * 1e3:.1f} ms over {count} strokes)"
    )
    if verdict == "good":
        return Finding(CHECK, value, verdict, f"{facts}, which valve and sensor explain.")
    why = (
        f"valve and sensor explain {allowed.late * 1e3:.1f} ms" if shift > 0 else "no valve answers before its command"
    )
    sentence = (
        f"{facts}; {why}: the channels do not share one clock, and a fit takes the shift for friction and load; move "
        f"the position by {-shift * 1e3:+.1f} ms, or give its channel that delay in the channel map."
    )
    return Finding(CHECK, value, verdict, sentence)


def _allowed(reading: Reading, spread: float, usual: float) -> Allowed:
    """Shifts that need no explanation, for strokes with a `spread` in s that `usual`-ly begin after so many s."""
    p = reading.actuator.parameters
    # friction may be twice the model's and the load half as large again: how long an open valve takes to add it
    rise = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / p.V_0A
    load = float(reading.actuator.load.force(np.array([level(reading)]))[0])
    force = math.hypot(p.F_C, load / 2) / p.A_A / rise if rise > 0 else 0.0
    # half a step in the rest and half a step at the level; a motion that grows with the third power of time is at three
    # times its mean speed there
    rounding = reading.quanta["position"] / (3 * level(reading) / usual)
    either = math.hypot(force, reading.raster, rounding, ALIKE * usual)
    valve = 0.0 if p.T_pwm > 0 else VALVE * period(reading, PERIOD) / 2
    lag = 0.0 if p.tau_y else LAG / 2
    wait = 0.0 if on_grid(reading) else math.sqrt(3 * max(0.0, spread**2 - reading.raster**2 / 12))
    return Allowed(either, valve + lag + wait + math.hypot(either, valve, lag))
