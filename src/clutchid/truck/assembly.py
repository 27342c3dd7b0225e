"""A truck from its parts: load, states at rest, numbers of the compiled loop, and columns of the truth."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.truck.load_table import LoadTable, rest_position, travels, with_return_spring
from clutchid.truck.parts.gas import volumes
from clutchid.truck.parts.part import Numbers
from clutchid.truck.settings import SAMPLE, TICK
from clutchid.truck.vehicle import Vehicle


@lru_cache(maxsize=64)
def load_curve(truck: Vehicle) -> LoadTable:
    """Load of a truck at its age.

    Raises
    ------
    ParameterError
        If the load is negative somewhere in the stroke, or a spring snaps through.
    """
    clutch = truck.parts.clutch
    age = clutch.numbers(truck)
    force, touch = clutch.force(truck, travels(truck, age["y_r"]), age)
    return with_return_spring(truck, age["y_r"], force, touch, age["F_r"])


def at_rest(truck: Vehicle, curve: LoadTable, p_S: float | None = None) -> FloatArray:
    """States of a vented truck whose piston rests at the engaged end; `p_S` is the supply pressure, default P_S."""
    t, parts, y = truck, truck.parts, rest_position(truck, curve)
    air = [value for V in volumes(t, y).values() for value in parts.gas.rest(t, t.P_0, V, t.T_0 + t.dT_w)]
    supply = parts.supply.rest(t, t.P_S if p_S is None else p_S)
    moving = [y, 0.0, *air, *supply]
    return np.array(moving + [0.0] * (len(parts.structure.states) - len(moving)))


def worn_parameters(truck: Vehicle) -> Numbers:
    """Parameters that the age of a truck has changed, in SI, and what else its parts derive."""
    return {name: value for part in truck.parts for name, value in part.numbers(truck).items()}


def period_in_ticks(T_pwm: float) -> int:
    """Period of the valves in ticks.

    Raises
    ------
    ParameterError
        If the period is no multiple of the controller's sampling time.
    """
    period = round(T_pwm / TICK)
    if period % round(SAMPLE / TICK):
        raise ParameterError(f"T_pwm = {T_pwm:g} s: must be a multiple of the controller's {SAMPLE:g} s.")
    return period


def numbers(truck: Vehicle, zero: float, working: bool) -> Numbers:
    """All numbers of the compiled loop, at the age of the truck.

    Parameters
    ----------
    zero : m
        Mechanical position at which the position sensor reads 0.
    working : bool
        Whether a compressor runs at the start.
    """
    values = {name: getattr(truck, name) for name in truck.names()}
    period = period_in_ticks(truck.T_pwm)
    values |= {
        "period": period, "timer": 1 / period, "bang_bang": False, "continuous": False, "working": working,
        "T_w": truck.T_0 + truck.dT_w,
    }  # fmt: skip
    return values | {"zero": zero, "rest": zero + truck.e_y} | worn_parameters(truck)


def true_states(truck: Vehicle, x: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Columns of the truth from the states of a run."""
    return {name: values for part in truck.parts for name, values in part.true(truck, x).items()}
