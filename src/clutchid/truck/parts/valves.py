"""Valves: on/off magnets with dead times and ramps; or a proportional spool, or solenoids with current and armature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from clutchid.log import FloatArray
from clutchid.truck.parts.part import GUESS, Numbers, Valves
from clutchid.truck.rows import choice, number
from clutchid.truck.settings import MAGNETS, SOLENOIDS, SPOOL

#: Steps of the duty cycle that a proportional valve resolves.
_STEPS = 1000


@dataclass(frozen=True, kw_only=True)
class MagnetRows:
    """Parameters of on/off valves with dead times and ramps."""

    t_1s: float = number(0.7e-3, "s", "supply valve: current until the armature moves", 0, 0.02)
    t_2s: float = number(1.0e-3, "s", "supply valve: opening ramp", 1e-4, 0.02)
    t_3s: float = number(0.8e-3, "s", "supply valve: decay until the armature moves back", 0, 0.02)
    t_4s: float = number(1.2e-3, "s", "supply valve: closing ramp", 1e-4, 0.02)
    t_1e: float = number(0.7e-3, "s", "exhaust valve: current until the armature moves", 0, 0.02)
    t_2e: float = number(1.0e-3, "s", "exhaust valve: opening ramp", 1e-4, 0.02)
    t_3e: float = number(0.8e-3, "s", "exhaust valve: decay until the armature moves back", 0, 0.02)
    t_4e: float = number(1.2e-3, "s", "exhaust valve: closing ramp", 1e-4, 0.02)


@dataclass(frozen=True, kw_only=True)
class ServoRows:
    """Parameters of a proportional spool, or of two solenoids with current and armature."""

    x_0s: float = number(0.08, "1", "spool: overlap towards supply", 0, 0.5, GUESS)
    x_0e: float = number(0.08, "1", "spool: overlap towards exhaust", 0, 0.5, GUESS)
    n_x: float = number(1.2, "1", "spool: exponent of the opening over its travel", 1, 3, GUESS)
    tau_x: float = number(4e-3, "s", "spool of first order: time constant", 1e-4, 0.1, GUESS)
    t_n: float = number(2.5e-3, "s", "spool of second order: inverse of the natural frequency", 1e-4, 0.1, GUESS)
    zeta_x: float = number(0.8, "1", "spool of second order: damping", 0.05, 3, GUESS)
    tau_is: float = number(0.8e-3, "s", "supply solenoid: time constant of the current", 1e-5, 0.02, GUESS)
    t_xs: float = number(1.0e-3, "s", "supply solenoid: time to open without spring", 1e-4, 0.02, GUESS)
    tau_ie: float = number(0.8e-3, "s", "exhaust solenoid: time constant of the current", 1e-5, 0.02, GUESS)
    t_xe: float = number(1.0e-3, "s", "exhaust solenoid: time to open without spring", 1e-4, 0.02, GUESS)
    f_x: float = number(0.35, "1", "solenoids: force of the closing spring over the largest force", 0.05, 0.6, GUESS)
    valve: str = choice("spool", ("spool", "solenoids"))
    spool: str = choice("second-order", ("first-order", "second-order"))


def lifts(_: Any, x: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Lifts of both valves."""
    return {"lift_supply": x["x_s"], "lift_exhaust": x["x_e"]}


def _magnets(t: Any) -> Numbers:
    return {"valve": MAGNETS, **{f"dead_{v}": getattr(t, f"t_1{v}") / t.T_pwm for v in "se"}}


def _servo(t: Any) -> Numbers:
    if t.valve == "spool":
        dead = {"dead_s": t.x_0s, "dead_e": t.x_0e, "timer": 1 / _STEPS}
        return {"valve": SPOOL, "second_order": float(t.spool == "second-order"), **dead}
    return {"valve": SOLENOIDS, **{f"dead_{v}": getattr(t, f"tau_i{v}") / t.T_pwm for v in "se"}}


def _late(drawn: Mapping[str, Any]) -> tuple[float, float]:
    """A later spool; the delay of a solenoid scales with its period."""
    if drawn["valve"] != "spool":
        return 0.004, 1e-3
    return 0.004, drawn["tau_x"] if drawn["spool"] == "first-order" else 1.6 * drawn["t_n"]


ON_OFF = Valves(
    name="magnets", rows=MagnetRows, numbers=_magnets,
    factors={"valves": dict.fromkeys((f"t_{part}{valve}" for valve in "se" for part in (1, 2, 3, 4)), 1.2)}, true=lifts,
    lead=lambda _: (0.007, 0.0),
)  # fmt: skip
SERVO = Valves(
    name="spool or solenoids", rows=ServoRows, numbers=_servo,
    factors={"valves": dict.fromkeys(("tau_x", "t_n", "tau_is", "tau_ie", "t_xs", "t_xe"), 1.2)}, true=lifts,
    lead=_late,
)  # fmt: skip
