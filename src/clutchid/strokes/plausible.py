"""Compiled rule for samples that are not values: one pass over a column, sample by sample, as a control unit would."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.strokes.rule import (
    ACCELERATION,
    AGE,
    BELIEVED_AFTER,
    BEYOND,
    COMPUTED,
    COUNT,
    DIFFERENCE,
    DOUBT,
    DOUBT_RATE,
    DOUBT_SEEN,
    DOUBT_SINCE,
    DOUBTED,
    EQUAL,
    EXPLAINED,
    FASTER,
    FRESH,
    GAP,
    IMPOSSIBLE,
    IMPROBABLE,
    INTERVAL,
    LAST,
    LEAST_SUPPLY,
    LIKE_SUPPLY,
    MOST_SUPPLY,
    NOISE,
    OF_SUPPLY,
    OTHER_0,
    OTHER_1,
    OTHERS_SINCE,
    QUANTUM,
    QUICK,
    RANGE_HIGH,
    RANGE_LOW,
    RATE_NOW,
    READ_ANEW,
    REPEATED,
    REPEATS,
    SCATTER,
    SCATTER_BEFORE,
    SCATTERED,
    SEAM,
    SEEN,
    SINCE,
    SLOW,
    SLOWEST,
    SPEED,
    STANDS,
    STEP,
    TOGGLED,
    TURNS,
    TURNS_BEFORE,
    UNLIKE_SUPPLY,
    VALUE,
)


@kernel
def noisy(watch: FloatArray, limits: FloatArray) -> bool:
    """Whether the noise of the sensor was visible before the present run of equal samples."""
    least: float = max(TOGGLED * watch[QUANTUM], COMPUTED * (limits[RANGE_HIGH] - limits[RANGE_LOW]))
    return bool(watch[SCATTER_BEFORE] >= least)


@kernel
def possible_step(watch: FloatArray, limits: FloatArray, elapsed: float, dt: float, rate: float) -> float:
    """Largest step in `dt` s, for a value first read `elapsed` s ago that changed at `rate` before."""
    held = dt
    if noisy(watch, limits) and elapsed > IMPROBABLE * limits[INTERVAL]:
        held = elapsed
    elif watch[FRESH] < READ_ANEW:
        held = max(dt, min(elapsed, limits[REPEATS]))
    starts = min(limits[SPEED] * held, 0.5 * limits[ACCELERATION] * held * held)
    goes_on = FASTER * abs(rate) * elapsed if elapsed <= limits[GAP] else 0.0
    largest: float = max(limits[NOISE], SCATTERED * watch[SCATTER]) + goes_on + starts
    return largest


@kernel
def restart(watch: FloatArray, t: float, y: float) -> None:
    """Take a sample whatever was before."""
    watch[SEEN], watch[SINCE], watch[AGE], watch[LAST] = t, t, t, y
    watch[RATE_NOW], watch[DIFFERENCE], watch[DOUBT] = 0.0, 0.0, math.nan
    watch[TURNS_BEFORE], watch[SCATTER_BEFORE] = watch[TURNS], watch[SCATTER]


@kernel
def take(watch: FloatArray, limits: FloatArray, t: float, y: float) -> None:
    """Take a sample that follows the last one."""
    difference, elapsed = y - watch[LAST], t - watch[SINCE]
    anew = watch[FRESH] >= READ_ANEW
    if difference != 0.0 or anew:
        second = abs(difference - watch[DIFFERENCE])
        watch[COUNT] += 1.0
        watch[SCATTER] += max(SLOW, 1.0 / watch[COUNT]) * (
            min(second, 3.0 * watch[SCATTER] + limits[NOISE]) - watch[SCATTER]
        )
        turned = 1.0 if difference * watch[DIFFERENCE] < 0.0 else 0.0
        watch[TURNS] += SLOWEST * (turned - watch[TURNS])
        watch[DIFFERENCE] = difference
    if difference != 0.0:
        watch[RATE_NOW] += QUICK * (difference / elapsed - watch[RATE_NOW])
        if not anew:
            watch[FRESH] = watch[FRESH] + 1.0 if elapsed < 1.5 * limits[INTERVAL] else 0.0
        watch[QUANTUM] = min(watch[QUANTUM], abs(difference))
        watch[TURNS_BEFORE], watch[SCATTER_BEFORE] = watch[TURNS], watch[SCATTER]
        watch[SINCE], watch[LAST] = t, y
    watch[SEEN] = t


@kernel
def doubt(watch: FloatArray, t: float, y: float) -> None:
    """Begin to doubt samples with this one."""
    watch[DOUBT], watch[DOUBT_SEEN], watch[DOUBT_SINCE] = t, t, t
    watch[DOUBTED], watch[DOUBT_RATE] = y, 0.0


@kernel
def fills_gap(watch: FloatArray, limits: FloatArray, t: float, y: float) -> bool:
    """Whether the motion behind a step explains it, as after lost messages that a logger fills with the last value."""
    elapsed, step = t - watch[SINCE], y - watch[LAST]
    was_held = IMPROBABLE * limits[INTERVAL] < watch[DOUBT] - watch[SINCE] <= limits[GAP]
    moves_on = watch[DOUBT_RATE] * step > 0.0 and abs(step) <= FASTER * abs(watch[DOUBT_RATE]) * elapsed
    return bool(was_held and moves_on and t - watch[DOUBT] <= STANDS * limits[INTERVAL])


@kernel
def doubted(watch: FloatArray, limits: FloatArray, t: float, y: float) -> int:
    """Verdict on a sample in doubt: it goes on from the others in doubt, from the last that counts, or from neither."""
    dt = t - watch[DOUBT_SEEN]
    if abs(y - watch[DOUBTED]) <= possible_step(watch, limits, dt, dt, watch[DOUBT_RATE]):
        if y != watch[DOUBTED]:
            watch[DOUBT_SINCE] = t
        elif noisy(watch, limits) and t - watch[DOUBT_SINCE] > STANDS * limits[INTERVAL]:
            watch[DOUBT] = t  # a sensor that stands still after a step is not believed
        watch[DOUBT_RATE] += QUICK * ((y - watch[DOUBTED]) / dt - watch[DOUBT_RATE])
        watch[DOUBTED], watch[DOUBT_SEEN] = y, t
        if fills_gap(watch, limits, t, y):
            return EXPLAINED
        if t - watch[DOUBT] < min(
            limits[BELIEVED_AFTER], 2.0 * (watch[SEEN] - watch[AGE]) + (STANDS - 1.0) * limits[INTERVAL]
        ):
            return STEP
        return SEAM
    away = t - watch[SEEN]
    if abs(y - watch[LAST]) <= limits[NOISE] + SCATTERED * watch[SCATTER] + limits[SPEED] * away:
        return VALUE
    doubt(watch, t, y)
    return STEP


@kernel
def judge(watch: FloatArray, limits: FloatArray, t: float, y: float) -> int:
    """Verdict on the next sample."""
    if math.isnan(y) or not limits[RANGE_LOW] <= y <= limits[RANGE_HIGH]:
        watch[EQUAL] = 0.0
        return VALUE if math.isnan(y) else BEYOND
    latest = watch[SEEN] if math.isnan(watch[DOUBT]) else watch[DOUBT_SEEN]
    if not t - latest <= limits[GAP]:
        restart(watch, t, y)
        return VALUE
    if not math.isnan(watch[DOUBT]):
        verdict = doubted(watch, limits, t, y)
        if verdict in (VALUE, EXPLAINED):
            take(watch, limits, t, y)
        return verdict
    step = possible_step(watch, limits, t - watch[SINCE], t - watch[SEEN], watch[RATE_NOW])
    if abs(y - watch[LAST]) > step:
        doubt(watch, t, y)
        return STEP
    take(watch, limits, t, y)
    return VALUE


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
    if supply != watch[OTHER_0] or exhaust != watch[OTHER_1]:
        watch[OTHER_0], watch[OTHER_1], watch[OTHERS_SINCE] = supply, exhaust, t
    verdict = judge(watch, limits, t, y)
    if verdict in (SEAM, EXPLAINED):
        since[0], since[1] = watch[DOUBT], watch[AGE]
    if verdict == SEAM:
        restart(watch, t, y)
    elif verdict in (VALUE, EXPLAINED) and not math.isnan(y):
        watch[DOUBT] = math.nan
        watch[EQUAL] = watch[EQUAL] + 1.0 if t > watch[SINCE] else 0.0
        turns, began = watch[TURNS_BEFORE] * watch[EQUAL], t - watch[EQUAL] * limits[INTERVAL]
        repeated = turns > IMPOSSIBLE and watch[EQUAL] * limits[INTERVAL] > limits[GAP] and noisy(watch, limits)
        if repeated and watch[OTHERS_SINCE] < began + 0.5 * limits[INTERVAL]:
            verdict, since[0] = REPEATED, began
    return verdict


@kernel
def count_anew(watch: FloatArray, by: float) -> None:
    """Let the time begin `by` s later, for a clock of few digits."""
    watch[SEEN], watch[SINCE], watch[AGE] = watch[SEEN] - by, watch[SINCE] - by, watch[AGE] - by
    watch[DOUBT], watch[DOUBT_SEEN] = watch[DOUBT] - by, watch[DOUBT_SEEN] - by
    watch[DOUBT_SINCE], watch[OTHERS_SINCE] = watch[DOUBT_SINCE] - by, watch[OTHERS_SINCE] - by


@kernel
def judge_supply(watch: FloatArray, recorded: float, pressure: float, closed: bool) -> bool:
    """Whether a supply pressure cannot be right, by that of the calibration and by its mean while no valve is open."""
    wrong = pressure < LEAST_SUPPLY or pressure > MOST_SUPPLY
    if closed and not wrong and not math.isnan(pressure):
        share = pressure / recorded - 1.0
        watch[0] = share if math.isnan(watch[0]) else watch[0] + OF_SUPPLY * (share - watch[0])
        if abs(watch[0]) > UNLIKE_SUPPLY:
            watch[1] = 1.0
        elif abs(watch[0]) < LIKE_SUPPLY:
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
