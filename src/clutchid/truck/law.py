"""Discrete-time parts of the truck: valves, governor, sensors and controller; scalar functions, compiled."""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.truck.settings import SAMPLE, TICK_PARTS

#: Velocity in m/s below which the controller may close both valves.
_SLOW = 0.02
#: Set point in m below which the clutch is engaged and the chamber vented.
_ENGAGED = 1e-4
#: Time in s for which the exhaust stays open after the piston has returned.
_VENTING = 0.4


@kernel
def magnet(flux: float, energised: bool, t_pull: float, t_drop: float, tick: float) -> float:
    """Magnetic flux at the end of a tick, 0 to 1: it rises within `t_pull` and decays within `t_drop`."""
    if energised:
        return min(1.0, flux + tick / t_pull) if t_pull > 0.5 * tick else 1.0
    return max(0.0, flux - tick / t_drop) if t_drop > 0.5 * tick else 0.0


@kernel
def lift_rate(flux: float, energised: bool, lift: float, t_open: float, t_close: float, tick: float) -> float:
    """Rate of a valve's lift over a tick in 1/s: it opens at full flux, closes without flux, and stays in between."""
    if energised and flux > 1.0 - 1e-6:
        return min(1.0 / t_open, (1.0 - lift) / tick)
    if not energised and flux < 1e-6:
        return -min(1.0 / t_close, lift / tick)
    return 0.0


@kernel
def snapped(lift: float) -> float:
    """A lift without the rounding errors of its ramp: exactly 0 or 1 at the ends."""
    if lift < 1e-9:
        return 0.0
    return 1.0 if lift > 1.0 - 1e-9 else lift


@kernel
def governor(working: bool, p_G: float, P_S: float, dP_G: float) -> bool:
    """Whether the compressor runs: on-off control with hysteresis between the ends of the saw-tooth."""
    if p_G <= P_S - dP_G:
        return True
    return working and p_G < P_S + dP_G


@kernel
def quantised(value: float, quantum: float) -> float:
    """`value` rounded to multiples of `quantum`."""
    return quantum * math.floor(value / quantum + 0.5) if quantum > 0.0 else value


@kernel
def lag_output(out: float, before: float, now: float, tau: float, tick: float) -> float:
    """First-order lag over one tick with a linear input from `before` to `now`; exact."""
    if tau <= 0.0:
        return now
    x = tick / tau
    decay = math.exp(-x)
    ramp = 1.0 - (1.0 - decay) / x
    return out * decay + before * (1.0 - decay - ramp) + now * ramp


@kernel
def request(
    wanted: float, y: float, v: float, holding: bool, venting: float, band: float, lead: float, e_in: float,
    e_out: float,
) -> tuple[float, bool, float]:  # fmt: skip
    """Controller output to the valves, -1 (exhaust open) to 1 (supply open), from filtered measurements.

    It acts on the predicted error at the time when the valves respond, closes both valves inside a dead band with
    hysteresis, and vents the chamber if the clutch is to be engaged.

    Parameters
    ----------
    wanted, y, v
        Set point and filtered position in m, filtered velocity in m/s.
    holding, venting
        State of the controller: whether it holds, and remaining venting time in s.
    band, lead, e_in, e_out
        Error at full opening in m, prediction time in s, dead band in m.
    """
    if wanted < _ENGAGED:
        left = _VENTING if y > 0.5e-3 else venting - SAMPLE
        return (-1.0 if left > 0.0 else 0.0), False, max(left, 0.0)
    error = wanted - y - lead * v
    quiet = abs(error) < e_in and abs(v) < _SLOW
    if (holding or quiet) and abs(wanted - y) < e_out:
        return 0.0, True, 0.0
    return min(1.0, max(-1.0, error / band)), False, 0.0


@kernel
def duty(ask: float, dead: float, bang_bang: bool, timer: float) -> float:
    """Duty cycle of a valve for a request of 0 to 1: above its dead zone, in steps of the timer, or on-off."""
    if ask <= 0.0:
        return 0.0
    if bang_bang:
        return 1.0 if ask >= dead else 0.0
    return min(1.0, timer * math.floor((dead + (1.0 - dead) * ask) / timer + 0.5))


@kernel
def spool(
    x: float, u: float, speed: float, second_order: bool, tau: float, omega: float, zeta: float, tick: float
) -> tuple[float, float]:
    """Position and speed [1/s] of a spool at the end of a tick, commanded to `u`; -1 and 1 are the ends of its travel.

    First order with `tau` in s, or second order with `omega` in rad/s and damping `zeta`; a stop takes all speed.
    """
    if not second_order:
        return u + (x - u) * math.exp(-tick / tau), 0.0
    step = tick / TICK_PARTS
    for _ in range(TICK_PARTS):
        speed += step * omega * (omega * (u - x) - 2.0 * zeta * speed)
        x += step * speed
        if x > 1.0 or x < -1.0:
            x = min(1.0, max(-1.0, x))
            speed = 0.0
    return x, speed


@kernel
def port(x: float, overlap: float, exponent: float) -> float:
    """Relative opening of a port, 0 to 1, for a spool that has moved by x towards it; closed within the overlap."""
    return ((x - overlap) / (1.0 - overlap)) ** exponent if x > overlap else 0.0


@kernel
def solenoid(
    current: float, lift: float, speed: float, energised: bool, tau: float, travel: float, spring: float, tick: float
) -> tuple[float, float, float]:
    """Current, lift and speed [1/s] of an armature at the end of a tick; current and lift are 0 to 1.

    The current follows the voltage within `tau` in s; the force of the magnet, its square, acts against `spring`, the
    share of the largest force that holds the armature closed and grows by half over the lift. `travel` is the time in s
    in which the largest force without spring would open the valve; the stops take all speed.
    """
    target = 1.0 if energised else 0.0
    decay = math.exp(-tick / (TICK_PARTS * tau))
    step = tick / TICK_PARTS
    for _ in range(TICK_PARTS):
        current = target + (current - target) * decay
        speed += step * 2.0 / (travel * travel) * (current * current - spring * (1.0 + 0.5 * lift))
        lift += step * speed
        if lift > 1.0 or lift < 0.0:
            lift = min(1.0, max(0.0, lift))
            speed = 0.0
    return current, lift, speed


@kernel
def poppet(lift: float) -> float:
    """Relative opening of a seat valve over its lift, both 0 to 1; the seat limits it first, then the orifice."""
    return math.sin(0.5 * math.pi * lift)


@kernel
def sensor_position(y: float, rest: float, stroke: float, share: float) -> float:
    """Position in m that a sensor shows at y: its gain varies by +-`share` over the stroke, so its error is a wave."""
    turn = 2.0 * math.pi / stroke
    return y + share / turn * math.sin(turn * (y - rest))
