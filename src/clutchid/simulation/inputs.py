"""The inputs of a recording: the part that has both duty cycles, and what the valves are given in each interval.

In a file with several time grids each starts and ends at stamps of its own, so that the first and last samples of the
position often have no duty cycle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.parameters import Parameters

#: An end without inputs that is shorter than this, in s, is no loss: time grids start and end at different stamps.
LONG_END = 0.5

#: A period starts at a sample that lies this part of it before its start: stamps and periods are rounded. Without, the
#: tail of the pulse before was lost for a sample.
ROUNDING = 1e-6


def input_span(log: Log) -> slice:
    """Samples of `log` from the first to the last one with both duty cycles; holes between them are inside.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle, or no sample has both.

    Examples
    --------
    >>> nan = np.nan
    >>> duty = {"duty_supply": np.array([nan, 0.0, nan, 1.0, 1.0]), "duty_exhaust": np.array([0.0, 0.0, 0.0, 0.0, nan])}
    >>> input_span(Log(np.arange(5.0), duty))
    slice(1, 4, None)
    """
    has_inputs = with_both_duties(log)
    return slice(int(np.argmax(has_inputs)), len(log) - int(np.argmax(has_inputs[::-1])))


def with_both_duties(log: Log) -> NDArray[np.bool_]:
    """Whether each sample has both duty cycles, as at least one has.

    Raises
    ------
    DataError
        As `input_span`.
    """
    missing = [name for name in INPUTS if name not in log]
    if missing:
        raise DataError(f"{log.name}: no column '{missing[0]}'; a simulation needs both duty cycles.")
    both: NDArray[np.bool_] = np.isfinite(log[INPUTS[0]]) & np.isfinite(log[INPUTS[1]])
    if not both.any():
        raise DataError(
            f"{log.name}: no sample has both duty cycles, so nothing can be simulated; record {' and '.join(INPUTS)} "
            "over the same time as the position."
        )
    return both


def with_inputs(log: Log, span: slice | None = None) -> Log:
    """`log` without the samples before the first and after the last one with both duty cycles, as a view.

    It has a warning where `LONG_END` s or more are cut off. `span` is its `input_span`, where that is known.

    Raises
    ------
    DataError
        As `input_span`.
    """
    span = input_span(log) if span is None else span
    if span.stop - span.start == len(log):
        return log
    return replace(log.slice(span.start, span.stop), warnings=(*log.warnings, *cut_warnings(log, span)))


def cut_warnings(log: Log, span: slice) -> tuple[str, ...]:
    """A warning where the ends of `log` outside `span` take `LONG_END` s or more."""
    first, last = float(log.time[span.start]), float(log.time[span.stop - 1])
    before, after = first - float(log.time[0]), float(log.time[-1]) - last
    ends = [f"before {first:.3f} s"] if before >= LONG_END else []
    ends += [f"after {last:.3f} s"] if after >= LONG_END else []
    return (f"{log.name}: no duty cycles {' and '.join(ends)}; these samples are left out.",) if ends else ()


def at_samples(simulated: Log, log: Log) -> Log:
    """A simulation at the samples of `log`, whose stamps it has, or some of them; NaN where it has not.

    The duty cycles of these samples are those of `log`.
    """
    at = np.minimum(np.searchsorted(simulated.time, log.time), len(simulated) - 1)
    same = simulated.time[at] == log.time

    def column(name: str, values: FloatArray) -> FloatArray:
        return np.where(same, values[at], log[name] if name in INPUTS else np.nan)

    columns = {name: column(name, values) for name, values in simulated.columns.items()}
    return replace(simulated, time=log.time, columns=columns)


def mean_duties(log: Log, opening: Mapping[str, tuple[float, float]]) -> list[FloatArray]:
    """Both duty cycles, those with `Log.edges` as means over the interval behind each sample.

    The mean is that of the opening: a valve opens from the first duty cycle of `opening` to the second one.
    """
    return [_mean(log, name, *opening[name]) if name in log.edges else log[name] for name in INPUTS]


def _mean(log: Log, name: str, shut: float, wide: float) -> FloatArray:
    column, (stamps, values) = log[name], log.edges[name]
    inside = (stamps > log.time[0]) & (stamps < log.time[-1]) & np.isfinite(values)
    stamps, values = stamps[inside], values[inside]
    at = np.searchsorted(log.time, stamps, side="right") - 1
    first = np.diff(at, prepend=-1) > 0
    before = np.where(first, column[at], np.roll(values, 1))
    remaining = (log.time[at + 1] - stamps) / (log.time[at + 1] - log.time[at])
    opened = (np.clip(values, shut, wide) - np.clip(before, shut, wide)) * remaining
    gain = np.bincount(at, opened, minlength=len(log))
    # without an edge the duty cycle stays exactly as it is, also below `shut`
    return np.where(gain == 0.0, column, np.clip(column, shut, wide) + gain)


def held_inputs(log: Log, actuator: Actuator, start: int, stop: int) -> FloatArray:
    """Held inputs at every sample: both duty cycles, and the valves' carrier where the model has one.

    Averaged valves take duty cycles with `Log.edges` as means over each interval.
    """
    columns = [log[name][start:stop] for name in INPUTS]
    if log.edges and actuator.parameters.T_pwm == 0.0 and stop > start + 1:
        p = actuator.parameters
        opening = {"duty_supply": (p.R_0vs, p.R_1vs), "duty_exhaust": (p.R_0ve, p.R_1ve)}
        columns = mean_duties(log.slice(start, stop), opening)
    if not (log.edges and actuator.parameters.T_pwm > 0.0):
        return with_carrier(log.time[start:stop], np.column_stack(columns), actuator)
    if "c_pwm" in kernels(actuator.model).INPUTS:
        time, p = log.time[start:stop], actuator.parameters
        before = period_before(time, p)
        # a period starts within an interval, and its pulses are those of the next sample
        clock = carrier_clock(time, p, p.s_pwm)
        starts = np.append((clock[0] < p.s_pwm)[:-1], False)
        earlier = [np.where(starts, column, column[before]) for column in columns]
        columns = [np.where(starts, np.roll(column, -1), column) for column in columns]
        columns += [*clock, *earlier]
    return np.column_stack(columns)


def with_carrier(time: FloatArray, duties: FloatArray, actuator: Actuator) -> FloatArray:
    """Held inputs of both duty cycles (n, 2), with the valves' carrier and those a period before where it has one."""
    if "c_pwm" not in kernels(actuator.model).INPUTS:
        return duties
    p = actuator.parameters
    return np.column_stack([duties, *carrier_clock(time, p), duties[period_before(time, p)]])


def carrier_clock(time: FloatArray, p: Parameters, begins: float | None = None) -> list[FloatArray]:
    """Phase of the valves' carrier at each sample, in [0, 1), and the part of a period until the next; 0 without.

    If a period `begins` at another phase than 0, phases are in [begins, begins + 1), so that the pulse of the present
    period is the first one; where a period begins within an interval, they are below by what is left of that before.
    """
    if p.T_pwm == 0.0:
        return [np.zeros(time.size), np.zeros(time.size)]
    phase = (time / p.T_pwm - (begins or 0.0)) % 1.0
    phase[phase > 1.0 - ROUNDING] = 0.0
    step = np.diff(time, append=2 * time[-1] - time[-2]) / p.T_pwm
    step = np.where(step < 1.0 - ROUNDING, step, 0.0)
    if begins is not None:
        phase = np.where(phase + step > 1.0 + ROUNDING, phase - 1.0, phase) + begins
    return [phase, step]


def period_before(time: FloatArray, p: Parameters) -> NDArray[np.intp]:
    """Number of the sample one period of the valves' carrier before each sample, the first where there is none."""
    early = np.searchsorted(time, time - p.T_pwm * (1.0 - 1e-6), side="right") - 1
    return np.maximum(early, 0)
