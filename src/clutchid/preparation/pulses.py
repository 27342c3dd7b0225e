"""The pulses of the valves in a recording: where in its period the carrier is, on a raster that shows it.

A recording slower than the pulses, as of a bus at 100 Hz, still has the duty cycle of each period, and its positions
tell the load as well as ten times as many do. So it is put on a finer raster, on which duty cycles change where periods
start, and the position is missing between the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.preparation.carrier import ENOUGH, centred, find_carrier, grid_phase, on_off, shows
from clutchid.simulation import Partition
from clutchid.simulation.plan import plan
from clutchid.simulation.run import Numbers, run, start_state
from clutchid.simulation.sensors import undone
from clutchid.simulation.stiffness import stiffness
from clutchid.uncertainty.coordinates import WIDTHS

#: Samples a period, at least, that tell its duty cycle; and the raster in s on which its pulses are simulated: on one
#: of 1 ms the duty cycles change half a millisecond late, which costs several percent of the load.
TOLD, FINE = 0.95, 2.5e-4

#: How late or early a slow recording may stamp its samples, as a standard deviation in s: messages wait for each other.
LATE = 1e-3

#: After this many s the simulations that tell the phase take the measured position again.
AGAIN = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Pulsed:
    """A recording on a raster that shows the pulses, as far as that can be, and the actuator with the phase in it.

    `spread` is the standard deviation of the phase, 0 where it needs not to be estimated; `warning` says what the
    recording is too slow for.
    """

    log: Log
    actuator: Actuator
    spread: float = 0.0
    warning: str | None = None


def pulsed(log: Log, actuator: Actuator, with_pressure: bool) -> Pulsed:
    """The recording with the pulses of the calibrated `actuator`'s valves.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is read from.
    """
    period = actuator.parameters.T_pwm
    if period == 0.0 or len(log) < 2:
        return Pulsed(log, actuator)
    if not shows(log, period):
        return _put_together(log, actuator)
    if (grid := grid_phase(log, period)) is not None:
        return Pulsed(log, actuator.replace({"s_pwm": centred(grid)}))
    if with_pressure:
        _, phase = find_carrier(log, actuator, (period,))
        phase = centred(phase - actuator.parameters.tau_p / period)
    else:
        phase = find_phase(log, actuator)
    return Pulsed(log, actuator.replace({"s_pwm": phase}), WIDTHS["s_pwm"])


def _put_together(log: Log, actuator: Actuator) -> Pulsed:
    """A recording that is slower than the pulses, which are put together where each period's duty cycle is known."""
    period, step = actuator.parameters.T_pwm, float(np.median(np.diff(log.time)))
    if period < TOLD * step or on_off(log):
        told = f"{log.name}: a sample every {step * 1e3:.3g} ms does not tell the pulses of valves that are switched "
        told += f"every {period * 1e3:.3g} ms; they are averaged, and the load can be far off. Record at 1 kHz."
        return Pulsed(log, actuator, warning=told)
    phase = find_phase(log, actuator)
    return Pulsed(refined(log, period, phase), actuator.replace({"s_pwm": phase}), max(WIDTHS["s_pwm"], LATE / period))


def refined(log: Log, period: float, phase: float, late: float = 0.0) -> Log:
    """`log` with samples every `FINE` s or so between its own, at which only the duty cycles are known.

    Parameters
    ----------
    log : Log
        Its samples stay, with their stamps.
    period : s
        Of the carrier, at least `TOLD` samples.
    phase : 1
        Where in a period of the time stamps those of the carrier start. Each has the duty cycle that it was last
        recorded with, or that of the one before.
    late : s
        By how much later the duty cycles are to change, to go with a position that was recorded late.
    """
    gaps = np.diff(log.time)
    step = float(np.median(gaps))
    parts = np.where(gaps <= HOLE * step, max(1, round(step / FINE)), 1)
    first = np.concatenate([[0], np.cumsum(parts)])
    of = np.repeat(np.arange(gaps.size), parts)
    time = np.append(log.time[of] + gaps[of] * (np.arange(first[-1]) - first[of]) / parts[of], log.time[-1])
    numbers = _number(log.time, period, phase)
    latched = np.searchsorted(numbers, _number(time - late, period, phase), side="right") - 1
    columns = {}
    for name, values in log.columns.items():
        if name in INPUTS:
            columns[name] = values[np.maximum(latched, 0)]
        else:
            columns[name] = np.full(time.size, np.nan)
            columns[name][first] = values
    return Log(time, columns, log.name, log.metadata)


def unsensed(log: Log, actuator: Actuator) -> Pulsed:
    """The recording as `pulsed` has it, with lags and offsets of the sensors undone: as the actuator itself moved.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is read from.
    """
    # the phase from the position, which every recording has: it knows the valves' own phases
    own = pulsed(log, actuator, False)
    p = own.actuator.parameters
    moved = undone(log, p)
    return replace(own, log=moved if len(own.log) == len(log) else refined(moved, p.T_pwm, p.s_pwm))


def _number(time: FloatArray, period: float, phase: float) -> FloatArray:
    """Number of the carrier's period at each stamp."""
    number: FloatArray = np.floor(time / period - phase + 1e-9)
    return number


def find_phase(log: Log, actuator: Actuator) -> float:
    """Phase of a carrier of known period in a recording with position alone: the one that predicts the motion best.

    Each phase is tried in a simulation of the calibrated actuator that takes the measured position again every 20 ms.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    p, step = actuator.parameters, float(np.median(np.diff(log.time)))
    part, rate = log.slice(0, min(len(log), round(ENOUGH / step))), stiffness(actuator)
    slow = not shows(log, p.T_pwm)
    part = part.with_columns(position=part["position"] - p.e_y) if slow else undone(part, p)
    every = Partition(every=max(2, round(AGAIN / (FINE if slow else step))))

    def misfit(phase: float) -> float:
        # a lag of the sensor looks like another phase
        seen = refined(part, p.T_pwm, phase, p.tau_y) if slow else part
        tried = actuator.replace({"s_pwm": centred(phase + p.tau_y / p.T_pwm if slow else phase)})
        total = 0.0
        for segment in plan(seen, tried, rate, every).segments:
            states, _ = run(segment, Numbers.of(tried), start_state(segment, tried))
            miss = states[:, 0] - seen["position"][segment.start : segment.stop]
            total += float(np.nansum(np.minimum(np.abs(miss), 1e-3) ** 2))
        return total

    coarse = np.arange(10) / 10
    best = float(coarse[int(np.argmin([misfit(phase) for phase in coarse]))])
    fine = best + np.arange(-4, 5) / 50
    return centred(float(fine[int(np.argmin([misfit(phase) for phase in fine]))]))
