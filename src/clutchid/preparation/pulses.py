"""Pulses of the valves in a recording: phase of the carrier, and a time grid that resolves it.

A recording slower than the pulses, such as that of a bus at 100 Hz, still contains the duty cycle of each period, and
its positions determine the load as well as ten times more samples do. It is therefore resampled on a finer time grid,
on which the duty cycles change at the start of a period and the position is missing between the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.preparation.carrier import MAX_DURATION, centred, find_carrier
from clutchid.signals.duty_cycle import grid_phase, on_off, resolves_carrier
from clutchid.simulation import Partition
from clutchid.simulation.plan import plan
from clutchid.simulation.run import KernelArrays, run, start_state
from clutchid.simulation.sensors import without_sensors
from clutchid.simulation.stiffness import stiffness
from clutchid.uncertainty.coordinates import WIDTHS

#: Shortest carrier period in samples whose duty cycles are all recorded, and the time grid in s for the simulation of
#: pulses: on a grid of 1 ms the duty cycles change half a millisecond late, an error of several percent of the load.
MIN_PERIOD, FINE_STEP = 0.95, 2.5e-4

#: Standard deviation in s of the time stamps of a slow recording: messages on the bus wait for each other.
STAMP_STD = 1e-3

#: Interval in s between resets in the simulations that determine the phase.
RESET_INTERVAL = 0.02


#: Estimates the phase of the carrier of an actuator in a recording with position alone.
FindPhase = Callable[[Log, Actuator], float]


@dataclass(frozen=True, slots=True, eq=False)
class Pulsed:
    """A recording on a time grid that resolves the pulses, if possible, and the actuator with the phase in it.

    `phase_std` is the standard deviation of the phase, 0 if it is known exactly; `warning` is given if the recording is
    too slow.
    """

    log: Log
    actuator: Actuator
    phase_std: float = 0.0
    warning: str | None = None


def find_phase(log: Log, actuator: Actuator) -> float:
    """Phase of a carrier of known period in a recording with position alone: the one that predicts the motion best.

    Each phase is tried in a simulation of the calibrated actuator with a reset to the measured position every 20 ms.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    p, step = actuator.parameters, float(np.median(np.diff(log.time)))
    part, rate = log.slice(0, min(len(log), round(MAX_DURATION / step))), stiffness(actuator)
    slow = not resolves_carrier(log, p.T_pwm)
    part = part.with_columns(position=part["position"] - p.e_y) if slow else without_sensors(part, p)
    every = Partition(every=max(2, round(RESET_INTERVAL / (FINE_STEP if slow else step))))

    def misfit(phase: float) -> float:
        # compensate the lag of the sensor, which acts like another phase
        compared = resampled(part, p.T_pwm, phase, p.tau_y) if slow else part
        candidate = actuator.replace({"s_pwm": centred(phase + p.tau_y / p.T_pwm if slow else phase)})
        total = 0.0
        for segment in plan(compared, candidate, rate, every).segments:
            states, _ = run(segment, KernelArrays.of(candidate), start_state(segment, candidate))
            error = states[:, 0] - compared["position"][segment.start : segment.stop]
            total += float(np.nansum(np.minimum(np.abs(error), 1e-3) ** 2))
        return total

    coarse = np.arange(10) / 10
    best = float(coarse[int(np.argmin([misfit(phase) for phase in coarse]))])
    fine = best + np.arange(-4, 5) / 50
    return centred(float(fine[int(np.argmin([misfit(phase) for phase in fine]))]))


def pulsed(log: Log, actuator: Actuator, with_pressure: bool, find: FindPhase = find_phase) -> Pulsed:
    """The recording with the pulses of the valves of a calibrated `actuator`.

    `find` estimates the phase where neither the duty cycles nor the pressure show it.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is estimated from.
    """
    period = actuator.parameters.T_pwm
    if period == 0.0 or len(log) < 2:
        return Pulsed(log, actuator)
    if not resolves_carrier(log, period):
        return _resampled_pulses(log, actuator, find)
    if (grid := grid_phase(log, period)) is not None:
        return Pulsed(log, actuator.replace({"s_pwm": centred(grid)}))
    if with_pressure:
        _, phase = find_carrier(log, actuator, (period,))
        phase = centred(phase - actuator.parameters.tau_p / period)
    else:
        phase = find(log, actuator)
    return Pulsed(log, actuator.replace({"s_pwm": phase}), WIDTHS["s_pwm"])


def _resampled_pulses(log: Log, actuator: Actuator, find: FindPhase) -> Pulsed:
    """A recording slower than the pulses, resampled if the duty cycle of each period is known."""
    period, step = actuator.parameters.T_pwm, float(np.median(np.diff(log.time)))
    if period < MIN_PERIOD * step or on_off(log):
        warning = f"{log.name}: a sample every {step * 1e3:.3g} ms does not resolve the pulses of valves with a "
        warning += (
            f"carrier period of {period * 1e3:.3g} ms; they are averaged, which can cause large errors of the load. "
        )
        warning += "Record at 1 kHz."
        return Pulsed(log, actuator, warning=warning)
    phase = find(log, actuator)
    return Pulsed(
        resampled(log, period, phase), actuator.replace({"s_pwm": phase}), max(WIDTHS["s_pwm"], STAMP_STD / period)
    )


def resampled(log: Log, period: float, phase: float, delay: float = 0.0) -> Log:
    """`log` with additional samples at about `FINE_STEP` s, at which only the duty cycles are known.

    Parameters
    ----------
    log : Log
        Its samples are kept with their time stamps.
    period : s
        Of the carrier, at least `MIN_PERIOD` samples.
    phase : 1
        Of the carrier relative to the time stamps. Each period has the duty cycle that was recorded last, or that of
        the period before.
    delay : s
        Of the duty cycles, to match a position that was recorded late.
    """
    gaps = np.diff(log.time)
    step = float(np.median(gaps))
    parts = np.where(gaps <= HOLE * step, max(1, round(step / FINE_STEP)), 1)
    first = np.concatenate([[0], np.cumsum(parts)])
    of = np.repeat(np.arange(gaps.size), parts)
    time = np.append(log.time[of] + gaps[of] * (np.arange(first[-1]) - first[of]) / parts[of], log.time[-1])
    numbers = _period_number(log.time, period, phase)
    latched = np.searchsorted(numbers, _period_number(time - delay, period, phase), side="right") - 1
    columns = {}
    for name, values in log.columns.items():
        if name in INPUTS:
            columns[name] = values[np.maximum(latched, 0)]
        else:
            columns[name] = np.full(time.size, np.nan)
            columns[name][first] = values
    return Log(time, columns, log.name, log.metadata)


def pulsed_without_sensors(log: Log, actuator: Actuator) -> Pulsed:
    """The recording as by `pulsed`, corrected for lags and offsets of the sensors: the motion of the actuator itself.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is estimated from.
    """
    # the phase is estimated from the position, which is always recorded
    pulsed_log = pulsed(log, actuator, False)
    p = pulsed_log.actuator.parameters
    moved = without_sensors(log, p)
    return replace(pulsed_log, log=moved if len(pulsed_log.log) == len(log) else resampled(moved, p.T_pwm, p.s_pwm))


def _period_number(time: FloatArray, period: float, phase: float) -> FloatArray:
    """Number of the carrier period at each time stamp."""
    number: FloatArray = np.floor(time / period - phase + 1e-9)
    return number
