"""Pulses of the valves in a recording: period and phase of the carrier, and a time grid that resolves it.

A recording slower than the changes of the duty cycles, such as that of a bus at 100 Hz, is put on a finer time grid, on
which the position is missing between the samples; its positions determine the load as well as ten times more samples
do. Where the control unit renews the duty cycles once a period, each period has its own; otherwise they are
interpolated, and what the recording does not show of them is process noise.

A control unit applies a new duty cycle at the start of a period. If the recorded duty cycles change on a time grid,
the grid gives the phase exactly; otherwise it is estimated from pressure or position.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.numerics.threads import map_pairs
from clutchid.preparation.time_grid import in_clock, interpolated, latched
from clutchid.simulation import Partition
from clutchid.simulation.inputs import carrier_clock
from clutchid.simulation.plan import plan
from clutchid.simulation.run import KernelArrays, run, start_state
from clutchid.simulation.sensors import without_sensors
from clutchid.simulation.stiffness import stiffness
from clutchid.simulation.windows import RESET_INTERVAL
from clutchid.strokes.duty_cycle import duty_grid, grid_phase, is_slow, on_off, resolves_carrier

#: Periods in s that are tried: 200 to 20 Hz, as solenoid valves are driven.
PERIODS = (0.005, 0.008, 0.01, 0.0125, 0.016, 0.02, 0.025, 0.0333, 0.04, 0.05)

#: Number of phases that are tried, and the least contrast: explained variance of the fast part of the pressure rate by
#: the best phase beyond that by the median one, which is due to the changing duty cycle and not to the carrier.
_PHASES, _CONTRAST = 20, 0.01

#: A period that is not that of the duty cycles must have this factor more contrast than periods that differ from it by
#: these shares: pulses out of step explain a carrier no more, but what a valve lags behind its duty cycles as well.
#: Chosen on hybrids 0 to 23 (benchmarks/results/carrier.md).
IN_STEP, _OUT_OF_STEP = 4.0, (-0.07, -0.03, 0.03, 0.07)

#: Least contrast for a period that is known from the duty cycles, with a single trial.
_CONTRAST_ON_GRID = 0.001

#: Least response of the pressure to the pulses, over that to the mean duty cycle, if the contrast alone is not enough:
#: a spool that lags behind duty cycles on a grid has some contrast, but no response; valves that a carrier switches
#: have 0.35 or more. Chosen on trucks 0 to 23 (benchmarks/results/carrier.md).
RESPONSE = 0.2

#: Another period must explain the variance of that of the grid by this factor: with the same duty cycles, half or twice
#: the true period explains up to the same variance.
_GRID_ADVANTAGE = 2.0

#: Assumed travel time of a valve in carrier periods.
_SHORT_TRAVEL = 0.01

#: Longest part of a recording that is used for the phase, in s.
_MAX_DURATION = 15.0


def find_carrier(log: Log, actuator: Actuator, periods: Sequence[float] = PERIODS) -> tuple[float, float]:
    """Carrier period in s and phase at which the valves open, from a recording with pressure; (0, 0) without a carrier.

    An open valve changes the pressure immediately, so that the pressure rate within a period shows when it is open. For
    every period and phase, the rate is regressed on the predicted opening, both without their moving average. Detected
    periods are compared by the variance that they explain of the same part of the rate, because a longer period
    contains more of it. The period of the grid of the duty cycles needs less evidence, and is chosen unless another
    explains `_GRID_ADVANTAGE` times its variance. An on/off unit has no carrier: its edges are those of its commands.

    Raises
    ------
    DataError
        If the recording has no pressure.
    """
    step = sample_interval(log.time)
    log = log.slice(0, min(len(log), round(_MAX_DURATION / step)))
    if on_off(log):
        return 0.0, 0.0
    valves, grid = _Valves.of(log, actuator), duty_grid(log).period
    common = max(1, round(max(periods) / step))
    candidates: dict[float, tuple[float, float]] = {}
    for period in (*periods, grid) if periods is PERIODS and grid not in PERIODS else periods:
        if not resolves_carrier(log, period):
            continue
        length = max(1, round(period / step))
        contrast, phase = _contrast(valves, period, length)
        if _same(period, grid):
            detected = contrast > _CONTRAST or (
                contrast > _CONTRAST_ON_GRID and _response(valves, period, phase, length) > RESPONSE
            )
        else:
            detected = contrast > _CONTRAST and _loses_step(valves, period, length, contrast / IN_STEP)
        if detected:
            candidates[period] = (contrast if len(periods) == 1 else _contrast(valves, period, common)[0], phase)
    if not candidates:
        return 0.0, 0.0
    best = max(candidates, key=lambda period: candidates[period][0])
    on_grid = next((period for period in candidates if _same(period, grid)), best)
    chosen = best if candidates[best][0] > _GRID_ADVANTAGE * candidates[on_grid][0] else on_grid
    return chosen, candidates[chosen][1]


def _same(period: float, grid: float) -> bool:
    return abs(period - grid) < 1e-3 * period


class _Valves(NamedTuple):
    """Both valves in a recording of n samples, and the pressure rate (n - 1,) that their pulses explain.

    `shares` (n,) are the openings by the duty cycles, `pressures` (n - 1,) the parts of the supply pressure that drive
    the flows, NaN without a duty cycle, and `lows` the duty cycles at which a valve starts to open: there the search
    for its phase starts.
    """

    time: FloatArray
    rate: FloatArray
    shares: tuple[FloatArray, FloatArray]
    pressures: tuple[FloatArray, FloatArray]
    lows: tuple[float, float]
    actuator: Actuator

    @classmethod
    def of(cls, log: Log, actuator: Actuator) -> _Valves:
        """Valves of `actuator` in `log`; DataError if it has no pressure."""
        p, opening = actuator.parameters, kernels(actuator.model).opening
        shares = opening(log["duty_supply"], p.R_0vs, p.R_1vs), opening(log["duty_exhaust"], p.R_0ve, p.R_1ve)
        supply, exhaust = (np.where(np.isfinite(share[:-1]), 1.0, np.nan) for share in shares)
        pressures = supply, exhaust * np.nan_to_num(log["pressure_a"][:-1], nan=p.P_0) / p.P_S
        return cls(log.time, np.diff(log["pressure_a"]), shares, pressures, (p.R_0vs, p.R_0ve), actuator)

    def openings(self, clock: Sequence[FloatArray], phase: float) -> list[FloatArray]:
        """Openings (n - 1,) as a carrier switches the valves at a phase, each times the pressure that drives its flow.

        `clock` is the `carrier_clock` of its period.
        """
        passed_pulses = kernels(self.actuator.model).passed_pulses
        return [
            passed_pulses(share, share, *clock, (phase + low) % 1.0, _SHORT_TRAVEL)[:-1] * pressure
            for share, pressure, low in zip(self.shares, self.pressures, self.lows, strict=True)
        ]

    def clock(self, period: float) -> list[FloatArray]:
        """Clock of a carrier of `period` s."""
        return carrier_clock(self.time, self.actuator.parameters.replace(T_pwm=period))


def _contrast(valves: _Valves, period: float, length: int) -> tuple[float, float]:
    """Explained variance by the best phase of a period beyond that by the median phase, and the best phase.

    Moving averages over `length` samples are removed from the pressure rate.
    """
    fast, clock = valves.rate - _smooth(valves.rate, length), valves.clock(period)
    phases = np.arange(_PHASES) / _PHASES

    def explained(phase: float, _: float) -> float:
        return _explained_variance(valves.openings(clock, centred(float(phase))), fast, length)

    shares = np.array(map_pairs(explained, phases, phases))
    return float(shares.max() - np.median(shares)), float(phases[np.argmax(shares)])


def _loses_step(valves: _Valves, period: float, length: int, most: float) -> bool:
    """Whether all periods near `period`, with which pulses do not stay in step, have a contrast below `most`."""
    return all(_contrast(valves, period * (1.0 + share), length)[0] < most for share in _OUT_OF_STEP)


def _response(valves: _Valves, period: float, phase: float, length: int) -> float:
    """Response of the pressure rate to pulses, over that to the mean opening: about 1, or 0 without a carrier.

    Unlike the contrast it does not depend on the noise of the pressure.
    """
    rate, columns = valves.rate, np.column_stack(valves.openings(valves.clock(period), centred(phase)))
    slow, smooth = np.column_stack([_smooth(column, length) for column in columns.T]), _smooth(rate, length)
    recorded = np.isfinite(rate)
    to_mean, *_ = np.linalg.lstsq(slow[recorded], smooth[recorded], rcond=None)
    to_pulses, *_ = np.linalg.lstsq(_zeros_for_missing(columns - slow)[recorded], (rate - smooth)[recorded], rcond=None)
    return float(to_pulses @ to_mean / max(float(to_mean @ to_mean), np.finfo(float).tiny))


def _smooth(values: FloatArray, length: int) -> FloatArray:
    return np.convolve(_zeros_for_missing(values), np.ones(length) / length, "same")


def _zeros_for_missing(values: FloatArray) -> FloatArray:
    return np.where(np.isnan(values), 0.0, values)


def _explained_variance(openings: Sequence[FloatArray], fast: FloatArray, length: int) -> float:
    """Fraction of the variance of the fast part of the pressure rate that the switching of both valves explains."""
    supply, exhaust = (_zeros_for_missing(opening - _smooth(opening, length)) for opening in openings)
    usable = np.isfinite(fast) & ((supply != 0.0) | (exhaust != 0.0))
    if usable.sum() < 100:
        return 0.0
    rows = np.where(usable, np.stack([supply, exhaust, fast]), 0.0)
    normal = rows @ rows.T
    total = float(normal[2, 2])
    if total == 0.0:
        return 0.0
    weights, *_ = np.linalg.lstsq(normal[:2, :2], normal[:2, 2], rcond=None)
    return float(2.0 * weights @ normal[:2, 2] - weights @ normal[:2, :2] @ weights) / total


def centred(phase: float) -> float:
    """The same phase in [-0.5, 0.5)."""
    return (phase + 0.5) % 1.0 - 0.5


#: Shortest period in samples with duty cycles of its own: in a sample of 10 ms the middle of a period of 2 ms is known
#: to 1 ms, as are the time stamps.
_MIN_PERIOD = 0.4

#: Shortest period in samples whose duty cycles are all recorded: clocks differ.
_EACH_PERIOD = 0.95

#: Time grid in s of a slow recording: that of a calibration at 1 kHz, in whose intervals pulses count as their means.
GRID_STEP = 1e-3

#: Interval in s for which a control unit holds duty cycles that change continuously.
_CONTROL_STEP = 1e-3

#: Standard deviation in s of the time stamps of a slow recording: messages on the bus wait for each other.
STAMP_STD = 1e-3

#: Estimates the phase of the carrier of an actuator in a recording with position alone.
FindPhase = Callable[[Log, Actuator], float]


class Duties(Enum):
    """Duty cycles in a recording: every change, those of periods, those at samples, or too few."""

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


def frequent_resets(step: float) -> Partition:
    """Resets to the measured position every `RESET_INTERVAL`, on a time grid of `step` s."""
    return Partition(every=max(2, round(RESET_INTERVAL / step)))


def find_phase(log: Log, actuator: Actuator) -> float:
    """Phase of a carrier of known period in a recording with position alone: the one that predicts the motion best.

    Each phase is tried in a simulation of the calibrated actuator with a reset to the measured position every 20 ms.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    p, step, period = actuator.parameters, sample_interval(log.time), _period(actuator)
    part, rate = log.slice(0, min(len(log), round(_MAX_DURATION / step))), stiffness(actuator)
    slow = duties_in(log, actuator) is not Duties.RECORDED
    part = part.with_columns(position=part["position"] - p.e_y) if slow else without_sensors(part, p)
    resets = frequent_resets(GRID_STEP if slow else step)

    def misfit(phase: float) -> float:
        # compensate the lag of the sensor, which acts like another phase
        compared, _ = on_time_grid(part, actuator.replace({"s_pwm": centred(phase)}), p.tau_y)
        candidate = actuator.replace({"s_pwm": centred(phase + p.tau_y / period if slow else phase)})
        total = 0.0
        for segment in plan(compared, candidate, rate, resets).segments:
            states, _ = run(segment, KernelArrays.of(candidate), start_state(segment, candidate))
            error = states[:, 0] - compared["position"][segment.start : segment.stop]
            total += float(np.nansum(np.minimum(np.abs(error), 1e-3) ** 2))
        return total

    def best(phases: FloatArray) -> float:
        return float(phases[np.argmin([misfit(phase) for phase in phases])])

    return centred(best(best(np.arange(10) / 10) + np.arange(-4, 5) / 50))


