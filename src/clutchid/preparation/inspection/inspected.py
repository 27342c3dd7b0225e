"""`Check`: the result of one check; `InspectedRecording`: quantities that checks share, computed once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ClutchidError
from clutchid.log import INPUTS, FloatArray, Log, sample_interval
from clutchid.messages import text_table
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.plan import plan
from clutchid.simulation.run import KernelArrays, run, start_state
from clutchid.simulation.stiffness import stiffness
from clutchid.strokes.duty_cycle import duty_grid, on_off
from clutchid.strokes.sampled import IndexArray, Runs, constant_runs, noise, quantum, run_ends

#: "suspect": a fit is possible, but check the recording; "bad": a fit would be wrong; "undetermined": not enough data.
Grade = Literal["good", "suspect", "bad", "undetermined"]

_TITLES = ("check", "result", "grade")


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check: its name, the value with its unit, the grade, and a sentence that says what to do.

    `begin` and `end` in s are the longest place where it fails; None where it is of the whole recording.
    """

    name: str
    value: str
    grade: Grade
    sentence: str
    begin: float | None = None
    end: float | None = None


@dataclass(frozen=True, slots=True)
class Inspection:
    """Results of all checks of the recording `name`, and `notes` on what it lacks without being faulty."""

    name: str
    checks: tuple[Check, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.table()

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentence of each check that is "suspect" or "bad"; an undetermined one gives no warning."""
        poor = [check for check in self.checks if check.grade in ("suspect", "bad")]
        return tuple(f"{self.name}: {check.sentence}" for check in poor)

    @property
    def bad(self) -> tuple[str, ...]:
        """The sentence of each check that is "bad": a fit would be wrong."""
        return tuple(check.sentence for check in self.checks if check.grade == "bad")

    def table(self, how: str = "") -> str:
        """All checks as a text table for a terminal, followed by the sentences of those that are not good.

        Parameters
        ----------
        how
            Said of the recording behind its name: how it was read.

        Returns
        -------
        text : str
            One line per check.

        Examples
        --------
        >>> slow = Check("sample rate", "20 Hz", "bad", "20 Hz is slow; record faster.")
        >>> print(Inspection("run", (slow,)).table())
        run: 1 check, 1 bad
          check        result  grade
          sample rate  20 Hz   bad
        <BLANKLINE>
          - sample rate: 20 Hz is slow; record faster.
        """
        poor = [check for check in self.checks if check.grade != "good"]
        count = len(self.checks)
        grades = [check.grade for check in poor]
        counted = ", ".join(f"{grades.count(g)} {g}" for g in ("bad", "suspect", "undetermined") if g in grades)
        lines = [f"{self.name}{how}: {count} check{'' if count == 1 else 's'}, {counted or 'all good'}"]
        lines += text_table([_TITLES, *((check.name, check.value, check.grade) for check in self.checks)], len(_TITLES))
        sentences = [*(f"{check.name}: {check.sentence}" for check in poor), *self.notes]
        if sentences:
            lines += ["", *(f"  - {sentence}" for sentence in sentences)]
        return "\n".join(lines)


#: Measured columns that are checked one by one, their unit in messages, and the factor from SI to it.
_MEASURED = {"position": ("mm", 1e3), "pressure_a": ("bar", 1e-5)}

#: Largest number of strokes, or of intervals with an open valve, that are evaluated.
_MOST = 200

#: No sensor is better than this fraction of its range: with less noise, the values were computed.
_COMPUTED = 1e-5

#: Quantile of the time between changes of the position that gives its update interval, and least number of changes.
_FAST, _FEWEST = 0.1, 50

#: Least travel over the load, as a share of the stroke.
_TRAVELS = 0.3

#: Longest pause in s between two pulses that count as one opening: the longest period of a carrier, 20 Hz.
_PAUSE = 0.05


class Extremes(NamedTuple):
    """Smallest and largest value of a column, in SI."""

    low: float
    high: float


@dataclass(frozen=True, eq=False)
class InspectedRecording:
    """A recording and the actuator that it is compared with."""

    log: Log
    actuator: Actuator

    @cached_property
    def step(self) -> float:
        """Usual interval between samples in s; infinity for fewer than two."""
        return sample_interval(self.log.time, math.inf)

    @cached_property
    def update_interval(self) -> float:
        """Interval in s between new values of the position; longer than `step` if the logger repeats the last value."""
        if "position" not in self.measured:
            return self.step
        changes = np.flatnonzero(np.diff(self.log["position"]) != 0)
        # a coarsely quantised position repeats values too, but in fast motion it changes with every new value
        return self.step * float(np.quantile(np.diff(changes), _FAST)) if changes.size > _FEWEST else self.step

    @cached_property
    def driven(self) -> bool:
        """Whether the recording has both duty cycles and more than one sample."""
        return all(name in self.log for name in INPUTS) and len(self.log) > 1

    @cached_property
    def noises(self) -> Mapping[str, float]:
        """Standard deviation of each measured column where it is quiet, in SI."""
        return {name: noise(self.log[name]) for name in self.measured}

    @cached_property
    def quanta(self) -> Mapping[str, float]:
        """Quantisation step of each measured column, in SI; 0 if none is visible."""
        return {name: quantum(self.log[name]) for name in self.measured}

    @cached_property
    def ends(self) -> Mapping[str, Extremes]:
        """Smallest and largest value of each measured column, in SI."""
        return {
            name: Extremes(float(np.nanmin(self.log[name])), float(np.nanmax(self.log[name]))) for name in self.measured
        }

    @cached_property
    def extent(self) -> Extremes:
        """Positions in m between which all but 1 % of the samples lie."""
        return Extremes(*np.nanquantile(self.log["position"], (0.005, 0.995)).tolist())

    @cached_property
    def travels(self) -> bool:
        """Whether the piston is known to move over a good part of its stroke, against the load."""
        if "position" not in self.measured:
            return False
        return self.extent.high - self.extent.low > _TRAVELS * self.actuator.parameters.y_max

    @cached_property
    def duty_period(self) -> float:
        """Period in s of the time grid on which the duty cycles change; 0 if they change at any time."""
        return duty_grid(self.log).period

    @cached_property
    def carrier_period(self) -> float:
        """Period in s of the carrier, 0 if unknown: valves that are only opened and closed change without a carrier."""
        return 0.0 if on_off(self.log) else self.duty_period

    def noisy(self, name: str) -> bool:
        """Whether the noise of a measured column exceeds its quantisation, so that repeated values are significant."""
        low, high = self.ends[name]
        return self.noises[name] > _COMPUTED * (high - low) and self.quanta[name] <= 2 * self.noises[name]

    @cached_property
    def runs(self) -> Mapping[str, Runs]:
        """Runs in which each measured column does not change."""
        return {name: constant_runs(self.log[name]) for name in self.measured}

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """Measured columns with at least two blocks of finite values."""
        return tuple(name for name in _MEASURED if name in self.log and np.isfinite(self.log[name]).sum() > 64)

    @cached_property
    def rate(self) -> float:
        """Stiffness of the model in 1/s."""
        return stiffness(self.actuator)

    @cached_property
    def supply(self) -> FloatArray:
        """Opening of the supply valve at each sample, 0 to 1; 0 where its duty cycle is missing."""
        p = self.actuator.parameters
        return self._opening("duty_supply", p.R_0vs, p.R_1vs)

    @cached_property
    def exhaust(self) -> FloatArray:
        """Opening of the exhaust valve at each sample, 0 to 1; 0 where its duty cycle is missing."""
        p = self.actuator.parameters
        return self._opening("duty_exhaust", p.R_0ve, p.R_1ve)

    def _opening(self, name: str, low: float, high: float) -> FloatArray:
        degree: FloatArray = kernels(self.actuator.model).opening(self.log[name], low, high)
        return np.nan_to_num(degree)

    def open_alone(self, supply: bool) -> tuple[IndexArray, IndexArray]:
        """First samples, and first after, of the intervals in which only one valve is open; pulses are merged."""
        opened, other = (self.supply, self.exhaust) if supply else (self.exhaust, self.supply)
        starts, stops = run_ends((opened > 0) & (other <= 0))
        if starts.size < 2:
            return starts, stops
        passed = np.concatenate([[0], np.cumsum(other > 0)])
        pause = self.log.time[starts[1:]] - self.log.time[stops[:-1] - 1]
        apart = (pause > _PAUSE) | (passed[starts[1:]] > passed[stops[:-1]])
        return starts[np.concatenate([[True], apart])], stops[np.concatenate([apart, [True]])]

    def blur(self, name: str) -> float:
        """Apparent change of a measured column due to noise and quantisation, in SI: 6 sigma or 2 steps."""
        return max(6 * float(np.nan_to_num(self.noises[name])), 2 * self.quanta[name])

    def simulated(self, log: Log, position: float, pressure: float) -> FloatArray:
        """Simulated position in m under the inputs of `log`, from rest at a position in m and a pressure in Pa.

        NaN if `log` has holes, or its sample rate is too low for the model.
        """
        inputs = Log(log.time, {name: log[name] for name in INPUTS})
        try:
            (segment,) = plan(inputs, self.actuator, self.rate).segments
        except (ClutchidError, ValueError):  # no samples, too low a sample rate, or more than one segment
            return np.full(len(log), np.nan)
        states, _ = run(
            segment, KernelArrays.of(self.actuator), start_state(segment, self.actuator, (position, pressure))
        )
        motion = np.full(len(log), np.nan)
        motion[segment.start : segment.stop] = states[:, 0]
        return motion

    @cached_property
    def quick(self) -> tuple[float, float]:
        """Time in s in which a fully open valve moves the simulated piston by a tenth of its stroke: supply, exhaust.

        The supply valve starts from the vented rest, the exhaust valve from the far end at supply pressure; infinity
        if it takes longer than a second.
        """
        p = self.actuator.parameters
        time: FloatArray = np.arange(1000, dtype=np.float64) * 1e-3
        wide, none = np.ones(time.size), np.zeros(time.size)
        up = self.simulated(Log(time, dict(zip(INPUTS, (wide, none), strict=True))), 0.0, p.P_0)
        down = self.simulated(Log(time, dict(zip(INPUTS, (none, wide), strict=True))), p.y_max, p.P_S)
        tenth = 0.1 * p.y_max
        return _first(time, up > tenth), _first(time, down < p.y_max - tenth)


def spread_over(count: int, most: int = _MOST) -> IndexArray:
    """At most `most` of the indices 0 ... `count` - 1, evenly spread.

    Examples
    --------
    >>> spread_over(5, 3).tolist()
    [0, 2, 4]
    """
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp)) if count else np.arange(0)


def shown(value: float, name: str) -> str:
    """A value of a measured column, given in SI, with the unit of `_MEASURED`.

    Examples
    --------
    >>> shown(4.5e5, "pressure_a")
    '4.5 bar'
    """
    unit, scale = _MEASURED[name]
    return f"{value * scale:.3g} {unit}"


def _first(time: FloatArray, reached: NDArray[np.bool_]) -> float:
    return float(time[np.argmax(reached)]) if reached.any() else float("inf")
