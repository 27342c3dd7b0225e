"""Samples that are no values: beyond the stops, single outliers, steps that no piston makes, repeated last values.

They count as missing, are counted, and are said with their time; the same rule runs over a file and over what arrives.
What a piston can do follows from the actuator, and nothing from the recording but the noise of its sensors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen import records
from clutchid.codegen.kernels import kernels_in
from clutchid.log import HOLE, INPUTS, BoolArray, FloatArray, Log, sample_interval
from clutchid.log.states import SENSORS
from clutchid.measurements import DUTY_ROUNDING, check_duties
from clutchid.messages import sample_count
from clutchid.model.actuator import Actuator
from clutchid.strokes import rule
from clutchid.strokes.sampled import runs
from clutchid.strokes.stroke import RESOLUTION

Verdicts: TypeAlias = NDArray[np.uint8]

#: A position is none further beyond the stops than this in m: a vented rest may have moved by 5 mm since the
#: calibration (`clutchid.strokes.rest_shift.FURTHEST`), and 2 mm are the gain of a sensor (4 %) and noise.
_BEYOND_STOPS = 7e-3

#: Absolute pressures in Pa of a vented or filled chamber, below 0.3 bar no brake system vents, and of an air supply.
_PRESSURES, _SUPPLY = (0.3e5, rule.MOST_SUPPLY), (rule.LEAST_SUPPLY, rule.MOST_SUPPLY)

#: Factors: on the conductances of the valves and on rates of pressure and velocity, and on the viscous friction, by
#: which a truck may differ from the actuator that it is compared with: three standard deviations of their priors.
_FASTER, _FREER = 1.5, 0.4

#: Noise of a sensor whose samples scatter less, in standard deviations of `SENSORS`: once in 10^15 samples.
_DEVIATIONS = 8.0

#: Samples for which a sensor may repeat its value because it is slower than the recording, and the longest gap in s
#: over which a step is judged. The resolution of the clock is within it: no rounding decides on a sample.
_REPEATS, _LONGEST_GAP = 15, 0.05

#: Where more than this share of a channel were none, its unit, its sign or its zero is wrong, which the checks say.
_MOST = 0.2


class Motion(NamedTuple):
    """Largest rates that are possible in a recording of an actuator.

    Largest velocity of the piston in m/s, its largest acceleration in an interval in m/s², and the largest rate of the
    pressure in Pa/s.
    """

    velocity: float
    acceleration: float
    pressure_rate: float


def possible_motion(actuator: Actuator, interval: float) -> Motion:
    r"""Motion that the air and the forces of an actuator allow within an interval of `interval` s.

    The air that the open supply valve passes at most, :math:`w = \rho_0 C_{vs} P_S`, moves a piston without load
    against its friction, :math:`(P_0 A_A + D_v v) v = w R T_0`; without motion it fills the dead volume,
    :math:`\dot p_A = \gamma w R T_0 / V_{0A}`. Force in excess of friction moves the piston at once, so that the
    imbalance is that of a breakaway and of the pressure gained in the interval.

    Examples
    --------
    The paper's piston opens a clutch in no less than 30 ms:

    >>> motion = possible_motion(Actuator(), 1e-3)
    >>> f"{motion.velocity:.2f} m/s, {motion.pressure_rate * 1e-8:.2f} bar/ms"
    '0.84 m/s, 0.24 bar/ms'
    """
    p = actuator.parameters
    power = _FASTER * p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0
    force, friction = p.P_0 * p.A_A, _FREER * p.D_v
    velocity = 2.0 * power / (force + math.sqrt(force**2 + 4.0 * friction * power))
    rate = 1.4 * power / p.V_0A
    return Motion(velocity, _FASTER * (2.0 * p.F_C + p.A_A * rate * interval) / p.M, rate)


#: Of each measured column the least and the largest limits for which its samples are judged alike.
Bounds: TypeAlias = Mapping[str, tuple[rule.ValueLimits, rule.ValueLimits]]

#: Rates may be larger for samples without a step; and a share of them by which a recording is judged first: then it
#: holds for nearly all actuators that follow.
_SHARE = 0.5


def limits(actuator: Actuator, column: str, interval: float) -> rule.ValueLimits:
    """Limits of the position or of the pressure in chamber A, for samples that are `interval` s apart."""
    motion = possible_motion(actuator, interval)
    if column == "position":
        low, high = -_BEYOND_STOPS, actuator.parameters.y_max + _BEYOND_STOPS
        speed, acceleration = motion.velocity, motion.acceleration
    else:
        (low, high), speed, acceleration = _PRESSURES, motion.pressure_rate, math.inf
    gap = max(_LONGEST_GAP, HOLE * interval) + 0.5 * RESOLUTION
    return records.new_record(
        rule.ValueLimits, low=low, high=high, speed=speed, acceleration=acceleration,
        noise=_DEVIATIONS * SENSORS[column].noise, repeats=_REPEATS * interval, gap=gap,
        believed_after=max(rule.BELIEVED, 2.0 * gap), interval=interval,
    )  # fmt: skip


def new_watch() -> rule.Watch:
    """The watch of a column before its first sample."""
    return records.new_record(
        rule.Watch, seen=np.nan, doubt=np.nan, supply=np.nan, exhaust=np.nan, quantum=np.inf, step=np.nan, began=np.nan
    )


def watched(
    watch: rule.Watch, bounds: rule.ValueLimits, log: Log, column: str, duties: FloatArray
) -> tuple[Verdicts, FloatArray, rule.Watch]:
    """Verdicts on a column of a recording, or on the next part of one; parts of any length give the same.

    Parameters
    ----------
    watch, bounds
        Before them, and `limits`.
    duties
        The `Log.duties` of the recording.

    Returns
    -------
    verdicts, since, watch
        Of `plausible`, times in s that belong to them, and the watch after them.
    """
    verdicts, since = np.zeros(len(log), dtype=np.uint8), np.full((len(log), 2), np.nan)
    after = records.record_copy(watch)
    follow = kernels_in("clutchid.strokes.plausible").follow_values
    follow(after, bounds, log.time, log[column], duties, verdicts, since)
    return verdicts, since, after


def is_value(verdicts: NDArray[np.uint8]) -> BoolArray:
    """Whether each sample is a value; `np.isin` takes 20 times as long for a single one."""
    values: BoolArray = (verdicts == rule.VALUE) | (verdicts == rule.EXPLAINED)
    return values


def ends_stretch(verdicts: NDArray[np.uint8]) -> BoolArray:
    """Whether a stretch without holes ends at each sample: a jump that stays, or channels that are repeated."""
    ends: BoolArray = (verdicts == rule.SEAM) | (verdicts == rule.REPEATED)
    return ends


class Fault(NamedTuple):
    """Samples of a channel that are no values.

    Attributes
    ----------
    channel, kind
        Column, or "all channels"; "beyond", "step", "seam" (a step that stays) or "repeated".
    samples, first : 1, s
        Number of samples, and time of the first.
    sentence
        What they are.
    """

    channel: str
    kind: str
    samples: int
    first: float
    sentence: str

    @property
    def moves_zero(self) -> bool:
        """Whether the position may count from another zero from then on."""
        return self.kind == "seam" and self.channel == "position"


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """A recording in which impossible values are missing, the faults, and the limits of possible values."""

    log: Log
    faults: tuple[Fault, ...] = ()
    bounds: Bounds = field(default_factory=dict)

    def hold_for(self, actuator: Actuator) -> bool:
        """Whether they are those of another actuator too."""
        return _within(self.bounds, actuator)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The faults, with the name of the recording."""
        return tuple(f"{self.log.name}: {fault.sentence}" for fault in self.faults)

    @property
    def warned(self) -> Log:
        """The recording with the faults among its warnings."""
        together = tuple(dict.fromkeys((*self.log.warnings, *self.warnings)))
        return replace(self.log, warnings=together) if self.faults else self.log


