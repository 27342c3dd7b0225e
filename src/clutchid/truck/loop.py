"""The closed loop of valves, plant, sensors and controller, compiled once for all plants."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.truck.law import (
    duty,
    governor,
    lag_output,
    lift_rate,
    magnet,
    poppet,
    port,
    quantised,
    request,
    sensor_position,
    snapped,
    solenoid,
    spool,
)
from clutchid.truck.settings import (
    FILTER_V,
    FILTER_Y,
    MAGNETS,
    SAMPLE,
    SPOOL,
    TICK,
    TICKS,
    Course,
    Plant,
    RunOutputs,
    Settings,
)

Pair: TypeAlias = tuple[float, float]


@kernel
def shown_position(y: float, s: Settings) -> float:
    """Position in m that the sensor shows before its lag."""
    return sensor_position(y, s.rest, s.y_max, s.e_lin) if s.e_lin != 0.0 else y


@kernel
def chamber_pressure(x: FloatArray, energy: bool, s: Settings) -> float:
    """Pressure in chamber A in Pa; its state is the fourth, the pressure itself or with `energy` that of the air."""
    state: float = x[3]
    return (s.gamma - 1.0) * state / (s.V_0A + s.A_A * x[0]) if energy else state


@kernel
def move_magnets(valves: FloatArray, on_s: bool, on_e: bool, lift_s: float, lift_e: float, s: Settings) -> Pair:
    """Rates of both lifts in 1/s over a tick; `valves` are the fluxes."""
    rate_s = lift_rate(valves[0], on_s, lift_s, s.t_2s, s.t_4s, TICK)
    rate_e = lift_rate(valves[1], on_e, lift_e, s.t_2e, s.t_4e, TICK)
    valves[0] = magnet(valves[0], on_s, s.t_1s, s.t_3s, TICK)
    valves[1] = magnet(valves[1], on_e, s.t_1e, s.t_3e, TICK)
    return rate_s, rate_e


@kernel
def move_spool(valves: FloatArray, u: float, lift_s: float, lift_e: float, s: Settings) -> Pair:
    """Rates of both openings in 1/s over a tick; `valves` are the position and the speed of the spool."""
    second_order = s.second_order > 0.0
    valves[0], valves[1] = spool(
        valves[0], u, valves[1], second_order, s.tau_x, 1.0 / s.t_n, s.zeta_x, TICK
    )  # fmt: skip
    opened_s, opened_e = port(valves[0], s.x_0s, s.n_x), port(-valves[0], s.x_0e, s.n_x)
    return (opened_s - lift_s) / TICK, (opened_e - lift_e) / TICK


@kernel
def move_solenoids(valves: FloatArray, on_s: bool, on_e: bool, lift_s: float, lift_e: float, s: Settings) -> Pair:
    """Rates of both openings in 1/s over a tick; `valves` are current, lift and speed of both armatures."""
    valves[0], valves[1], valves[2] = solenoid(
        valves[0], valves[1], valves[2], on_s, s.tau_is, s.t_xs, s.f_x, TICK
    )  # fmt: skip
    valves[3], valves[4], valves[5] = solenoid(
        valves[3], valves[4], valves[5], on_e, s.tau_ie, s.t_xe, s.f_x, TICK
    )  # fmt: skip
    return (poppet(valves[1]) - lift_s) / TICK, (poppet(valves[4]) - lift_e) / TICK


@kernel
def store_states(x: FloatArray, states: FloatArray, k: int) -> bool:
    """Write the states at sample k; whether they are finite."""
    total = 0.0
    for i in range(x.size):
        states[k, i] = x[i]
        total += x[i]
    return -1e300 < total < 1e300


@kernel
def drive(begin: Any, move: Any, plant: Plant, s: Settings, course: Course, outputs: RunOutputs) -> int:
    """Drive from the states of the plant; returns the sample at which one is not finite, or -1.

    The plant's kernels are ``begin(p, work)`` and ``move(x, u, p, h, substeps, breakpoints, load, work)``.
    """
    x, p, work, breakpoints, load, energy, x_s, p_G, substeps = plant
    wanted, forced, noise, stuck, _ = course
    states, measured, pressures, duties = outputs
    x_e = x_s + 1
    begin(p, work)
    u, valves = np.zeros(3), np.zeros(6)
    h, period = TICK / substeps, int(s.period)
    bang_bang, working = s.bang_bang > 0.0, s.working > 0.0
    duty_s = duty_e = venting = reading = filtered = speed = 0.0
    on_s = on_e = phase = 0
    holding = False
    sensed_y, sensed_p = shown_position(x[0], s), chamber_pressure(x, energy, s)
    for k in range(wanted.size):
        if not store_states(x, states, k):
            return k
        if not stuck[0] <= k < stuck[1]:
            reading = quantised(sensed_y - s.zero + noise[k], s.q_y)
        measured[k], pressures[k] = reading, sensed_p
        before = filtered
        filtered += (reading - filtered) * SAMPLE / (FILTER_Y + SAMPLE)
        speed += ((filtered - before) / SAMPLE - speed) * SAMPLE / (FILTER_V + SAMPLE)
        ask, holding, venting = request(
            wanted[k], filtered, speed, holding, venting, s.L_p, s.t_lead, s.e_in, s.e_out
        )  # fmt: skip
        if phase == 0 or s.continuous > 0.0:
            duty_s, duty_e = forced[k, 0], forced[k, 1]
            if not duty_s >= 0.0:
                duty_s, duty_e = duty(ask, s.dead_s, bang_bang, s.timer), duty(-ask, s.dead_e, bang_bang, s.timer)
            on_s, on_e = math.floor(duty_s * period + 0.5), math.floor(duty_e * period + 0.5)
        duties[k, 0], duties[k, 1] = duty_s, duty_e
        if k == wanted.size - 1:
            break
        if p_G >= 0:
            working = governor(working, x[p_G], s.P_S, s.dP_G)
            u[2] = s.r_up if working else -s.r_down
        for _ in range(TICKS):
            if s.valve == MAGNETS:
                u[0], u[1] = move_magnets(valves, phase < on_s, phase < on_e, x[x_s], x[x_e], s)
            elif s.valve == SPOOL:
                u[0], u[1] = move_spool(valves, duty_s - duty_e, x[x_s], x[x_e], s)
            else:
                u[0], u[1] = move_solenoids(valves, phase < on_s, phase < on_e, x[x_s], x[x_e], s)
            before = shown_position(x[0], s)
            move(x, u, p, h, substeps, breakpoints, load, work)
            x[x_s], x[x_e] = snapped(x[x_s]), snapped(x[x_e])
            sensed_y = lag_output(sensed_y, before, shown_position(x[0], s), s.tau_y, TICK)
            pressure = chamber_pressure(x, energy, s)
            sensed_p = lag_output(sensed_p, pressure, pressure, s.tau_p, TICK)
            phase = (phase + 1) % period
    return -1
