"""Trust in the load of an on-line observer, from what it shows of itself: strokes, band, innovations, flags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.estimation.assess.comparison import ENGAGING
from clutchid.estimation.assess.evidence import Reason
from clutchid.estimation.assess.pressure import PressureTest, pressure_reason, pressure_test
from clutchid.estimation.assess.reasons import WIDE, unvented_baseline
from clutchid.estimation.assess.rest import kept_rest
from clutchid.estimation.assess.verdict import Trust, Verdict
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.observer.by_stroke import curve
from clutchid.observer.configuration import Observer
from clutchid.observer.flags import FADES, FLAGS, Faults
from clutchid.observer.live import LiveRun
from clutchid.observer.mismatch import MISMATCHED
from clutchid.observer.run import ObservedRecording, SupplyUse
from clutchid.strokes.travel import TravelChange, travel_change, travel_of

#: Levels of trust by their number, in the exported C and in frames.
TRUSTS: tuple[Trust, ...] = ("none", "with care", "good")

#: Positions at which the band of the load is looked at while the clutch engages.
_POINTS = 13


class Limit(NamedTuple):
    """A value from which a load is to be taken with care, and one from which it has no trust."""

    care: float
    none: float = np.inf


#: Strokes that must have ended, below which the load is to be taken with care, or has no trust: with one, errors were
#: twice as large (`benchmarks/observer_trust.py`).
STROKES = Limit(2, 1)

#: Half width of the 95 % band from 5 to 8 mm, as a share of the peak: the first as for a fit; beyond the second the
#: load is not known better than by a third.
HALF_WIDTH = Limit(WIDE, 0.33)

#: NIS in motion over that of the calibration recordings: from the first to 1.5, 23 % of the loads were off by more
#: than 2 %, below it 12 % (benchmarks/results/causes.md). The second is the flag `unlike_calibration`; without a fault
#: of the truck it was at most 1.84 in a minute (benchmarks/results/observer.md).
MISMATCH = Limit(1.2, MISMATCHED)

#: Share of the last time of each flag, see `clutchid.observer.flags`. A frozen position is not among them: a quiet
#: sensor at rest is frozen too, and its samples are left out. A leak, a divergence and a travel count however short,
#: until two strokes have ended without. Guesses: gaps of 0.1 did not raise the error (`benchmarks/observer_trust.py`).
FLAGGED: Mapping[str, Limit] = {
    "position_missing": Limit(0.2, 0.8),
    "position_beyond_stops": Limit(0.05, 0.5),
    "duty_missing": Limit(0.2, 0.8),
    "time_missing": Limit(0.2, 0.8),
    "outlier": Limit(0.05, 0.5),
    "position_none": Limit(0.05, 0.5),
    "position_jumps": Limit(0.05, 0.5),
    "repeated_samples": Limit(0.2, 0.8),
    "diverged": Limit(0.0, 0.5),
    "leak": Limit(0.0),
    "contradiction": Limit(0.0, 0.5),
    "supply_unlike": Limit(0.05),
    "repeated": Limit(0.2, 0.8),
    "travel_unlike": Limit(0.0),
    "moves_closed": Limit(0.0),
}


#: Knowledge of the zero of the position after it has jumped and stayed.
ZeroKnown = Literal["no jump", "shown", "kept", "not shown", "no rest"]

_ZEROS: Mapping[ZeroKnown, str] = {
    "shown": "it is measured from the vented rest after the jump.",
    "kept": "the vented rest after the jump is not subtracted (--zero keep).",
    "not shown": "no vented rest has shown the new zero yet, so the position is left out.",
    "no rest": (
        "the calibration has no vented rest to compare the new zero with, so the position is left out and the load "
        "is that before the jump; calibrate with a recording that has a vented rest."
    ),
}


class Indicators(NamedTuple):
    """Indicators of an observed load, without its truth.

    Whether the load `adapts`, how many `strokes` have ended, the half width of its band from 5 to 8 mm as a share of
    its peak, the NIS ratio (NaN: not known), the share of the last time of each flag, the use of the `supply` pressure,
    how far in m a vented rest has moved that is not subtracted from the position, what is known of the `zero` after a
    position has jumped and stayed, the reason where the calibration is `unvented`, and of a recording that has ended
    the test of its measured `pressure` and its change of `travel`.
    """

    adapts: bool
    strokes: int
    half_width: float
    mismatch: float
    flagged: Mapping[str, float]
    supply: SupplyUse
    kept_shift: float = 0.0
    zero: ZeroKnown = "no jump"
    unvented: tuple[Reason, ...] = ()
    pressure: PressureTest | None = None
    travel: TravelChange | None = None


def engaging_load(run: ObservedRecording | LiveRun) -> LoadCurve:
    """The load after a recording where the clutch engages, 5 to 8 mm."""
    return curve(run.observer, run.after, np.linspace(*ENGAGING, _POINTS))


def most_trust(observer: Observer) -> Trust:
    """The highest trust in the loads of an observer: does the load adapt, did its calibration see a vented rest?"""
    if not _adapts(observer):
        return "none"
    return "with care" if unvented_baseline(observer.calibration) else "good"


def _adapts(observer: Observer) -> bool:
    weights = observer.joint.mapped.actuator.load.names
    return any(c.base in weights for c in observer.joint.coordinates)


def indicators(run: ObservedRecording | LiveRun) -> Indicators:
    """The indicators of the load at the end of a recording, or so far."""
    load = engaging_load(run)
    stroke = np.linspace(0.0, run.observer.actuator.parameters.y_max, 101)
    peak = float(np.max(run.observer.load(run.after).force(stroke)))
    half = float(np.max(load.high - load.low)) / 2
    return Indicators(
        _adapts(run.observer),
        run.after.strokes,
        half / peak if peak > 0.0 else np.inf,
        run.after.mismatch if run.observer.compares else np.nan,
        _recent(run.after.faults),
        run.supply,
        run.after.rest_shift if run.observer.zero == "keep" else 0.0,
        _zero(run),
        tuple(unvented_baseline(run.observer.calibration)),
        *((_pressure(run), _travel(run)) if isinstance(run, ObservedRecording) else (None, None)),
    )


def _recent(faults: Faults) -> dict[str, float]:
    """Share of each flag of late, as its limit counts it."""
    share = kernels_in("clutchid.observer.faults_rule").recent
    return {name: share(faults, flag, FLAGGED[name].care) for flag, name in enumerate(FLAGS) if name in FLAGGED}


def _pressure(run: ObservedRecording) -> PressureTest | None:
    """The test of a recording by its measured pressure; none without one, or without a band."""
    if "pressure_a" not in run.log:
        return None
    estimated = run.samples.states[:, run.observer.actuator.states.index("p_A")]
    return pressure_test(run.log["pressure_a"], estimated, run.deviation("p_A"), run.observer.spacing)


def _travel(run: ObservedRecording) -> TravelChange | None:
    before = run.observer.calibration and run.observer.calibration.travel
    return travel_change(before, travel_of(run.log)) if before and np.isfinite(before.reach) else None


def _zero(run: ObservedRecording | LiveRun) -> ZeroKnown:
    if not run.after.jumped:
        return "no jump"
    if run.after.unzeroed:
        return "not shown" if run.observer.calibration and run.observer.calibration.rest else "no rest"
    return "shown" if run.observer.zero == "subtract" else "kept"


def observed_verdict(indicators: Indicators) -> Verdict:
    """Whether the load of an observer can be trusted, with the reasons that lower the trust.

    Examples
    --------
    A load that ten strokes have determined, of a truck that records its supply pressure:

    >>> observed_verdict(Indicators(True, 10, 0.03, 1.1, {}, "measured")).trust
    'good'
    """
    reasons, travel = [*_reasons(indicators)], indicators.travel
    unseen = (travel.sentence,) if travel and not travel.suspect and not travel.checked else ()
    flawed = any(reason.grave for reason in reasons)
    trust: Trust = "none" if flawed else "with care" if reasons else "good"
    return Verdict(trust, tuple(reason.text for reason in reasons), unseen, flawed)


def _reasons(indicators: Indicators) -> Iterator[Reason]:
    """Reasons that lower the trust: strokes, band, innovations, flags, supply, and the zero of the position."""
    strokes, half_width, (first, last) = indicators.strokes, indicators.half_width, ENGAGING
    if not indicators.adapts:
        yield Reason("this method does not adapt the load, which stays as calibrated.", True)
    elif strokes < STROKES.care:
        ended = "no stroke has" if strokes == 0 else f"{strokes:d} stroke has"
        yield Reason(
            f"{ended} ended, fewer than {STROKES.care:d}: the load is still the calibrated one, with a band for "
            "possible changes since; record more strokes.",
            strokes < STROKES.none,
        )
    if not half_width <= HALF_WIDTH.care:
        width = f"± {100 * half_width:.0f} % of the peak" if np.isfinite(half_width) else "infinite"
        yield Reason(
            f"the band of the load between {first * 1e3:.0f} and {last * 1e3:.0f} mm is {width}; at most ± "
            f"{100 * HALF_WIDTH.care:.0f} % is allowed; record more strokes.",
            not half_width <= HALF_WIDTH.none,
        )
    if indicators.mismatch > MISMATCH.care:
        yield Reason(
            f"the mean squared innovation in motion (NIS) is {indicators.mismatch:.1f} times that of the calibration "
            f"recordings, above the limit of {MISMATCH.care:g}: the model may no longer hold; look for a fault, or "
            "calibrate again.",
            indicators.mismatch > MISMATCH.none,
        )
    suspect = indicators.travel is not None and indicators.travel.suspect
    if indicators.travel and suspect:
        yield Reason(indicators.travel.sentence)
    for name, limit in FLAGGED.items():
        share = indicators.flagged.get(name, 0.0)
        if share > limit.care and not (suspect and name == "travel_unlike"):
            time = f"{float(f'{100 * share:.2g}'):g} % of the last {FADES:g} s"
            yield Reason(f"{FLAGS[name]} ({time}).", share > limit.none)
    if indicators.supply != "measured":
        advice = "; record it" if indicators.supply == "not recorded" else ""
        yield Reason(
            f"the supply pressure was {indicators.supply}: a supply pressure 5 % below that of the calibration would "
            f"look like a 6 % larger load, and the band allows for this{advice}."
        )
    if indicators.pressure and indicators.pressure.deviates:
        yield pressure_reason(indicators.pressure)
    yield from kept_rest(indicators.kept_shift)
    if indicators.zero != "no jump":
        yield Reason(
            "the position jumped faster than a piston can move, and stayed there: the sensor was zeroed again, or "
            f"two recordings were joined; {_ZEROS[indicators.zero]}",
            indicators.zero != "shown",
        )
    yield from indicators.unvented