def values_of(log: Log, actuator: Actuator) -> Values:
    """A recording in which impossible values are missing; the same object if there are none.

    Duty cycles become missing, which ends a segment, where a logger repeats its samples, and at a step that stays.

    Parameters
    ----------
    log : Log
        Any columns; position and pressure are judged where both duty cycles are there too.
    actuator : Actuator
        Its stroke, valves, friction and supply say what is possible.

    Raises
    ------
    DataError
        If the duty cycles of the log have another unit, as those of a file would be refused for.

    Examples
    --------
    A sensor of 16 bit that has none for 2 ms:

    >>> t = 1e-3 * np.arange(1000)
    >>> y = np.where((t > 0.5) & (t < 0.5025), 65.535e-3, 1e-5 * np.sin(40 * t))
    >>> values = values_of(Log(t, {"position": y, **dict.fromkeys(INPUTS, 0 * t)}), Actuator())
    >>> values.faults[0].sentence
    'position: 2 samples beyond the stops, the first at 0.501 s (65.53 mm), treated as missing.'
    """
    judged: Any = log.derived.get(values_of)
    if judged is not None and _within(judged[2], actuator):
        cleaned, *rest = judged
        return Values(log if cleaned is None else cleaned, *rest)
    if judged is None:
        check_duties(log)
    missing, faults = dict[str, BoolArray](), list[Fault]()
    for name in (*INPUTS, "pressure_supply"):
        if name in log:
            faults += _out_of_range(log, name, missing)
    measured = [name for name in ("position", "pressure_a") if name in log and all(duty in log for duty in INPUTS)]
    interval = sample_interval(log.time, 0.0) if measured else 0.0
    bounds = dict[str, tuple[rule.ValueLimits, rule.ValueLimits]]()
    for name in measured if interval > 0.0 else ():
        bounds[name] = _judge(log, name, limits(actuator, name, interval), missing, faults)
    if not faults:
        log.derived[values_of] = None, (), bounds
        return Values(log, (), bounds)
    columns = {name: np.where(missing[name], np.nan, x) if name in missing else x for name, x in log.columns.items()}
    edges = {
        name: (stamps, np.where(outside(name, x), np.nan, x)) if name in missing else (stamps, x)
        for name, (stamps, x) in log.edges.items()
    }
    cleaned = replace(log, columns=columns, edges=edges)
    log.derived[values_of] = cleaned, tuple(faults), bounds
    return Values(cleaned, tuple(faults), bounds)


