"""Rule for what is known of a sample before the filter takes it: faults, gaps, strokes, vented rest, supply and air.

One text for recordings, live and for the control unit: the exported C is printed from it. Times are whole microseconds.
"""

from __future__ import annotations

import math

from clutchid.codegen.kernels import kernel
from clutchid.codegen.records import Count, Records
from clutchid.inference.uncertainty.conditions import AIR_ACCURACY, COLDEST, HOTTEST, LOST, RATE, SWING
from clutchid.log import FloatArray
from clutchid.measurements import DUTY_ROUNDING
from clutchid.observer import flags as bits
from clutchid.observer.intake import (
    BRIDGED,
    CLOCK,
    CLOSED_BIN,
    CLOSED_SPAN,
    EXCHANGED,
    OUTSIDE_STOPS,
    RISES,
    SETTLED,
    Input,
    Intake,
    IntakeLimits,
    Sample,
)
from clutchid.observer.rest import Rest, RestBefore
from clutchid.observer.rest_rule import new_stretch, watch_rest
from clutchid.strokes import rule
from clutchid.strokes.plausible import count_anew, judge_next
from clutchid.strokes.rest_level import CLOSED
from clutchid.strokes.rule import ValueLimits, Watch
from clutchid.strokes.stroke import LONGEST_US, RESOLUTION, Stroke
from clutchid.strokes.stroke_rule import count_stroke, later


@kernel
def clamped_duty(duty: float) -> float:
    """A duty cycle from 0 to 1, also where it is rounded to just outside; NaN for what is further outside."""
    inside = -DUTY_ROUNDING <= duty <= 1.0 + DUTY_ROUNDING
    return min(max(duty, 0.0), 1.0) if inside else math.nan


@kernel
def judge_position(intake: Intake, watch: Watch, bounds: ValueLimits, raw: Input, since: Count) -> int:
    """Verdict on a position, `since` us after the last sample that counts."""
    if LONGEST_US - intake.clock < since:
        intake.clock = CLOCK
        watch.seen, watch.doubt = math.nan, math.nan
    else:
        intake.clock += since
    if intake.clock >= CLOCK:
        periods = intake.clock // CLOCK
        intake.clock -= periods * CLOCK
        count_anew(watch, float(periods * CLOCK) * RESOLUTION)
    t = float(intake.clock) * RESOLUTION
    verdict = judge_next(watch, bounds, t, raw.position, raw.duty_supply, raw.duty_exhaust)
    if verdict == rule.SEAM and watch.step - watch.began >= rule.BELIEVED:
        intake.jumped, intake.unzeroed, intake.zeroed = 1, 1, 0.0
    return verdict


@kernel
def flags_of(verdict: int) -> Count:
    """Flags of a verdict on a position."""
    if verdict == rule.BEYOND:
        return bits.POSITION_NONE
    if verdict in (rule.STEP, rule.SEAM):
        return bits.POSITION_JUMPS
    return bits.REPEATED_SAMPLES if verdict == rule.REPEATED else 0


@kernel
def judge_supply(intake: Intake, recorded: float, pressure: float, closed: bool) -> bool:
    """Whether a supply pressure cannot be right, by that of the calibration and by its mean while no valve is open."""
    wrong = pressure < rule.LEAST_SUPPLY or pressure > rule.MOST_SUPPLY
    if closed and not wrong and not math.isnan(pressure):
        share = pressure / recorded - 1.0
        first = math.isnan(intake.supply)
        intake.supply = share if first else intake.supply + rule.OF_SUPPLY * (share - intake.supply)
        intake.supply_of_few = share if first else intake.supply_of_few + rule.OF_FEW * (share - intake.supply_of_few)
        if abs(intake.supply) > rule.UNLIKE_SUPPLY or abs(intake.supply_of_few) > rule.FAR_SUPPLY:
            intake.supply_unlike = 1
        elif abs(intake.supply) < rule.LIKE_SUPPLY:
            intake.supply_unlike = 0
    return bool(wrong or (intake.supply_unlike == 1 and not math.isnan(pressure)))


@kernel
def take_supply(intake: Intake, sample: Sample, limits: IntakeLimits, raw: Input, since: Count) -> None:
    """Use a supply pressure that can be right; what another one taught is forgotten, and it is lost some time later."""
    closed = raw.duty_supply <= 0.0 and raw.duty_exhaust <= 0.0
    intake.supplied = later(intake.supplied, since)
    if judge_supply(intake, limits.supply, raw.supply_pressure, closed):
        sample.flags |= bits.SUPPLY_UNLIKE
        if intake.supply_unlike == 1 and intake.supply_recorded == 1:
            sample.forgets, intake.supply_recorded = 1, 0
    elif math.isfinite(raw.supply_pressure):
        sample.supply_pressure = raw.supply_pressure
        intake.supply_recorded, intake.supply_known, intake.supplied = 1, 1, 0
    if intake.supply_known == 1 and intake.supplied > rule.SUPPLY_LOST_AFTER:
        intake.supply_recorded = 0
        sample.flags |= bits.SUPPLY_LOST