def duties_in(log: Log, actuator: Actuator) -> Duties:
    """Duty cycles of a calibrated `actuator` in a recording.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    step, period = sample_interval(log.time, 0.0), _period(actuator)
    if step == 0.0 or (actuator.duty_period is None and period == 0.0):
        return Duties.RECORDED
    if resolves_carrier(log, period) if period else not is_slow(log):
        return Duties.RECORDED
    if on_off(log):
        return Duties.UNKNOWN
    renewed = actuator.duty_period != 0.0  # by default once in each period of the carrier
    return Duties.LATCHED if renewed and period >= _MIN_PERIOD * step else Duties.INTERPOLATED


def lacks_changes(log: Log, actuator: Actuator) -> bool:
    """Whether duty cycles of a calibrated `actuator` change between the samples of a recording.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    duties = duties_in(log, actuator)
    return duties is Duties.INTERPOLATED or (
        duties is Duties.LATCHED and _period(actuator) < _EACH_PERIOD * sample_interval(log.time)
    )


def pulsed(log: Log, actuator: Actuator, with_pressure: bool, find: FindPhase = find_phase) -> Pulsed:
    """The recording with the pulses of the valves of a calibrated `actuator`.

    `find` estimates the phase where neither the duty cycles nor the pressure show it.

    Raises
    ------
    DataError
        If the recording lacks a column that the phase is estimated from.
    """
    period, duties = actuator.parameters.T_pwm, duties_in(log, actuator)
    if duties is not Duties.RECORDED:
        return _slow(log, actuator, duties, find)
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