def _within(bounds: Bounds, actuator: Actuator) -> bool:
    """Whether the limits of an actuator are within `bounds`."""
    for name, (least, largest) in bounds.items():
        now = limits(actuator, name, least.interval)
        values = (records.values_in(record).values() for record in (least, now, largest))
        if not all(low <= x <= high for low, x, high in zip(*values, strict=True)):
            return False
    return True


def with_inputs_in_range(log: Log) -> Log:
    """A recording with duty cycles outside 0 to 1 missing, if there are any; else the same object.

    Raises
    ------
    DataError
        If they are many.
    """
    check_duties(log)
    wrong = {name: mask for name in INPUTS if name in log and (mask := outside(name, log[name])).any()}
    return (
        log.with_columns(**{name: np.where(mask, np.nan, log[name]) for name, mask in wrong.items()}) if wrong else log
    )


#: Duty cycles with rounding, and pressures of an air supply. Where most of a column is outside, it has another unit: a
#: duty cycle is refused, see `check_duties`; a supply pressure counts as not recorded.
_RANGES = {**dict.fromkeys(INPUTS, (-DUTY_ROUNDING, 1.0 + DUTY_ROUNDING)), "pressure_supply": _SUPPLY}


def outside(name: str, values: FloatArray) -> BoolArray:
    """Whether each value is no duty cycle, or no pressure of an air supply; False where it is missing."""
    low, high = _RANGES[name]
    return (values < low) | (values > high)


_BEYOND = {
    "position": "beyond the stops",
    "pressure_a": "outside what a chamber has (0.3 to 16 bar absolute)",
    "pressure_supply": "outside what an air supply has (3 to 16 bar absolute)",
    **dict.fromkeys(INPUTS, "outside 0 to 1"),
}
#: Columns that stand still together where a logger repeats its samples.
_WATCHED = frozenset(["position", "pressure_a", "pressure_supply", *INPUTS])
_STEP = {"position": "than a piston moves", "pressure_a": "than a valve fills"}


def _out_of_range(log: Log, name: str, missing: dict[str, BoolArray]) -> list[Fault]:
    wrong = outside(name, log[name])
    if not wrong.any():
        return []
    missing[name] = wrong
    fault = _fault(log, name, "beyond", wrong, _BEYOND[name])
    if _too_many(log, name, wrong):
        fault = fault._replace(sentence=f"{fault.sentence[:-1]}; correct the unit in its heading if it is another one.")
    return [fault]


def _too_many(log: Log, name: str, wrong: BoolArray) -> bool:
    return bool(np.sum(wrong) > _MOST * np.sum(np.isfinite(log[name])))


def _judge(
    log: Log, name: str, bounds: rule.ValueLimits, missing: dict[str, BoolArray], faults: list[Fault]
) -> tuple[rule.ValueLimits, rule.ValueLimits]:
    """Add the impossible values of a measured column to `missing` and `faults`; returns the limits of possible values.

    The rates only limit steps: without one, larger rates change nothing. Smaller ones are tried first.
    """
    duties, least, largest = log.duties(), bounds, bounds
    for share in (_SHARE, 1.0):
        narrow, wide = records.record_copy(bounds), records.record_copy(bounds)
        narrow.speed, narrow.acceleration = share * bounds.speed, share * bounds.acceleration
        wide.speed, wide.acceleration = np.inf, np.inf
        verdicts, since, _ = watched(new_watch(), narrow, log, name, duties)
        if not (verdicts == rule.STEP).any():
            least, largest = narrow, wide
            break
    if verdicts.any():
        _add_faults(log, name, verdicts, since, missing, faults)
    return least, largest