@kernel
def take_air(intake: Intake, temperature: float, before: float) -> None:
    """Use a temperature of the air in K, if it differs from one `before` by more than a sensor's standard deviation."""
    intake.aired, intake.air_refused = 0, 0
    intake.air = temperature if abs(temperature - before) > AIR_ACCURACY else before


@kernel
def air_known(intake: Intake) -> int:
    """1 where a temperature of the air is in use that is not lost."""
    return 1 if intake.air > 0.0 and intake.aired <= LOST else 0


@kernel
def judge_air(intake: Intake, limits: IntakeLimits, temperature: float, dt: Count) -> None:
    """Use or refuse a temperature of the air in K, NaN for none, `dt` us after the last sample.

    A temperature stays in use until one counts that differs by more than a sensor's standard deviation; the first one
    is that of the calibration, unless it differs by as much. What no air has does not count, and neither does what
    changes faster than air since one counted, as a sensor that fails for some seconds, unless more of them agree than
    have counted before: then those were wrong, as the first one may be.
    """
    intake.aired = later(intake.aired, dt)
    if limits.air > 0.0 and not math.isnan(temperature):
        before = intake.air if intake.air > 0.0 else limits.air
        slow = abs(temperature - before) <= SWING + RATE * (float(intake.aired) * RESOLUTION)
        intake.air_refused = 1
        if not COLDEST <= temperature <= HOTTEST:
            return
        if slow or intake.air <= 0.0:
            take_air(intake, temperature, before)
            intake.air_count, intake.other_count = later(intake.air_count, 1), 0
            return
        alike = intake.other_count > 0 and abs(temperature - intake.other_air) <= SWING
        intake.other_count = later(intake.other_count, 1) if alike else 1
        intake.other_air = temperature
        if intake.other_count > intake.air_count:
            take_air(intake, temperature, limits.air)
            intake.air_count, intake.other_count = intake.other_count, 0


@kernel
def hold_duties(intake: Intake, sample: Sample, ends: bool) -> None:
    """Hold duty cycles where they are missing for a short time; a stretch ends where they are not known."""
    complete = math.isfinite(sample.duty_supply) and math.isfinite(sample.duty_exhaust)
    sample.recorded = 1 if complete and not ends else 0
    sample.driven = sample.recorded
    if sample.recorded == 1:
        intake.undriven = 0
    elif not ends and intake.driven == 1 and intake.undriven <= BRIDGED:
        sample.driven = 1
        if not math.isfinite(sample.duty_supply):
            sample.duty_supply = intake.duty_supply
        if not math.isfinite(sample.duty_exhaust):
            sample.duty_exhaust = intake.duty_exhaust
    else:
        intake.undriven = LONGEST_US
    if sample.driven == 1:
        intake.duty_supply, intake.duty_exhaust = sample.duty_supply, sample.duty_exhaust
    sample.begins = 1 if intake.driven == 0 or sample.driven == 0 else 0
    intake.driven, intake.held = sample.driven, 1 - sample.recorded


@kernel
def watch_closed(intake: Intake, sample: Sample, since: Count) -> None:
    """Whether the piston moves out while both valves are closed, which no air moves it."""
    closed = sample.begins == 0 and sample.duty_supply <= CLOSED and sample.duty_exhaust <= CLOSED
    if not closed or intake.closed > CLOSED_SPAN:
        intake.closed, intake.bin, intake.count, intake.rises = 0, 0, 0, 0
        intake.total, intake.lowest = 0.0, math.inf
    if closed:
        intake.closed = later(intake.closed, since)
        if intake.closed >= SETTLED and math.isfinite(sample.position):
            intake.bin = later(intake.bin, since)
            intake.total += sample.position
            intake.count = later(intake.count, 1)
        if intake.bin >= CLOSED_BIN:
            mean = intake.total / float(intake.count)
            intake.lowest = min(intake.lowest, mean)
            intake.rises = 1 if mean > intake.lowest + RISES else 0
            intake.total, intake.count, intake.bin = 0.0, 0, 0


@kernel
def forget_jump(intake: Intake, before: RestBefore) -> None:
    """Forget that the position has jumped, as strokes have ended since a vented rest has shown the zero in use."""
    if intake.jumped == 1 and intake.unzeroed == 0 and before.subtracted == 1:
        intake.zeroed += 1.0
        if intake.zeroed >= bits.HEALED:
            intake.jumped, intake.zeroed = 0, 0.0


@kernel
def missing_before(limits: IntakeLimits, since: Count) -> Count:
    """Samples that are missing in a hole of `since` us, 0 without one."""
    if since <= limits.hole:
        return 0
    return since // limits.spacing - (1 if since % limits.spacing < limits.spacing // 2 else 0)


