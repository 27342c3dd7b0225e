"""Pulses of the valves in a recording: phase of the carrier, and a time grid that resolves it.

A recording slower than the changes of the duty cycles, such as that of a bus at 100 Hz, is put on a finer time grid, on
which the position is missing between the samples; its positions determine the load as well as ten times more samples
do. Where the control unit renews the duty cycles once a period, each period has its own; otherwise they are
interpolated, and what the recording does not show of them is process noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.preparation.carrier import MAX_DURATION, centred, find_carrier
from clutchid.preparation.time_grid import in_clock, interpolated, latched
from clutchid.recordings.signals.duty_cycle import grid_phase, is_slow, on_off, resolves_carrier
from clutchid.simulation import Partition
from clutchid.simulation.plan import plan
from clutchid.simulation.run import KernelArrays, run, start_state
from clutchid.simulation.sensors import without_sensors
from clutchid.simulation.stiffness import stiffness

#: Shortest period in samples with duty cycles of its own: in a sample of 10 ms the middle of a period of 2 ms is known
#: to 1 ms, as are the time stamps.
MIN_PERIOD = 0.4

#: Shortest period in samples whose duty cycles are all recorded: clocks differ.
EACH_PERIOD = 0.95

#: Time grid in s of a slow recording: that of a calibration at 1 kHz, in whose intervals pulses count as their means.
GRID_STEP = 1e-3

#: Interval in s for which a control unit holds duty cycles that change continuously.
CONTROL_STEP = 1e-3

#: Standard deviation in s of the time stamps of a slow recording: messages on the bus wait for each other.
STAMP_STD = 1e-3

#: Interval in s between resets in the simulations that determine the phase.
RESET_INTERVAL = 0.02


#: Estimates the phase of the carrier of an actuator in a recording with position alone.
FindPhase = Callable[[Log, Actuator], float]


class Duties(Enum):
    """What a recording has of the duty cycles: every change, those of periods, those at samples, or too few."""

    RECORDED, LATCHED, INTERPOLATED, UNKNOWN = range(4)


@dataclass(frozen=True, slots=True, eq=False)
class Pulsed:
    """A recording on a time grid that resolves the pulses, if possible, and the actuator with the phase in it.

    The period of the carrier is that by the clock of the recording. `phase_std` is the standard deviation of the phase,
    0 if it is known exactly; `open_std` as in
    `clutchid.simulation.plan.Segment`, for every interval; `warning` is given if the recording is too slow.
    """

    log: Log
    actuator: Actuator
    phase_std: float = 0.0
    open_std: FloatArray | None = None
    warning: str | None = None


def find_phase(log: Log, actuator: Actuator) -> float:
    """Phase of a carrier of known period in a recording with position alone: the one that predicts the motion best.

    Each phase is tried in a simulation of the calibrated actuator with a reset to the measured position every 20 ms.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    p, step, period = actuator.parameters, sample_interval(log.time), _period(actuator)
    part, rate = log.slice(0, min(len(log), round(MAX_DURATION / step))), stiffness(actuator)
    slow = duties_in(log, actuator) is not Duties.RECORDED
    part = part.with_columns(position=part["position"] - p.e_y) if slow else without_sensors(part, p)
    every = Partition(every=max(2, round(RESET_INTERVAL / (GRID_STEP if slow else step))))

    def misfit(phase: float) -> float:
        # compensate the lag of the sensor, which acts like another phase
        compared, _ = on_time_grid(part, actuator.replace({"s_pwm": centred(phase)}), p.tau_y)
        candidate = actuator.replace({"s_pwm": centred(phase + p.tau_y / period if slow else phase)})
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


def duties_in(log: Log, actuator: Actuator) -> Duties:
    """What a recording has of the duty cycles of a calibrated `actuator`.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    carrier, renewed = actuator.parameters.T_pwm, actuator.duty_period
    renewed = carrier if renewed is None else renewed
    step = sample_interval(log.time, 0.0)
    if step == 0.0 or (actuator.duty_period is None and carrier == 0.0):
        return Duties.RECORDED
    period = carrier or renewed
    if resolves_carrier(log, period) if period else not is_slow(log):
        return Duties.RECORDED
    if on_off(log):
        return Duties.UNKNOWN
    return Duties.LATCHED if renewed > 0.0 and period >= MIN_PERIOD * step else Duties.INTERPOLATED


def lacks_changes(log: Log, actuator: Actuator) -> bool:
    """Whether duty cycles of a calibrated `actuator` change between the samples of a recording.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    known = duties_in(log, actuator)
    return known is Duties.INTERPOLATED or (
        known is Duties.LATCHED and _period(actuator) < EACH_PERIOD * sample_interval(log.time)
    )


