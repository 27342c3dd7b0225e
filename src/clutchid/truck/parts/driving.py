"""Driving of the valves: duty cycles latched by the period or bang-bang; or latched or continuous."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from clutchid.truck.parts.part import Driving, Numbers
from clutchid.truck.rows import choice

#: Sampling period in s of the bang-bang drive; its valves are as fast as for PWM at 100 Hz.
_BANG_PERIOD, _BANG_VALVES = 0.002, 0.01

#: Controller output at which the bang-bang drive opens a valve.
_BANG = 0.3


@dataclass(frozen=True, kw_only=True)
class LatchedRows:
    """Latched duty cycles, or a valve that is open or closed for a sampling period."""

    drive: str = choice("pwm", ("pwm", "bang-bang"))


@dataclass(frozen=True, kw_only=True)
class ContinuousRows:
    """Duty cycles that are latched by the period, or follow the controller at every millisecond."""

    duty: str = choice("latched", ("latched", "continuous"))


def tuned(held: float, T: float, base: float, valve: float, tube: float) -> Numbers:
    """Numbers of the controller, which predicts over the times of valve, tube and of a duty cycle that is `held`."""
    return {"L_p": 3e-3 + 0.2 * T, "t_lead": base + 0.6 * held + valve + tube, "e_in": 0.15e-3, "e_out": 0.3e-3}


def _latched(drawn: Mapping[str, Any], *lead: float) -> Numbers:
    if drawn["drive"] == "bang-bang":
        return {"T_pwm": _BANG_PERIOD, "L_p": 3e-3, "t_lead": 0.01, "e_in": 0.8e-3, "e_out": 1e-3}
    return tuned(drawn["T_pwm"], drawn["T_pwm"], *lead)


def _continuous(drawn: Mapping[str, Any], *lead: float) -> Numbers:
    at_once = drawn["duty"] == "continuous" and drawn.get("valve") == "spool"
    return tuned(1e-3 if at_once else drawn["T_pwm"], drawn["T_pwm"], *lead)


def _bang(t: Any) -> Numbers:
    return {"bang_bang": True, "dead_s": _BANG, "dead_e": _BANG} if t.drive == "bang-bang" else {}


LATCHED = Driving(
    name="latched or bang-bang", rows=LatchedRows, shared=("T_pwm",), numbers=_bang,
    prepared=lambda drawn: {**drawn, "T_pwm": _BANG_VALVES} if drawn["drive"] == "bang-bang" else drawn,
    tuned=_latched,
)  # fmt: skip
FREE = Driving(
    name="latched or continuous", rows=ContinuousRows, shared=("T_pwm",),
    numbers=lambda t: {"continuous": t.duty == "continuous"}, tuned=_continuous,
)  # fmt: skip