def _slow(log: Log, actuator: Actuator, duties: Duties, find: FindPhase) -> Pulsed:
    """A recording slower than the changes of the duty cycles, on a finer time grid if it has enough of them."""
    if duties is Duties.UNKNOWN:
        step = sample_interval(log.time)
        warning = f"{log.name}: a sample every {step * 1e3:.3g} ms does not show when the on/off valves switch, so "
        warning += "the load would have errors of tens of percent; record at 1 kHz."
        return Pulsed(log, actuator, warning=warning)
    if actuator.parameters.T_pwm > 0.0 or duties is Duties.LATCHED:
        actuator = actuator.replace({"s_pwm": find(log, actuator)})
    period = in_clock(actuator.parameters.T_pwm, log.time) if actuator.parameters.T_pwm else 0.0
    actuator = actuator.replace({"T_pwm": period})
    fine, open_std = on_time_grid(log, actuator)
    std = max(_phase_std(actuator), STAMP_STD / period) if period > 0.0 else 0.0
    return Pulsed(fine, actuator, std, open_std)


def on_time_grid(log: Log, actuator: Actuator, delay: float = 0.0) -> tuple[Log, FloatArray | None]:
    """A slow recording on a time grid that resolves the pulses with the phase of `actuator`, and `Pulsed.open_std`.

    Others stay as they are, also with edges: `clutchid.simulation.inputs.held_inputs` has their means where the valves
    are averaged; with a carrier the pulses begin where its phase says, which the edges determine. `delay` of the duty
    cycles in s matches a position that is recorded late.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle.
    """
    duties, p = duties_in(log, actuator), actuator.parameters
    closed = {"duty_supply": p.R_0vs, "duty_exhaust": p.R_0ve}
    if duties is Duties.LATCHED:
        return latched(log, in_clock(_period(actuator), log.time), p.s_pwm, GRID_STEP, closed, delay)
    if duties is Duties.INTERPOLATED:
        return interpolated(log, actuator.duty_period or _CONTROL_STEP, GRID_STEP, closed, delay)
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