def pulsed(log: Log, actuator: Actuator, with_pressure: bool, find: FindPhase = find_phase) -> Pulsed:
    """The recording with the pulses of the valves of a calibrated `actuator`.

    `find` estimates the phase where neither the duty cycles nor the pressure show it.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is estimated from.
    """
    period, known = actuator.parameters.T_pwm, duties_in(log, actuator)
    if known is not Duties.RECORDED:
        return _slow(log, actuator, known, find)
    fine, _ = on_time_grid(log, actuator)
    if period == 0.0 or len(log) < 2:
        return Pulsed(fine, actuator)
    if (grid := grid_phase(fine, period)) is not None:
        return Pulsed(fine, actuator.replace({"s_pwm": centred(grid)}))
    if with_pressure:
        _, phase = find_carrier(log, actuator, (period,))
        phase = centred(phase - actuator.parameters.tau_p / period)
    else:
        phase = find(log, actuator)
    return Pulsed(fine, actuator.replace({"s_pwm": phase}), _phase_std(actuator))


def _slow(log: Log, actuator: Actuator, known: Duties, find: FindPhase) -> Pulsed:
    """A recording slower than the changes of the duty cycles, on a finer time grid if it has enough of them."""
    if known is Duties.UNKNOWN:
        step = sample_interval(log.time)
        warning = f"{log.name}: a sample every {step * 1e3:.3g} ms does not show when the on/off valves switch, and "
        warning += "the load would have errors of tens of percent; record at 1 kHz."
        return Pulsed(log, actuator, warning=warning)
    if actuator.parameters.T_pwm > 0.0 or known is Duties.LATCHED:
        actuator = actuator.replace({"s_pwm": find(log, actuator)})
    period = in_clock(actuator.parameters.T_pwm, log.time) if actuator.parameters.T_pwm else 0.0
    actuator = actuator.replace({"T_pwm": period})
    fine, open_std = on_time_grid(log, actuator)
    std = max(_phase_std(actuator), STAMP_STD / period) if period > 0.0 else 0.0
    return Pulsed(fine, actuator, std, open_std)


def on_time_grid(log: Log, actuator: Actuator, delay: float = 0.0) -> tuple[Log, FloatArray | None]:
    """A slow recording on a time grid that resolves the pulses with the phase of `actuator`, and `Pulsed.open_std`.

    Others stay as they are, also with edges: `clutchid.simulation.held_inputs` has their means where the valves are
    averaged; with a carrier the pulses begin where its phase says, which the edges determine. `delay` of the duty
    cycles in s matches a position that is recorded late.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    known, p = duties_in(log, actuator), actuator.parameters
    closed = {"duty_supply": p.R_0vs, "duty_exhaust": p.R_0ve}
    if known is Duties.LATCHED:
        return latched(log, in_clock(_period(actuator), log.time), p.s_pwm, GRID_STEP, closed, delay)
    if known is Duties.INTERPOLATED:
        return interpolated(log, actuator.duty_period or CONTROL_STEP, GRID_STEP, closed, delay)
    return log, None


def _period(actuator: Actuator) -> float:
    """Period in s that a phase refers to: of the valves' carrier, else at which the duty cycles are renewed."""
    return actuator.parameters.T_pwm or actuator.duty_period or 0.0


def pulsed_without_sensors(log: Log, actuator: Actuator) -> Pulsed:
    """The recording as by `pulsed`, corrected for lags and offsets of the sensors: the motion of the actuator itself.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is estimated from.
    """
    # the phase is estimated from the position, which is always recorded
    pulsed_log = pulsed(log, actuator, False)
    moved = without_sensors(log, pulsed_log.actuator.parameters)
    return replace(pulsed_log, log=on_time_grid(moved, pulsed_log.actuator)[0])


def _phase_std(actuator: Actuator) -> float:
    """Standard deviation of the phase of the carrier in a recording, in periods, by its prior."""
    return coordinates(actuator, ("s_pwm",), {}, {})[0].width
