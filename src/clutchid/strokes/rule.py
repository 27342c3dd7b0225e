"""Numbers of the rule for samples that are not values: its verdicts, and the entries of its watch and its limits."""

from __future__ import annotations

#: Verdicts on a sample: a value; outside the range; reached by a step that is impossible; the first value
#: that is taken again after a step that stays; repeated with all other channels; and a value that explains the step
#: before it.
VALUE, BEYOND, STEP, SEAM, REPEATED, EXPLAINED = range(6)


#: Time in s after which a step that stays is another zero, not an outlier; what counted for less before a step was the
#: outlier itself. The resolution of the clock is within it.
BELIEVED = 1.0 - 0.5e-6


class Watch:
    """State of the rule between two samples of a column; times in s, values in SI.

    Attributes
    ----------
    seen, last, since, rate
        Time of the last sample that counts, its value, when that was first read, and its rate of change.
    scatter, difference, fresh, age
        Mean second difference, last difference, changes in consecutive samples, and since when values count.
    turns, turns_before, scatter_before
        Mean share of turning points; that and the mean second difference before the present run.
    quantum, count
        Smallest change, and number of differences.
    doubt, doubted, doubt_seen, doubt_rate, doubt_since
        Of samples in doubt: since when, the last one, its time, its rate, and when it was first read.
    equal, supply, exhaust, others_since
        Equal samples so far; the duty cycles, and when they changed.
    step, began
        Of a step that stays or is explained, when it was and since when values counted before it; of samples that are
        repeated, when the first of them was read.
    """

    seen: float
    last: float
    since: float
    rate: float
    scatter: float
    difference: float
    fresh: float
    age: float
    turns: float
    turns_before: float
    scatter_before: float
    quantum: float
    count: float
    doubt: float
    doubted: float
    doubt_seen: float
    doubt_rate: float
    doubt_since: float
    equal: float
    supply: float
    exhaust: float
    others_since: float
    step: float
    began: float


class ValueLimits:
    """ValueLimits of a column: range in SI; largest rate and acceleration; noise; and times in s.

    These are for which a sensor may repeat a value, and after which a step that stays is believed, the longest gap, and
    the usual interval.
    """

    low: float
    high: float
    speed: float
    acceleration: float
    noise: float
    repeats: float
    believed_after: float
    gap: float
    interval: float


#: Weights of a new difference in the rate, in the scatter, and in the share of turning points: fast motion has none.
QUICK, SLOW, SLOWEST = 0.25, 1.0 / 64.0, 1.0 / 256.0

#: A step may be as many times the recent rate, and as many times the mean second difference: 8 standard deviations of
#: white noise, whose mean second difference is 1.95 of them, and whose differences have 1.41.
FASTER, SCATTERED = 1.5, 5.0

#: Changes in consecutive samples after which the sensor is known to be read anew in each.
READ_ANEW = 20.0

#: Multiple of the quantum that noise scatters by; a quiet sensor between two of its steps, at random, has 1.
TOGGLED = 1.5

#: A run of equal samples, of a sensor that scatters by more than that, is improbable beyond as many intervals (0.38^3);
#: a run that is longer than the second of them after a step is not believed; a run is impossible where as many
#: turning points were expected in it: e^-20 is once in 500 million runs. With less scatter than this share of the
#: range, values were computed. Half intervals, so that no rounding of a clock decides.
IMPROBABLE, STANDS, IMPOSSIBLE, COMPUTED = 2.5, 10.5, 20.0, 1e-5

#: Absolute pressures in Pa of an air supply: below 3 bar none drives (UNECE R13: the protection valve closes at 4.5 bar
#: or more), and the safety valve of a compressor opens before 16 bar.
LEAST_SUPPLY, MOST_SUPPLY = 3e5, 16e5

#: A supply pressure whose mean is further from that of the calibration recordings, as a share of it, has another unit,
#: is gauge for absolute, or its sensor is broken, until it is nearer than the second: governors keep it within 5 %, and
#: 5 % may change; a gauge pressure is 9 to 13 % lower. Weight of a sample in that mean, so that no stroke decides, and
#: in the mean of a few samples, which a sensor that breaks takes beyond the last. Provenance:
#: docs/derivations_online.md.
UNLIKE_SUPPLY, LIKE_SUPPLY, OF_SUPPLY, OF_FEW, FAR_SUPPLY = 0.08, 0.06, 1.0 / 1024.0, 1.0 / 16.0, 0.2

#: Time in us without a supply pressure that counts after which it is not known any more: a governor takes it from one
#: end of its range to the other in some seconds with strokes, and in minutes without.
SUPPLY_LOST_AFTER = 10_000_000
