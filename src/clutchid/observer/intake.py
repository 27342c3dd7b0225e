"""Records of what is known of a sample before the filter takes it; times are whole microseconds."""

from __future__ import annotations

from clutchid.codegen.records import Count

#: Clock of the watch for values in us, which begins anew after it: in float it has few digits.
CLOCK = 16_000_000

#: Longest time in us for which duty cycles are held where they are missing; beyond it a stretch ends. Provenance:
#: docs/derivations_online.md.
BRIDGED = 20_000

#: With closed valves a piston is held, or falls as air leaks or cools; from this time in us on its mean position over
#: the second one rises by no more than the third in m above the lowest mean since, for the last one at most:
#: `python benchmarks/creeping.py --closed`.
SETTLED, CLOSED_BIN, RISES, CLOSED_SPAN = 1_000_000, 500_000, 1e-4, 60_000_000

#: A hole of more us is long enough for the exchange of a sensor.
EXCHANGED = 60_000_000

#: A position further outside of the stroke than this in m is beyond the stops.
OUTSIDE_STOPS = 0.5e-3


class Input:
    """A sample; NaN for what is missing."""

    position: float
    duty_supply: float
    duty_exhaust: float
    supply_pressure: float


class IntakeLimits:
    """Limits of the intake, and values of the calibration that it compares with.

    Attributes
    ----------
    spacing, shortest, gap, hole, longest : us
        Time from one sample to the next: the usual one; below which a sample repeats the last one; above which samples
        are missing, and are a hole; and the longest one in a stretch.
    supply : Pa
        Mean supply pressure of the calibration recordings; 0 where it is not used.
    air : K
        Temperature of the air in the calibration recordings; 0 where it is not used.
    y_max, suspect_from : m
        Stroke, and the recorded position beyond which the travel is suspect.
    """

    spacing: Count
    shortest: Count
    gap: Count
    hole: Count
    longest: Count
    supply: float
    air: float
    y_max: float
    suspect_from: float


class Intake:
    """State of the intake between two samples.

    Attributes
    ----------
    sampled, driven, held
        1 after the first sample, while the inputs go on, and where the last duty cycles are held.
    clock, pending, undriven : us
        Clock of the watch for values; time since the last sample that counts, at those that repeat it; and since the
        last one with both duty cycles.
    duty_supply, duty_exhaust : 1
        Duty cycles as they are held.
    closed, bin : us
        Time for which both valves are closed, and of the present mean.
    total, lowest : m
        Sum of its positions, `count` of them, and the lowest mean so far.
    rises
        1 where a mean has risen.
    jumped, unzeroed, zeroed
        1 after the position has jumped and stayed, and until a vented rest has shown its zero since; and how many
        strokes have ended from then on.
    supply, supply_of_few, supply_unlike
        Mean deviation of the recorded supply pressure from that of the calibration, NaN before the first, and that of
        the last few samples; 1 where they are too large.
    supply_recorded, supply_known, supplied : 1, 1, us
        1 after a supply pressure that counts, until it is lost or unlike; 1 after the first; and time since the last.
    air, aired : K, us
        Temperature of the air in use, 0 before one, and time since one last counted.
    air_refused, air_count
        1 where the last temperature does not count, and how many have since the last change of its sensor.
    other_air, other_count : K, 1
        The last temperature that does not count, and how many before it were like it.
    """

    sampled: int
    driven: int
    held: int
    clock: Count
    pending: Count
    undriven: Count
    duty_supply: float
    duty_exhaust: float
    closed: Count
    bin: Count
    total: float
    count: Count
    lowest: float
    rises: int
    jumped: int
    unzeroed: int
    zeroed: float
    supply: float
    supply_of_few: float
    supply_unlike: int
    supply_recorded: int
    supply_known: int
    supplied: Count
    air: float
    aired: Count
    air_refused: int
    air_count: Count
    other_air: float
    other_count: Count


class Sample:
    """A sample as the filter takes it.

    Attributes
    ----------
    flags
        Bits of `clutchid.observer.flags`.
    verdict
        On the position, see `clutchid.strokes.rule`.
    since : us
        Since the last one; 0 for the first.
    lost
        Number of samples that are missing in a hole before it.
    position, measured : m
        From the zero in use, and as recorded; NaN for no value.
    duty_supply, duty_exhaust, supply_pressure
        Duty cycles, held where they are missing for a short time, and the pressure where it can be right, NaN else.
    unknown
        Intervals before it in which the duty cycles are not known.
    rest, zero : m
        How far the vented rest had moved before it, and what is subtracted from the position.
    air, air_known
        Temperature of the air in use in K, 0 before one, and 1 where it is not lost.
    recorded, driven, begins, ends, forgets
        1 where both duty cycles are recorded, where they are known or held, where it does not go on from the last one,
        where a stroke ends, and where what a wrong supply pressure taught is forgotten.
    """

    flags: Count
    verdict: int
    since: Count
    lost: Count
    position: float
    measured: float
    duty_supply: float
    duty_exhaust: float
    supply_pressure: float
    unknown: float
    rest: float
    zero: float
    air: float
    air_known: int
    recorded: int
    driven: int
    begins: int
    ends: int
    forgets: int
