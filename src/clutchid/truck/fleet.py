"""Truck types: each number seeds a draw from the ranges in ``ranges.toml``."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.truck.parameters import Truck

#: The versioned file with the ranges.
RANGES = Path(__file__).parent / "ranges.toml"

#: Sampling period in s of the bang-bang drive; its valves are as fast as for PWM at 100 Hz.
BANG_PERIOD, BANG_VALVES = 0.002, 0.01


def truck(number: int) -> Truck:
    """Truck type `number`, new; the same number is always the same truck.

    Raises
    ------
    ParameterError
        If `number` is not an integer of at least 0.

    Examples
    --------
    >>> truck(7) == truck(7), truck(7) == truck(8)
    (True, False)
    """
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < 0:
        raise ParameterError(f"truck {number}: truck types are numbered 0, 1, 2, ...")
    table = ranges()
    rng = np.random.default_rng([table["version"], int(number)])
    drawn: dict[str, Any] = {name: values[rng.integers(len(values))] for name, values in table["choice"].items()}
    drawn |= {name: float(rng.uniform(low, high)) for name, (low, high) in table["uniform"].items()}
    if drawn["drive"] == "bang-bang":
        drawn["T_pwm"] = BANG_VALVES
    for name, (base, low, high) in table["share"].items():
        drawn[name] = drawn[base] * float(rng.uniform(low, high))
    return Truck(**(drawn | tuning(drawn["T_pwm"], drawn["drive"])))


@cache
def ranges() -> dict[str, Any]:
    """Content of the file with the ranges."""
    return tomllib.loads(RANGES.read_text(encoding="utf-8"))


def tuning(T_pwm: float, drive: str) -> dict[str, float]:
    """Parameters of the controller for a period of the valves; a longer period needs a longer prediction time."""
    if drive == "bang-bang":
        return {"T_pwm": BANG_PERIOD, "L_p": 3e-3, "t_lead": 0.01, "e_in": 0.8e-3, "e_out": 1e-3}
    return {"T_pwm": T_pwm, "L_p": 3e-3 + 0.2 * T_pwm, "t_lead": 0.007 + 0.6 * T_pwm, "e_in": 0.15e-3, "e_out": 0.3e-3}