@kernel
def unknown_before(intake: Intake, limits: IntakeLimits, since: Count) -> float:
    """Intervals before a sample in which the duty cycles are not known."""
    lost = float((since + limits.spacing // 2) // limits.spacing - 1) if since > limits.gap else 0.0
    return lost + float(intake.held)


@kernel
def faults_of(sample: Sample, intake: Intake, limits: IntakeLimits) -> Count:
    """Flags of what is wrong with a sample by itself."""
    flags, position = sample.flags, sample.measured - sample.zero
    if not math.isfinite(position):
        flags |= bits.POSITION_MISSING
    if position < -OUTSIDE_STOPS or position > limits.y_max + OUTSIDE_STOPS:
        flags |= bits.POSITION_BEYOND_STOPS
    if sample.measured > limits.suspect_from:
        flags |= bits.TRAVEL_UNLIKE
    if sample.recorded == 0:
        flags |= bits.DUTY_MISSING
    if sample.lost > 0:
        flags |= bits.TIME_MISSING
    if abs(sample.rest) > 0.0:
        flags |= bits.REST_MOVED
    if intake.unzeroed == 1:
        flags |= bits.ZERO_UNKNOWN
    if intake.rises == 1:
        flags |= bits.MOVES_CLOSED
    if intake.air_refused == 1:
        flags |= bits.AIR_REFUSED
    if intake.air > 0.0 and air_known(intake) == 0:
        flags |= bits.AIR_LOST
    return flags


@kernel
def take_in(
    intake: Intake, watch: Watch, stroke: Stroke, rest: Rest, bin: FloatArray, medians: FloatArray,
    limits: IntakeLimits, bounds: ValueLimits, before: RestBefore, raw: Input, temperature: float, dt: Count,
    sample: Sample,
) -> None:  # fmt: skip
    """Take in a sample, `dt` us after the last one; a sample that comes too soon repeats that, and is only flagged."""
    judge_air(intake, limits, temperature, dt)
    since = later(intake.pending, dt) if intake.sampled == 1 else 0
    sample.since, sample.rest, sample.ends = since, rest.shift, 0
    sample.forgets = 0
    sample.air, sample.air_known = intake.air, air_known(intake)
    intake.pending = since
    sample.flags, sample.verdict = bits.REPEATED_TIME, rule.VALUE
    if intake.sampled == 0 or since >= limits.shortest:
        intake.pending = 0
        sample.verdict = judge_position(intake, watch, bounds, raw, since)
        sample.flags = flags_of(sample.verdict)
        sample.measured = raw.position if sample.verdict in (rule.VALUE, rule.EXPLAINED) else math.nan
        sample.duty_supply = clamped_duty(raw.duty_supply)
        sample.duty_exhaust = clamped_duty(raw.duty_exhaust)
        sample.supply_pressure = math.nan
        if limits.supply > 0.0:
            take_supply(intake, sample, limits, raw, since)
        sample.lost = missing_before(limits, since)
        sample.unknown = unknown_before(intake, limits, since)
        intake.undriven = later(intake.undriven, since)
        if since > limits.longest:
            intake.driven = 0
        hold_duties(intake, sample, sample.verdict in (rule.SEAM, rule.REPEATED))
        if sample.begins == 1:
            new_stretch(rest, sample.verdict == rule.SEAM or since > EXCHANGED)
        intake.sampled = 1
        sample.zero = rest.shift if before.subtracted == 1 else 0.0
        sample.position = math.nan if intake.unzeroed == 1 else sample.measured - sample.zero
        watch_closed(intake, sample, since)
        sample.flags = faults_of(sample, intake, limits)
        sample.ends = 1 if count_stroke(stroke, sample.position, since) else 0
        if sample.ends == 1:
            forget_jump(intake, before)
        follows, supply, exhaust = sample.driven == 1 and before.exists == 1, sample.duty_supply, sample.duty_exhaust
        if follows and watch_rest(rest, before, bin, medians, sample.measured, supply, exhaust):
            intake.unzeroed = 0


@kernel
def take_in_all(
    intake: Intake, watch: Watch, stroke: Stroke, rest: Rest, bin: FloatArray, medians: FloatArray,
    limits: IntakeLimits, bounds: ValueLimits, before: RestBefore, raw: Input, latest: float, time: FloatArray,
    columns: FloatArray, temperature: FloatArray, samples: Records,
) -> None:  # fmt: skip
    """Take in the samples of a block; times in s, `latest` that of the last sample before, NaN without one.

    Parameters
    ----------
    columns : (n, 4)
        The fields of `Input`, which `raw` is memory for.
    temperature : K, (n,)
        Of the air, NaN for none.
    samples : (n,)
        Records of `Sample`, to be filled.
    """
    last = latest
    for i in range(time.size):
        dt = 0 if math.isnan(last) else min(round(time[i] / RESOLUTION) - round(last / RESOLUTION), LONGEST_US)
        last = time[i]
        raw.position, raw.duty_supply = columns[i, 0], columns[i, 1]
        raw.duty_exhaust, raw.supply_pressure = columns[i, 2], columns[i, 3]
        take_in(
            intake, watch, stroke, rest, bin, medians, limits, bounds, before, raw, temperature[i], dt, samples[i]
        )  # fmt: skip
