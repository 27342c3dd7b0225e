"""Compiled rule for samples that are not values: one pass over a column, sample by sample, as a control unit would."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel
from clutchid.log import FloatArray
from clutchid.strokes import rule
from clutchid.strokes.rule import ValueLimits, Watch


@kernel
def noisy(watch: Watch, limits: ValueLimits) -> bool:
    """Whether the noise of the sensor was visible before the present run of equal samples."""
    least: float = max(rule.TOGGLED * watch.quantum, rule.COMPUTED * (limits.high - limits.low))
    return bool(watch.scatter_before >= least)


@kernel
def possible_step(watch: Watch, limits: ValueLimits, elapsed: float, dt: float, rate: float) -> float:
    """Largest step in `dt` s, for a value first read `elapsed` s ago that changed at `rate` before."""
    held = dt
    if noisy(watch, limits) and elapsed > rule.IMPROBABLE * limits.interval:
        held = elapsed
    elif watch.fresh < rule.READ_ANEW:
        held = max(dt, min(elapsed, limits.repeats))
    starts = min(limits.speed * held, 0.5 * limits.acceleration * held * held)
    goes_on = rule.FASTER * abs(rate) * elapsed if elapsed <= limits.gap else 0.0
    largest: float = max(limits.noise, rule.SCATTERED * watch.scatter) + goes_on + starts
    return largest


@kernel
def restart(watch: Watch, t: float, y: float) -> None:
    """Take a sample whatever was before."""
    watch.seen, watch.since, watch.age, watch.last = t, t, t, y
    watch.rate, watch.difference, watch.doubt = 0.0, 0.0, math.nan
    watch.turns_before, watch.scatter_before = watch.turns, watch.scatter


@kernel
def take(watch: Watch, limits: ValueLimits, t: float, y: float) -> None:
    """Take a sample that follows the last one."""
    difference, elapsed = y - watch.last, t - watch.since
    anew = watch.fresh >= rule.READ_ANEW
    if difference != 0.0 or anew:
        second = abs(difference - watch.difference)
        watch.count += 1.0
        watch.scatter += max(rule.SLOW, 1.0 / watch.count) * (
            min(second, 3.0 * watch.scatter + limits.noise) - watch.scatter
        )
        turned = 1.0 if difference * watch.difference < 0.0 else 0.0
        watch.turns += rule.SLOWEST * (turned - watch.turns)
        watch.difference = difference
    if difference != 0.0:
        watch.rate += rule.QUICK * (difference / elapsed - watch.rate)
        if not anew:
            watch.fresh = watch.fresh + 1.0 if elapsed < 1.5 * limits.interval else 0.0
        watch.quantum = min(watch.quantum, abs(difference))
        watch.turns_before, watch.scatter_before = watch.turns, watch.scatter
        watch.since, watch.last = t, y
    watch.seen = t


@kernel
def doubt(watch: Watch, t: float, y: float) -> None:
    """Begin to doubt samples with this one."""
    watch.doubt, watch.doubt_seen, watch.doubt_since = t, t, t
    watch.doubted, watch.doubt_rate = y, 0.0


@kernel
def fills_gap(watch: Watch, limits: ValueLimits, t: float, y: float) -> bool:
    """Whether the motion behind a step explains it, as after lost messages that a logger fills with the last value."""
    elapsed, step = t - watch.since, y - watch.last
    was_held = rule.IMPROBABLE * limits.interval < watch.doubt - watch.since <= limits.gap
    moves_on = watch.doubt_rate * step > 0.0 and abs(step) <= rule.FASTER * abs(watch.doubt_rate) * elapsed
    return bool(was_held and moves_on and t - watch.doubt <= rule.STANDS * limits.interval)


@kernel
def doubted(watch: Watch, limits: ValueLimits, t: float, y: float) -> int:
    """Verdict on a sample in doubt: it goes on from the others in doubt, from the last that counts, or from neither."""
    dt = t - watch.doubt_seen
    if abs(y - watch.doubted) <= possible_step(watch, limits, dt, dt, watch.doubt_rate):
        if y != watch.doubted:
            watch.doubt_since = t
        elif noisy(watch, limits) and t - watch.doubt_since > rule.STANDS * limits.interval:
            watch.doubt = t  # a sensor that stands still after a step is not believed
        watch.doubt_rate += rule.QUICK * ((y - watch.doubted) / dt - watch.doubt_rate)
        watch.doubted, watch.doubt_seen = y, t
        if fills_gap(watch, limits, t, y):
            return rule.EXPLAINED
        if t - watch.doubt < min(
            limits.believed_after, 2.0 * (watch.seen - watch.age) + (rule.STANDS - 1.0) * limits.interval
        ):
            return rule.STEP
        return rule.SEAM
    away = t - watch.seen
    if abs(y - watch.last) <= limits.noise + rule.SCATTERED * watch.scatter + limits.speed * away:
        return rule.VALUE
    doubt(watch, t, y)
    return rule.STEP


@kernel
def judge(watch: Watch, limits: ValueLimits, t: float, y: float) -> int:
    """Verdict on the next sample."""
    if math.isnan(y) or not limits.low <= y <= limits.high:
        watch.equal = 0.0
        return rule.VALUE if math.isnan(y) else rule.BEYOND
    latest = watch.seen if math.isnan(watch.doubt) else watch.doubt_seen
    if not t - latest <= limits.gap:
        restart(watch, t, y)
        return rule.VALUE
    if not math.isnan(watch.doubt):
        verdict = doubted(watch, limits, t, y)
        if verdict in (rule.VALUE, rule.EXPLAINED):
            take(watch, limits, t, y)
        return verdict
    step = possible_step(watch, limits, t - watch.since, t - watch.seen, watch.rate)
    if abs(y - watch.last) > step:
        doubt(watch, t, y)
        return rule.STEP
    take(watch, limits, t, y)
    return rule.VALUE


@kernel
def judge_next(watch: Watch, limits: ValueLimits, t: float, y: float, supply: float, exhaust: float) -> int:
    """Verdict on the next sample, with both duty cycles, after which the watch has taken it."""
    if supply != watch.supply or exhaust != watch.exhaust:
        watch.supply, watch.exhaust, watch.others_since = supply, exhaust, t
    verdict = judge(watch, limits, t, y)
    if verdict in (rule.SEAM, rule.EXPLAINED):
        watch.step, watch.began = watch.doubt, watch.age
    if verdict == rule.SEAM:
        restart(watch, t, y)
    elif verdict in (rule.VALUE, rule.EXPLAINED) and not math.isnan(y):
        watch.doubt = math.nan
        watch.equal = watch.equal + 1.0 if t > watch.since else 0.0
        turns, began = watch.turns_before * watch.equal, t - watch.equal * limits.interval
        repeated = turns > rule.IMPOSSIBLE and watch.equal * limits.interval > limits.gap and noisy(watch, limits)
        if repeated and watch.others_since < began + 0.5 * limits.interval:
            verdict, watch.began = rule.REPEATED, began
    return verdict


@kernel
def count_anew(watch: Watch, by: float) -> None:
    """Let the time begin `by` s later, for a clock of few digits."""
    watch.seen, watch.since, watch.age = watch.seen - by, watch.since - by, watch.age - by
    watch.doubt, watch.doubt_seen = watch.doubt - by, watch.doubt_seen - by
    watch.doubt_since, watch.others_since = watch.doubt_since - by, watch.others_since - by


@kernel
def follow_values(
    watch: Watch, limits: ValueLimits, time: FloatArray, values: FloatArray, others: FloatArray,
    verdicts: NDArray[np.uint8], since: FloatArray,
) -> None:  # fmt: skip
    """Verdicts on the samples of a column, and what the watch is after them.

    Parameters
    ----------
    watch
        Is changed.
    time, values : s and SI, (n,)
        NaN is a missing sample.
    others : (n, 2)
        Channels that stand still too where a logger repeats its last samples.
    verdicts : (n,)
        To be filled.
    since : s, (n, 2)
        To be filled for a `SEAM`, and for what is `EXPLAINED` or `REPEATED`: `Watch.step` and `Watch.began`.
    """
    for i in range(time.size):
        verdicts[i] = judge_next(watch, limits, time[i], values[i], others[i, 0], others[i, 1])
        if verdicts[i] >= rule.SEAM:
            since[i, 0], since[i, 1] = watch.step, watch.began