def _add_faults(
    log: Log, name: str, verdicts: Verdicts, since: FloatArray, missing: dict[str, BoolArray], faults: list[Fault]
) -> None:
    seams = _settled(log, name, verdicts, since)
    beyond, steps = verdicts == rule.BEYOND, verdicts == rule.STEP
    if _too_many(log, name, beyond | steps):
        return
    seam_times = {fault.first for fault in faults if fault.kind == "seam"}
    missing[name] = missing.get(name, False) | beyond | steps
    if beyond.any():
        faults.append(_fault(log, name, "beyond", beyond, _BEYOND[name]))
    if steps.any():
        faults.append(_fault(log, name, "step", steps, f"further from the samples before {_STEP[name]} in that time"))
    repeated = _repeated(log, name, verdicts, since)
    if repeated.any() and not any(fault.kind == "repeated" for fault in faults):
        words = "that repeat the samples before them, as if the logger had stopped"
        faults.append(_fault(log, "all channels", "repeated", repeated, words))
        for channel in log.columns.keys() & _WATCHED:
            missing[channel] = missing.get(channel, False) | repeated
    for i in seams:
        if log.time[i] not in seam_times:
            for channel in INPUTS:
                missing[channel] = missing.get(channel, False) | (np.arange(len(log)) == i)
            faults.append(_seam(log, name, i, missing[name]))


def _settled(log: Log, name: str, verdicts: Verdicts, since: FloatArray) -> list[int]:
    """Samples at which a column jumps to stay; the samples behind a step that is settled count, `verdicts` says so.

    What counted for less than `BELIEVED` s before a step was the outlier itself.
    """
    seams = []
    for i in np.flatnonzero(np.isin(verdicts, (rule.SEAM, rule.EXPLAINED))).tolist():
        step, began = (int(np.searchsorted(log.time, at)) for at in since[i])
        later, explained = verdicts[step : i + 1], verdicts[i] == rule.EXPLAINED
        later[later != rule.BEYOND] = rule.VALUE
        if explained:
            continue
        if log.time[step] - log.time[began] < rule.BELIEVED:
            before = verdicts[began:step]
            before[np.isfinite(log[name][began:step]) & (before == rule.VALUE)] = rule.STEP
        else:
            seams.append(step)
    return seams


def _repeated(log: Log, name: str, verdicts: Verdicts, since: FloatArray) -> BoolArray:
    """Samples that a logger repeated in all channels; a column at its own limit is saturated, not repeated."""
    repeated, values = np.zeros(len(log), dtype=bool), log[name]
    others = [log[other] for other in log.columns.keys() & _WATCHED]
    for a, b in runs(verdicts == rule.REPEATED):
        first = int(np.argmin(np.abs(log.time - since[a, 1])))
        end = b + int(np.argmax(np.append(values[b:] != values[a], True)))
        still = all(not np.ptp(other[first:end]) > 0.0 for other in others)
        if still and np.nanmin(values) < values[a] < np.nanmax(values):
            repeated[first + 1 : end] = True
    return repeated


_SHOWN = {"position": ("mm", 1e3), **dict.fromkeys(("pressure_a", "pressure_supply"), ("bar", 1e-5))}


def _shown(name: str, value: float, sign: str = "") -> str:
    unit, factor = _SHOWN.get(name, ("", 1.0))
    return f"{value * factor:{sign}.4g} {unit}".strip()


def _fault(log: Log, name: str, kind: str, wrong: BoolArray, words: str) -> Fault:
    """A fault of samples that become missing."""
    count, first = int(wrong.sum()), int(np.argmax(wrong))
    shown = f" ({_shown(name, float(log[name][first]))})" if name in log else ""
    sentence = (
        f"{name}: {sample_count(count)} {words}, the first at {log.time[first]:.3f} s{shown}, treated as missing."
    )
    return Fault(name, kind, count, float(log.time[first]), sentence)


def _seam(log: Log, name: str, i: int, missing: BoolArray) -> Fault:
    """A fault of a column that jumps to sample `i` and stays."""
    values = log[name]
    before = np.flatnonzero(np.isfinite(values[:i]) & ~missing[:i])[-1]
    by = _shown(name, float(values[i] - values[before]), "+")
    sentence = (
        f"{name} jumps by {by} at {log.time[i]:.3f} s, faster {_STEP[name]}, and stays there: the sensor was zeroed "
        "again, or two recordings were joined; a segment ends there."
    )
    return Fault(name, "seam", 1, float(log.time[i]), sentence)
