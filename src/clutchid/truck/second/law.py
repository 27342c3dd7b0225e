"""Discrete-time parts of family B: spool, solenoid, opening of the ports, and scale of the position sensor.

Scalar functions of a tick. Their source is copied into the generated module, as with `clutchid.truck.law`.
"""

from __future__ import annotations

import math

#: Steps of spool and armature in a tick of 0.1 ms.
PARTS = 4


def spool(
    x: float, u: float, speed: float, second_order: bool, tau: float, omega: float, zeta: float, tick: float
) -> tuple[float, float]:
    """Position and speed [1/s] of a spool at the end of a tick, commanded to `u`; -1 and 1 are the ends of its travel.

    First order with `tau` in s, or second order with `omega` in rad/s and damping `zeta`; a stop takes all speed.
    """
    if not second_order:
        return u + (x - u) * math.exp(-tick / tau), 0.0
    step = tick / PARTS
    for _ in range(PARTS):
        speed += step * omega * (omega * (u - x) - 2.0 * zeta * speed)
        x += step * speed
        if x > 1.0 or x < -1.0:
            x = min(1.0, max(-1.0, x))
            speed = 0.0
    return x, speed


def port(x: float, overlap: float, exponent: float) -> float:
    """Relative opening of a port, 0 to 1, for a spool that has moved by x towards it; closed within the overlap."""
    return ((x - overlap) / (1.0 - overlap)) ** exponent if x > overlap else 0.0


def solenoid(
    current: float, lift: float, speed: float, energised: bool, tau: float, travel: float, spring: float, tick: float
) -> tuple[float, float, float]:
    """Current, lift and speed [1/s] of an armature at the end of a tick; current and lift are 0 to 1.

    The current follows the voltage within `tau` in s; the force of the magnet, its square, acts against `spring`, the
    share of the largest force that holds the armature closed and grows by half over the lift. `travel` is the time in s
    in which the largest force without spring would open the valve; the stops take all speed.
    """
    target = 1.0 if energised else 0.0
    decay = math.exp(-tick / (PARTS * tau))
    step = tick / PARTS
    for _ in range(PARTS):
        current = target + (current - target) * decay
        speed += step * 2.0 / (travel * travel) * (current * current - spring * (1.0 + 0.5 * lift))
        lift += step * speed
        if lift > 1.0 or lift < 0.0:
            lift = min(1.0, max(0.0, lift))
            speed = 0.0
    return current, lift, speed


def poppet(lift: float) -> float:
    """Relative opening of a seat valve over its lift, both 0 to 1; the seat limits it first, then the orifice."""
    return math.sin(0.5 * math.pi * lift)


def scaled(y: float, rest: float, stroke: float, share: float) -> float:
    """Position in m that a sensor shows at y: its gain varies by +-`share` over the stroke, so its error is a wave."""
    turn = 2.0 * math.pi / stroke
    return y + share / turn * math.sin(turn * (y - rest))
