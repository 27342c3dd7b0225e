"""Pressure that the sensor of chamber A shows while the chamber is vented, from the rests of a recording."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.log import INPUTS, BoolArray, FloatArray, Log, sample_interval
from clutchid.log.units import UNITS
from clutchid.measurements import UNIT_KEY, VENTED_KEY
from clutchid.parameters import known_ambient
from clutchid.strokes.rest_level import CLOSED, LOW_END
from clutchid.strokes.sampled import runs

if TYPE_CHECKING:
    from clutchid.model.actuator import Actuator


class VentedPrior(NamedTuple):
    """Output of a pressure sensor at a vented chamber before a rest is seen: mean and standard deviation in Pa."""

    mean: float
    std: float
    source: str


#: Prior of an absolute sensor: weather, altitude and the sensor's offset together.
ABSOLUTE = VentedPrior(1.03e5, 6e3, "sea level to 500 m, 3 kPa of weather, 2 kPa of offset; a guess, CONTRACT.md")

#: Standard deviation in Pa of the offset of a sensor, beside an ambient pressure that is known.
OFFSET_PRIOR = VentedPrior(0.0, 2e3, "half a bar of range to one per cent; that of the virtual trucks is up to 2 kPa")

#: Largest error in Pa that is taken for one of zero: 3 % of a range of 10 bar, the total error of such a sensor over
#: its life and temperature by data sheets; a guess. More is a wrong unit, or a chamber that is not vented.
LARGEST_ZERO = 3e4

#: Most by which rests of a vented chamber lie above another pressure, in Pa, beside noise: as an offset may.
_ALIKE = 6e3

#: Length in s of a bin, of which the mean is taken, longer than noise of sensors is correlated; fewest bins of a rest.
_BIN, _FEWEST = 0.02, 4

#: From this duty cycle on a valve is open whatever its dead zone. Between `CLOSED` and it a chamber may look vented:
#: those of trucks 2 and 3 of `../shared/data/trucks` stay 0.07 and 0.14 bar above it at 0.16.
_OPEN = 0.5

#: Last parts of a rest in which the pressure may be level: of the one at the start, and of one after a stroke.
_AT_START, _AFTER_STROKE = (1.0, 0.5, 0.25), (1 / 2, 1 / 3, 1 / 4)

#: A decay is over where the pressure has fallen by this multiple of what it may still fall in a last part as long;
#: elsewhere, such as at the start, it may go on with this time constant in s. Those of trucks 0 to 5 of both families
#: are below 0.17 s.
_DECAYED, _SLOWEST = 2.0, 0.5

#: Smallest standard deviation in Pa of the pressure of a rest, and drift over a rest that counts as none.
_LEAST = 100.0

#: Standard deviations by which a pressure differs significantly from its prior, or from another.
SIGNIFICANT = 3.0


#: Fault of a recording without a settled vented rest, and its remedy.
UNSETTLED = "the pressure never settles while the chamber is vented"
RECORD_REST = "record a second at rest with the exhaust valve open"


class VentedPressure(NamedTuple):
    """Output of the sensor of chamber A at a settled vented rest, and its standard deviation, in Pa.

    `closed`: at the start of the recording, with both valves closed; else a decay may go on that the noise hides.
    """

    mean: float
    std: float
    closed: bool = False


class _Bins(NamedTuple):
    """Means over `_BIN` s: time and pressure; whether the supply is closed, the exhaust open, the piston low."""

    time: FloatArray
    pressure: FloatArray
    closed: BoolArray
    opened: BoolArray
    low: BoolArray


class _Level(NamedTuple):
    """Mean pressure of rests with its standard deviation and that of a bin, and the drift over a rest, all in Pa.

    `seconds` is the length of a rest, `fall` how far it lies below the pressure for as long before.
    """

    mean: float
    std: float
    drift: float
    drift_std: float
    noise: float
    seconds: float
    bins: int
    fall: float = 0.0

    @property
    def hidden(self) -> float:
        """Standard deviation in Pa of a decay that goes on, which the noise hides."""
        over = self.fall >= _DECAYED * (abs(self.drift) + self.drift_std)
        return self.drift_std * (1.0 if over else max(_SLOWEST / self.seconds, 1.0))

    @property
    def flat(self) -> bool:
        return abs(self.drift) <= max(SIGNIFICANT * self.drift_std, _LEAST)


def vented_prior(log: Log) -> VentedPrior:
    """Output of the pressure sensor of a recording while the chamber is vented, before a rest is seen."""
    ambient = log.metadata.get("ambient_Pa" if _is_gauge(log) else VENTED_KEY)
    return ABSOLUTE if ambient is None else VentedPrior(float(ambient), OFFSET_PRIOR.std, OFFSET_PRIOR.source)


def _is_gauge(log: Log) -> bool:
    return UNITS.get(log.metadata.get(UNIT_KEY, "Pa"), UNITS["Pa"]).gauge


def with_ambient(actuator: Actuator, logs: Sequence[Log]) -> tuple[Actuator, tuple[str, ...]]:
    """The actuator with the P_0 that gauge pressures of the recordings count from, and a note of it.

    Only in place of Appendix A's P_0, which nobody has measured: the model would vent 8 kPa above the sensor.
    """
    P_0 = actuator.parameters.P_0
    added = next((float(log.metadata.get("ambient_Pa", P_0)) for log in logs if _is_gauge(log)), P_0)
    if known_ambient(P_0) is not None or added == P_0:
        return actuator, ()
    said = (
        f"the ambient pressure, P_0, is {added * 1e-5:.4g} bar, the reference of the gauge pressures, instead of "
        f"Appendix A's {P_0 * 1e-5:.4g} bar."
    )
    return actuator.replace({"P_0": added}), (said,)


def remedy(logs: Iterable[Log]) -> str:
    """Source of the vented pressure of recordings without a settled rest."""
    return RECORD_REST + (", or give --ambient" if any(vented_prior(log) is ABSOLUTE for log in logs) else "")


def vented_pressure(log: Log) -> VentedPressure | None:
    """Output of the pressure sensor at the settled vented rest of a recording; None without such a rest.

    A rest is settled where its pressure is flat: the slope lies within its standard error. At the start of the
    recording the valves may be closed, unless a later pressure lies below; after a stroke the exhaust valve must be
    open, and the decay over. Neither may lie above the prior by three standard deviations, or with a zero error of the
    sensor, `LARGEST_ZERO`: only if there is a rest with an open exhaust valve, and no pressure clearly below it.

    Parameters
    ----------
    log : Log
        With a pressure in Pa, a position in m, and the duty cycles of the valves.

    Examples
    --------
    A rest at 1.01 bar before a stroke, and a recording that begins in that stroke:

    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> noise = 1e3 * np.random.default_rng(0).standard_normal(2000)
    >>> stroke = {"pressure_a": 1.01e5 + 3e5 * (t > 1.0) + noise, "position": 0.02 * (t > 1.0)}
    >>> log = Log(t, stroke | {"duty_supply": 1.0 * (t > 1.0), "duty_exhaust": np.zeros(2000)})
    >>> f"{vented_pressure(log).mean / 1e5:.2f} bar", vented_pressure(log.slice(1001, 2000))
    ('1.01 bar', None)
    """
    bins = _bins(log)
    if bins is None:
        return None
    prior, (start, stop), later = vented_prior(log), _at_start(bins), _after_strokes(bins)
    opens = start is not None and bool(bins.opened[stop - start.bins : stop].all())
    settled, shown = [], [level for level in (later, start if opens else None) if level is not None]
    vents = any(not _above(level, None, bins.pressure, _ALIKE) for level in shown)
    if start is not None and _possible(start, prior, vents=vents) and not _above(start, later, bins.pressure[stop:]):
        if not bins.opened[:stop].any():
            rest = np.abs(log.time - bins.time[stop - start.bins : stop].mean()) <= (start.seconds + _BIN) / 2.0
            # the median, because single samples may be none
            return VentedPressure(float(np.nanmedian(log["pressure_a"][rest])), max(start.std, _LEAST), closed=True)
        settled.append(start)
    if later is not None and _possible(later, prior, vents=vents):
        settled.append(later)
    levels = [VentedPressure(level.mean, max(math.hypot(level.std, level.hidden), _LEAST)) for level in settled]
    return min(levels, key=lambda level: level.std, default=None)


def sensor_zero(log: Log) -> tuple[float, str]:
    """Zero error in Pa of the pressure sensor that is to be taken off, and a sentence of it; 0 where the prior holds.

    A low rest of an absolute sensor without a stated ambient pressure is taken for altitude.

    Examples
    --------
    A gauge sensor that shows 0.07 bar(g) before a stroke, with the exhaust valve open:

    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> stroke = {"pressure_a": 1.083e5 + 3e5 * (t > 1.0), "position": 0.02 * (t > 1.0)}
    >>> gauge = {"pressure_a_unit": "bar(g)", "ambient_Pa": "101300.0"}
    >>> log = Log(t, stroke | {"duty_supply": 1.0 * (t > 1.0), "duty_exhaust": 1.0 * (t <= 1.0)}, metadata=gauge)
    >>> sensor_zero(log)[1].partition(": ")[2]
    'the zero of the sensor is off by +0.070 bar, which is subtracted.'
    """
    prior, rest = vented_prior(log), vented_pressure(log)
    if rest is None or abs(off := rest.mean - prior.mean) <= SIGNIFICANT * math.hypot(prior.std, rest.std):
        return 0.0, ""
    shown = f"{off * 1e-5:.3f} bar(g)" if _is_gauge(log) else f"{rest.mean * 1e-5:.3f} bar"
    settles = f"pressure_a settles at {shown} with the chamber vented"
    if off < (0.0 if prior is ABSOLUTE else -LARGEST_ZERO):
        return 0.0, (
            f"{settles}: the reason is altitude, as a calibration assumes, or the zero of the sensor is off by "
            f"{off * 1e-5:+.2f} bar; give the ambient pressure with --ambient."
        )
    about = "about " if prior is ABSOLUTE else ""
    than = "" if _is_gauge(log) else f", where the ambient pressure is {about}{prior.mean * 1e-5:.4g} bar"
    return off, f"{settles}{than}: the zero of the sensor is off by {off * 1e-5:+.3f} bar, which is subtracted."


def without_zeros(logs: Sequence[Log]) -> list[Log]:
    """Recordings without the zero errors of their pressure sensors.

    Where one is off, each counts from its own rest if the ambient pressure is known, so that they share it.
    """
    zeros = [sensor_zero(log)[0] for log in logs]
    for i, log in enumerate(logs if any(zeros) else ()):
        prior, rest = vented_prior(log), vented_pressure(log)
        if rest is not None and prior is not ABSOLUTE and abs(rest.mean - prior.mean) <= LARGEST_ZERO:
            zeros[i] = rest.mean - prior.mean
    return [
        log.with_columns(pressure_a=log["pressure_a"] - zero) if zero else log
        for log, zero in zip(logs, zeros, strict=True)
    ]


def lowest_pressure(log: Log) -> float:
    """Lowest mean pressure over `_FEWEST` bins in Pa, which a vented chamber does not exceed; infinity without one."""
    bins = _bins(log)
    return math.inf if bins is None else float(np.min(_means(bins.pressure, _FEWEST), initial=math.inf))


def _bins(log: Log) -> _Bins | None:
    """The bins with a pressure and without a hole in time; None where the recording lacks a column or is too short."""
    if any(name not in log for name in ("pressure_a", "position", *INPUTS)) or len(log) < 2:
        return None
    width = max(1, round(_BIN / sample_interval(log.time)))
    count = len(log) // width

    def blocks(values: FloatArray) -> FloatArray:
        return values[: count * width].reshape(count, width)

    pressure, position = blocks(log["pressure_a"]), blocks(log["position"])
    usable = np.isfinite(pressure).any(axis=1) & np.isfinite(position).any(axis=1)
    usable &= np.ptp(blocks(log.time), axis=1) <= 2.0 * width * sample_interval(log.time)
    if usable.sum() < _FEWEST:
        return None
    level = np.nanmean(position[usable], axis=1)
    return _Bins(
        blocks(log.time)[usable].mean(axis=1),
        np.nanmean(pressure[usable], axis=1),
        np.nan_to_num(blocks(log["duty_supply"]), nan=1.0)[usable].max(axis=1) <= CLOSED,
        np.nan_to_num(blocks(log["duty_exhaust"]))[usable].mean(axis=1) >= _OPEN,
        level <= level.min() + LOW_END * np.ptp(level),
    )


def _at_start(bins: _Bins) -> tuple[_Level | None, int]:
    """Level of the rest before the supply valve opens for the first time, and the bin where that is."""
    rests = runs(bins.closed & bins.low)
    if not rests or rests[0][0] > 0:
        return None, 0
    return _flat(bins, rests[0], _AT_START), rests[0][1]


def _after_strokes(bins: _Bins) -> _Level | None:
    """Level of the rests with an open exhaust valve together, but for those that lie above others."""
    openings, pooled = runs(bins.closed & bins.opened), []
    for part in _AFTER_STROKE:
        levels = [level for opening in openings if (level := _last(bins, opening, part))]
        if levels:
            pooled.append(_pooled(levels))
    return min((level for level in pooled if level.flat), key=lambda level: level.hidden, default=None)


def _last(bins: _Bins, opening: tuple[int, int], part: float) -> _Level | None:
    """Level of the last part of an opening of the exhaust valve, with the fall to it; None where it is no rest."""
    begin, end = opening[1] - int(part * (opening[1] - opening[0])), opening[1]
    level = _flat(bins, opening, (part,))
    if level is None or not bins.low[begin:end].all():
        return None
    return level._replace(fall=float(bins.pressure[2 * begin - end : begin].mean()) - level.mean)


def _flat(bins: _Bins, rest: tuple[int, int], parts: Sequence[float]) -> _Level | None:
    """Level of the longest last part of a rest in which its pressure is flat; None without one."""
    a, b = rest
    for length in (int(part * (b - a)) for part in parts):
        if length >= _FEWEST:
            level = _level(bins.time[b - length : b], bins.pressure[b - length : b])
            if level.flat:
                return level
    return None


def _level(time: FloatArray, pressure: FloatArray) -> _Level:
    """Level and drift of a rest, by a straight line."""
    centred, mean = time - time.mean(), float(pressure.mean())
    moment, seconds = float(centred @ centred), float(np.ptp(time))
    slope = float(centred @ pressure) / moment
    beside = pressure - mean - slope * centred
    noise = max(float(np.sqrt(beside @ beside / (time.size - 2))), _LEAST)
    drift_std = noise * seconds / math.sqrt(moment)
    return _Level(mean, noise / math.sqrt(time.size), slope * seconds, drift_std, noise, seconds, time.size)


def _pooled(rests: Sequence[_Level]) -> _Level:
    """Level and drift of several rests together; those that lie above the others are left out."""
    counts = np.array([level.bins for level in rests], dtype=np.float64)
    weights = counts / counts.sum()
    means, stds, drifts, drift_stds, noises = np.array([level[:5] for level in rests]).T
    mean = float(weights @ means)
    highest = int(np.argmax((means - mean) / stds))
    if len(rests) > 1 and means[highest] - mean > SIGNIFICANT * stds[highest]:
        return _pooled([*rests[:highest], *rests[highest + 1 :]])
    between = float(np.sqrt(weights**2 @ (means - mean) ** 2))
    return _Level(
        mean, max(float(np.sqrt(weights**2 @ stds**2)), between), float(weights @ drifts),
        float(np.sqrt(weights**2 @ drift_stds**2)), float(weights @ noises), rests[0].seconds, int(counts.sum()),
        float(weights @ [level.fall for level in rests]),
    )  # fmt: skip


def _possible(level: _Level, prior: VentedPrior, *, vents: bool) -> bool:
    """Whether a level lies no further above its prior than the offset of a sound sensor, or a zero where it vents.

    Below its prior it is the prior that is wrong, for nothing evacuates.
    """
    zero = LARGEST_ZERO if vents else 0.0
    return level.mean - prior.mean <= zero + SIGNIFICANT * math.hypot(prior.std, level.std)


def _above(start: _Level, later: _Level | None, pressure: FloatArray, least: float = _LEAST) -> bool:
    """Whether the rest at the start lies above later rests or a later pressure, by more than noise and `least`."""
    if later is not None:
        difference = math.hypot(start.std, later.std, later.hidden)
        if start.mean - later.mean > max(SIGNIFICANT * difference, _LEAST):
            return True
    for width in {_FEWEST, start.bins}:
        means = _means(pressure, width)
        # the lowest of so many means lies below the mean of all
        extreme = SIGNIFICANT + math.sqrt(2.0 * math.log(max(means.size / width, 1.0)))
        allowed = max(extreme * start.noise * math.sqrt(1.0 / start.bins + 1.0 / width), least)
        if np.any(means < start.mean - allowed):
            return True
    return False


def _means(values: FloatArray, width: int) -> FloatArray:
    """Means over `width` neighbouring values."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return (sums[width:] - sums[:-width]) / width if values.size >= width else np.zeros(0)
