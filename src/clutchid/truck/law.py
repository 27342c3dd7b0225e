"""What runs beside the plant on a clock: the magnets of the valves, the governor, the sensor and the controller.

Plain functions of numbers. Their source is copied into the generated module and compiled with the plant, so they use
nothing but arithmetic and `math`; tests call them as they stand here.
"""

from __future__ import annotations

import math

#: Clock of valves and integration, and clock of sensor, controller and recording, in s.
TICK, SAMPLE = 1e-4, 1e-3
#: Ticks in a sample.
TICKS = 10

#: Time constants of the controller's filters for position and velocity, in s.
FILTER_Y, FILTER_V = 0.002, 0.005
#: Velocity below which the controller may hold, in m/s.
SLOW = 0.02
#: Wanted position below which the clutch is meant to be engaged and the chamber is vented, in m.
ENGAGED = 1e-4
#: How long the exhaust stays open after the piston is back, in s.
VENTING = 0.4


def magnet(flux: float, energised: bool, t_pull: float, t_drop: float, tick: float) -> float:
    """Magnetic flux at the end of a tick, 0 to 1: it rises within `t_pull` and decays within `t_drop`."""
    if energised:
        return min(1.0, flux + tick / t_pull) if t_pull > 0.5 * tick else 1.0
    return max(0.0, flux - tick / t_drop) if t_drop > 0.5 * tick else 0.0


def lift_rate(flux: float, energised: bool, lift: float, t_open: float, t_close: float, tick: float) -> float:
    """Rate of a valve's lift over a tick in 1/s: it opens with full flux, closes without, and rests in between."""
    if energised and flux > 1.0 - 1e-6:
        return min(1.0 / t_open, (1.0 - lift) / tick)
    if not energised and flux < 1e-6:
        return -min(1.0 / t_close, lift / tick)
    return 0.0


def settled(lift: float) -> float:
    """A lift without the rounding of its ramp: exactly 0 or 1 at the ends."""
    if lift < 1e-9:
        return 0.0
    return 1.0 if lift > 1.0 - 1e-9 else lift


def governor(working: bool, p_G: float, P_S: float, dP_G: float) -> bool:
    """Whether the compressor works: it starts at the lower end of the saw-tooth and stops at the upper one."""
    if p_G <= P_S - dP_G:
        return True
    return working and p_G < P_S + dP_G


def quantised(value: float, quantum: float) -> float:
    """`value` as the converter gives it."""
    return quantum * math.floor(value / quantum + 0.5) if quantum > 0.0 else value


def lagged(out: float, before: float, now: float, tau: float, tick: float) -> float:
    """First-order lag over a tick in which its input goes straight from `before` to `now`; exact."""
    if tau <= 0.0:
        return now
    x = tick / tau
    decay = math.exp(-x)
    ramp = 1.0 - (1.0 - decay) / x
    return out * decay + before * (1.0 - decay - ramp) + now * ramp


def request(
    wanted: float,
    y: float,
    v: float,
    holding: bool,
    venting: float,
    band: float,
    lead: float,
    e_in: float,
    e_out: float,
) -> tuple[float, bool, float]:
    """What the controller asks of the valves, -1 (exhaust open) to 1 (supply open), from filtered measurements.

    It acts on the error that will be left when the valves answer, holds inside a dead band with hysteresis, and vents
    the chamber when the clutch is meant to be engaged.

    Parameters
    ----------
    wanted, y, v
        Wanted and filtered position in m, filtered velocity in m/s.
    holding, venting
        Memory: whether it holds, and for how many seconds more it vents.
    band, lead, e_in, e_out
        Error at full opening in m, look-ahead in s, dead band in m.
    """
    if wanted < ENGAGED:
        left = VENTING if y > 0.5e-3 else venting - SAMPLE
        return (-1.0 if left > 0.0 else 0.0), False, max(left, 0.0)
    error = wanted - y - lead * v
    quiet = abs(error) < e_in and abs(v) < SLOW
    if (holding or quiet) and abs(wanted - y) < e_out:
        return 0.0, True, 0.0
    return min(1.0, max(-1.0, error / band)), False, 0.0


def duty(ask: float, dead: float, bang_bang: bool, timer: float) -> float:
    """Duty cycle of a valve for a request of 0 to 1: past its dead zone, in steps of the timer, or on and off."""
    if ask <= 0.0:
        return 0.0
    if bang_bang:
        return 1.0 if ask >= dead else 0.0
    return min(1.0, timer * math.floor((dead + (1.0 - dead) * ask) / timer + 0.5))
