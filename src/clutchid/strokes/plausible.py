"""Compiled rule for samples that are not values: one pass over a column, sample by sample, as a control unit would."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.strokes import rule


@kernel
def noisy(watch: FloatArray, limits: FloatArray) -> bool:
    """Whether the noise of the sensor was visible before the present run of equal samples."""
    least: float = max(
        rule.TOGGLED * watch[rule.QUANTUM], rule.COMPUTED * (limits[rule.RANGE_HIGH] - limits[rule.RANGE_LOW])
    )
    return bool(watch[rule.SCATTER_BEFORE] >= least)


@kernel
def possible_step(watch: FloatArray, limits: FloatArray, elapsed: float, dt: float, rate: float) -> float:
    """Largest step in `dt` s, for a value first read `elapsed` s ago that changed at `rate` before."""
    held = dt
    if noisy(watch, limits) and elapsed > rule.IMPROBABLE * limits[rule.INTERVAL]:
        held = elapsed
    elif watch[rule.FRESH] < rule.READ_ANEW:
        held = max(dt, min(elapsed, limits[rule.REPEATS]))
    starts = min(limits[rule.SPEED] * held, 0.5 * limits[rule.ACCELERATION] * held * held)
    goes_on = rule.FASTER * abs(rate) * elapsed if elapsed <= limits[rule.GAP] else 0.0
    largest: float = max(limits[rule.NOISE], rule.SCATTERED * watch[rule.SCATTER]) + goes_on + starts
    return largest


@kernel
def restart(watch: FloatArray, t: float, y: float) -> None:
    """Take a sample whatever was before."""
    watch[rule.SEEN], watch[rule.SINCE], watch[rule.AGE], watch[rule.LAST] = t, t, t, y
    watch[rule.RATE_NOW], watch[rule.DIFFERENCE], watch[rule.DOUBT] = 0.0, 0.0, math.nan
    watch[rule.TURNS_BEFORE], watch[rule.SCATTER_BEFORE] = watch[rule.TURNS], watch[rule.SCATTER]


@kernel
def take(watch: FloatArray, limits: FloatArray, t: float, y: float) -> None:
    """Take a sample that follows the last one."""
    difference, elapsed = y - watch[rule.LAST], t - watch[rule.SINCE]
    anew = watch[rule.FRESH] >= rule.READ_ANEW
    if difference != 0.0 or anew:
        second = abs(difference - watch[rule.DIFFERENCE])
        watch[rule.COUNT] += 1.0
        watch[rule.SCATTER] += max(rule.SLOW, 1.0 / watch[rule.COUNT]) * (
            min(second, 3.0 * watch[rule.SCATTER] + limits[rule.NOISE]) - watch[rule.SCATTER]
        )
        turned = 1.0 if difference * watch[rule.DIFFERENCE] < 0.0 else 0.0
        watch[rule.TURNS] += rule.SLOWEST * (turned - watch[rule.TURNS])
        watch[rule.DIFFERENCE] = difference
    if difference != 0.0:
        watch[rule.RATE_NOW] += rule.QUICK * (difference / elapsed - watch[rule.RATE_NOW])
        if not anew:
            watch[rule.FRESH] = watch[rule.FRESH] + 1.0 if elapsed < 1.5 * limits[rule.INTERVAL] else 0.0
        watch[rule.QUANTUM] = min(watch[rule.QUANTUM], abs(difference))
        watch[rule.TURNS_BEFORE], watch[rule.SCATTER_BEFORE] = watch[rule.TURNS], watch[rule.SCATTER]
        watch[rule.SINCE], watch[rule.LAST] = t, y
    watch[rule.SEEN] = t


@kernel
def doubt(watch: FloatArray, t: float, y: float) -> None:
    """Begin to doubt samples with this one."""
    watch[rule.DOUBT], watch[rule.DOUBT_SEEN], watch[rule.DOUBT_SINCE] = t, t, t
    watch[rule.DOUBTED], watch[rule.DOUBT_RATE] = y, 0.0


@kernel
def fills_gap(watch: FloatArray, limits: FloatArray, t: float, y: float) -> bool:
    """Whether the motion behind a step explains it, as after lost messages that a logger fills with the last value."""
    elapsed, step = t - watch[rule.SINCE], y - watch[rule.LAST]
    was_held = rule.IMPROBABLE * limits[rule.INTERVAL] < watch[rule.DOUBT] - watch[rule.SINCE] <= limits[rule.GAP]
    moves_on = watch[rule.DOUBT_RATE] * step > 0.0 and abs(step) <= rule.FASTER * abs(watch[rule.DOUBT_RATE]) * elapsed
    return bool(was_held and moves_on and t - watch[rule.DOUBT] <= rule.STANDS * limits[rule.INTERVAL])


@kernel
def doubted(watch: FloatArray, limits: FloatArray, t: float, y: float) -> int:
    """Verdict on a sample in doubt: it goes on from the others in doubt, from the last that counts, or from neither."""
    dt = t - watch[rule.DOUBT_SEEN]
    if abs(y - watch[rule.DOUBTED]) <= possible_step(watch, limits, dt, dt, watch[rule.DOUBT_RATE]):
        if y != watch[rule.DOUBTED]:
            watch[rule.DOUBT_SINCE] = t
        elif noisy(watch, limits) and t - watch[rule.DOUBT_SINCE] > rule.STANDS * limits[rule.INTERVAL]:
            watch[rule.DOUBT] = t  # a sensor that stands still after a step is not believed
        watch[rule.DOUBT_RATE] += rule.QUICK * ((y - watch[rule.DOUBTED]) / dt - watch[rule.DOUBT_RATE])
        watch[rule.DOUBTED], watch[rule.DOUBT_SEEN] = y, t
        if fills_gap(watch, limits, t, y):
            return rule.EXPLAINED
        if t - watch[rule.DOUBT] < min(
            limits[rule.BELIEVED_AFTER],
            2.0 * (watch[rule.SEEN] - watch[rule.AGE]) + (rule.STANDS - 1.0) * limits[rule.INTERVAL],
        ):
            return rule.STEP
        return rule.SEAM
    away = t - watch[rule.SEEN]
    if (
        abs(y - watch[rule.LAST])
        <= limits[rule.NOISE] + rule.SCATTERED * watch[rule.SCATTER] + limits[rule.SPEED] * away
    ):
        return rule.VALUE
    doubt(watch, t, y)
    return rule.STEP


@kernel
def judge(watch: FloatArray, limits: FloatArray, t: float, y: float) -> int:
    """Verdict on the next sample."""
    if math.isnan(y) or not limits[rule.RANGE_LOW] <= y <= limits[rule.RANGE_HIGH]:
        watch[rule.EQUAL] = 0.0
        return rule.VALUE if math.isnan(y) else rule.BEYOND
    latest = watch[rule.SEEN] if math.isnan(watch[rule.DOUBT]) else watch[rule.DOUBT_SEEN]
    if not t - latest <= limits[rule.GAP]:
        restart(watch, t, y)
        return rule.VALUE
    if not math.isnan(watch[rule.DOUBT]):
        verdict = doubted(watch, limits, t, y)
        if verdict in (rule.VALUE, rule.EXPLAINED):
            take(watch, limits, t, y)
        return verdict
    step = possible_step(watch, limits, t - watch[rule.SINCE], t - watch[rule.SEEN], watch[rule.RATE_NOW])
    if abs(y - watch[rule.LAST]) > step:
        doubt(watch, t, y)
        return rule.STEP
    take(watch, limits, t, y)
    return rule.VALUE


@kernel
def judge_next(
    watch: FloatArray, limits: FloatArray, t: float, y: float, supply: float, exhaust: float, since: FloatArray
) -> int:
    """Verdict on the next sample, with both duty cycles, after which the watch has taken it.

    Parameters
    ----------
    since : (2,)
        See `follow_values`; else left as it is.
    """
    if supply != watch[rule.OTHER_0] or exhaust != watch[rule.OTHER_1]:
        watch[rule.OTHER_0], watch[rule.OTHER_1], watch[rule.OTHERS_SINCE] = supply, exhaust, t
    verdict = judge(watch, limits, t, y)
    if verdict in (rule.SEAM, rule.EXPLAINED):
        since[0], since[1] = watch[rule.DOUBT], watch[rule.AGE]
    if verdict == rule.SEAM:
        restart(watch, t, y)
    elif verdict in (rule.VALUE, rule.EXPLAINED) and not math.isnan(y):
        watch[rule.DOUBT] = math.nan
        watch[rule.EQUAL] = watch[rule.EQUAL] + 1.0 if t > watch[rule.SINCE] else 0.0
        turns, began = watch[rule.TURNS_BEFORE] * watch[rule.EQUAL], t - watch[rule.EQUAL] * limits[rule.INTERVAL]
        repeated = (
            turns > rule.IMPOSSIBLE
            and watch[rule.EQUAL] * limits[rule.INTERVAL] > limits[rule.GAP]
            and noisy(watch, limits)
        )
        if repeated and watch[rule.OTHERS_SINCE] < began + 0.5 * limits[rule.INTERVAL]:
            verdict, since[0] = rule.REPEATED, began
    return verdict


@kernel
def count_anew(watch: FloatArray, by: float) -> None:
    """Let the time begin `by` s later, for a clock of few digits."""
    watch[rule.SEEN], watch[rule.SINCE], watch[rule.AGE] = (
        watch[rule.SEEN] - by,
        watch[rule.SINCE] - by,
        watch[rule.AGE] - by,
    )
    watch[rule.DOUBT], watch[rule.DOUBT_SEEN] = watch[rule.DOUBT] - by, watch[rule.DOUBT_SEEN] - by
    watch[rule.DOUBT_SINCE], watch[rule.OTHERS_SINCE] = watch[rule.DOUBT_SINCE] - by, watch[rule.OTHERS_SINCE] - by


@kernel
def judge_supply(watch: FloatArray, recorded: float, pressure: float, closed: bool) -> bool:
    """Whether a supply pressure cannot be right, by that of the calibration and by its mean while no valve is open."""
    wrong = pressure < rule.LEAST_SUPPLY or pressure > rule.MOST_SUPPLY
    if closed and not wrong and not math.isnan(pressure):
        share = pressure / recorded - 1.0
        watch[0] = share if math.isnan(watch[0]) else watch[0] + rule.OF_SUPPLY * (share - watch[0])
        if abs(watch[0]) > rule.UNLIKE_SUPPLY:
            watch[1] = 1.0
        elif abs(watch[0]) < rule.LIKE_SUPPLY:
            watch[1] = 0.0
    return bool(wrong or (watch[1] > 0.0 and not math.isnan(pressure)))


@kernel
def follow_supply(
    watch: FloatArray, recorded: float, pressure: FloatArray, closed: NDArray[np.bool_], verdicts: NDArray[np.bool_]
) -> None:
    """Verdicts of `judge_supply` on the samples of a recording (n,), to be filled."""
    for i in range(pressure.size):
        verdicts[i] = judge_supply(watch, recorded, pressure[i], closed[i])


@kernel
def follow_values(
    watch: FloatArray,
    limits: FloatArray,
    time: FloatArray,
    values: FloatArray,
    others: FloatArray,
    verdicts: NDArray[np.uint8],
    since: FloatArray,
) -> None:
    """Verdicts on the samples of a column, and what the watch is after them.

    Parameters
    ----------
    watch, limits
        See the numbers of their entries; `watch` is changed.
    time, values : s and SI, (n,)
        NaN is a missing sample.
    others : (n, 2)
        Channels that stand still too where a logger repeats its last samples.
    verdicts : (n,)
        To be filled.
    since : s, (n, 2)
        To be filled: of a `SEAM`, or of what is `EXPLAINED`, when the step was, and since when values counted before
        it; of `REPEATED` samples when the first of them was read.
    """
    for i in range(time.size):
        verdicts[i] = judge_next(watch, limits, time[i], values[i], others[i, 0], others[i, 1], since[i])
