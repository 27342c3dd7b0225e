"""Borders between strokes and rests, the samples of completed ones, and the label of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import BoolArray, FloatArray
from clutchid.parameters import DEFAULTS
from clutchid.strokes.rest_level import STILL, Bins, ranges
from clutchid.strokes.sampled import runs
from clutchid.strokes.section import SectionKind
from clutchid.strokes.stream import StrokeSamples
from clutchid.strokes.stroke import BEGINS, FULL

#: Length in s of the vented rest before a stroke that is part of its section: what a fit uses for the initial state.
LEAD = 0.5

#: A hold longer than this, in s, is not part of a stroke, except for `LEAD` s on either side.
LONGEST_HOLD = 10.0

#: Largest number of samples of a section, plus one block: memory is bounded, and a rest of hours is divided.
LONGEST_SECTION = 2**18

#: A chamber is vented where its pressure is at most this factor times the lowest of the rest; a rest above
#: `_PRESSED` times the ambient pressure is a hold.
_VENTED, _PRESSED = 1.1, 1.5


@dataclass(frozen=True, slots=True, eq=False)
class PendingSamples:
    """Samples of one stretch whose section is incomplete, and their bins; `vented` is the rest before them in s."""

    samples: StrokeSamples
    bins: Bins
    vented: float = 0.0

    def followed_by(self, samples: StrokeSamples, bins: Bins) -> PendingSamples:
        """These samples and the next ones."""
        return PendingSamples(self.samples.followed_by(samples), self.bins.followed_by(bins), self.vented)


@dataclass(frozen=True, slots=True, eq=False)
class CompletedSamples:
    """A complete stroke or rest; `vented` is the vented rest before it (for a rest: in it) in s.


    `long_hold` marks a hold longer than `LONGEST_HOLD`, `lead` is the number of bins of rest at the start of a stroke.
    """

    kind: SectionKind
    long_hold: bool
    samples: StrokeSamples
    bins: Bins
    vented: float
    lead: int


@dataclass(frozen=True, slots=True)
class _Span:
    """Bins `start` to `stop` of the pending ones; the rest before a stroke ends at bin `departs`."""

    kind: SectionKind
    start: int
    stop: int
    vented: float = 0.0
    long_hold: bool = False
    departs: int = 0


def completed(pending: PendingSamples, *, final: bool) -> tuple[list[CompletedSamples], PendingSamples | None]:
    """Complete strokes and rests, and what is still pending; with `final` everything is complete."""
    bins, n = pending.bins, len(pending.bins)
    full = len(pending.samples) > LONGEST_SECTION
    spans = [part for span in _spans(pending) for part in _without_holds(bins, span, final=final or full)]
    if final:
        return [_completed(pending, part) for span in spans for part in _divided(bins, span)], None
    *over, last = spans
    if not full:
        rest = _left(pending, last.start, _vented_before(pending, last))
        return [_completed(pending, span) for span in over], rest
    still = last.kind == "rest"
    keep = min(n - 1, int(np.searchsorted(bins.time, bins.time[-1] - LEAD))) if still else n
    keep = max(keep, last.start + 1)
    parts = [*over, *_divided(bins, replace(last, stop=keep))]
    vented = last.vented if still and not last.long_hold else 0.0
    overlap = float(bins.time[-1] - bins.time[keep]) if keep < n else 0.0
    return [_completed(pending, span) for span in parts], _left(pending, keep, max(vented - overlap, 0.0))


def _spans(pending: PendingSamples) -> list[_Span]:
    """Pending rests and strokes, in order and without gaps."""
    bins, n = pending.bins, len(pending.bins)
    spans: list[_Span] = []
    at = departs = 0
    vented = 0.0
    for a, b in _rests(bins):
        begin, end = _still_part(bins, a, b)
        spans.append(_Span("stroke", at, begin, vented, departs=departs))
        vented, departs = _vented(pending, begin, end), end
        at = end if b == n else max(begin, int(np.searchsorted(bins.time, bins.time[end] - LEAD)))
        if b < n and _seconds(bins, begin, at) < STILL:
            at = begin
        spans.append(_Span("rest", begin, at, vented))
    spans.append(_Span("stroke", at, n, vented, departs=departs))
    return [span for span in spans if span.stop > span.start]


def _still_part(bins: Bins, a: int, b: int) -> tuple[int, int]:
    """The part of a rest in which the position varies by noise only; the band of the rest is wider than that.

    Supply pulses within `LEAD` s before the motion, and before each other, belong to the stroke: they fill the chamber.
    """
    begin, end = a, b
    if a > 0:
        off = np.abs(bins.filled[a:b] - np.median(bins.filled[a:b]))
        begin = a + int(np.argmax(off <= bins.near[a:b]))
    if b < len(bins):
        late = max(begin, min(int(np.searchsorted(bins.time, bins.time[b] - LEAD)), b - 1))
        off = np.abs(bins.filled[late:b] - np.median(bins.filled[late:b]))
        end = max(begin, b - int(np.argmax((off <= bins.near[late:b])[::-1])))
        for opened in reversed((begin + np.flatnonzero(~bins.closed[begin:end])).tolist()):
            if bins.time[end] - bins.time[opened] > LEAD:
                break
            end = opened
    return begin, end


def _rests(bins: Bins) -> list[tuple[int, int]]:
    """Bins at rest: in the band, supply closed, for `STILL` s; a pulse without motion belongs to the rest."""
    n = len(bins)
    long = [(a, b) for a, b in runs(bins.inside & bins.closed) if a == 0 or _seconds(bins, a, b) >= STILL]
    outside = np.concatenate([[0], np.cumsum(~bins.inside)])
    merged: list[tuple[int, int]] = []
    for a, b in long:
        if merged and outside[a] - outside[merged[-1][1]] < 2:
            merged[-1] = merged[-1][0], b
        else:
            merged.append((a, b))
    if merged and outside[n] - outside[merged[-1][1]] < 2 and merged[-1][1] < n:
        merged[-1] = merged[-1][0], n
    return merged


def _seconds(bins: Bins, start: int, stop: int) -> float:
    """Length of the bins `start` to `stop` in s, to the start of the next bin or the last one there is."""
    return float(bins.time[min(stop, len(bins) - 1)] - bins.time[start]) if stop > start else 0.0


def _vented(pending: PendingSamples, begin: int, end: int) -> float:
    """Time in s at the end of a rest with the supply closed and, where pressure is measured, the chamber vented."""
    bins = pending.bins
    opened = np.flatnonzero(~bins.closed[begin:end])
    since = begin + (int(opened[-1]) + 1 if opened.size else 0)
    pressure = bins.pressure[since:end]
    finite = pressure[np.isfinite(pressure)]
    if finite.size:
        floor = float(finite.min())
        if floor > _PRESSED * DEFAULTS.P_0:
            return 0.0
        pressed = np.flatnonzero(pressure > _VENTED * floor)
        since += int(pressed[-1]) + 1 if pressed.size and pressed[-1] < pressure.size - 1 else 0
    earlier = pending.vented if since == 0 else 0.0
    return earlier + _seconds(bins, since, end)


def _without_holds(bins: Bins, span: _Span, *, final: bool) -> list[_Span]:
    """Divide a stroke at its long holds, which become rests; a hold that has not ended stays pending."""
    if span.kind == "rest":
        return [span]
    holds = _holds(bins.part(span.start, span.stop))
    if span.departs <= span.start and holds.all():
        return [replace(span, kind="rest", vented=0.0, long_hold=True)]
    spans, at, vented, departs = [], span.start, span.vented, span.departs
    for a, b in runs(holds):
        begin, end = a + span.start, b + span.start
        if _seconds(bins, begin, end) < LONGEST_HOLD or (end == len(bins) and not final):
            continue
        first = begin if begin == at else int(np.searchsorted(bins.time, bins.time[begin] + LEAD))
        last = end if end == span.stop else int(np.searchsorted(bins.time, bins.time[end] - LEAD))
        if first > at:
            spans.append(_Span("stroke", at, first, vented, departs=departs))
        spans.append(_Span("rest", first, last, 0.0, long_hold=True))
        at, vented, departs = last, 0.0, end
    return [*spans, _Span("stroke", at, span.stop, vented, departs=departs)] if at < span.stop else spans


def _holds(bins: Bins) -> BoolArray:
    """Where the piston is still; not in slow motion: by more than `BEGINS` and `_APART` in `LONGEST_HOLD` s."""
    still = bins.still
    for a, b in runs(still):
        position, most = bins.filled[a:b], np.fmax(_APART * bins.reach[a:b], BEGINS)
        if _seconds(bins, a, b) < LONGEST_HOLD or not np.ptp(position) > most.min():
            continue
        width = int(np.searchsorted(bins.time, bins.time[a] + LONGEST_HOLD)) - a
        stays = ranges(position, width) <= most
        still = np.concatenate([still[:a], stays | (ranges(stays.astype(np.float64), width) > 0.0), still[b:]])
    return still


def _divided(bins: Bins, span: _Span) -> list[_Span]:
    """Parts of at most `LONGEST_SECTION` samples; of a stroke, only the first follows the vented rest."""
    edges = np.append(bins.first, bins.first[-1] + bins.count[-1])
    parts, start, vented = [], span.start, span.vented
    while edges[span.stop] - edges[start] > LONGEST_SECTION:
        stop = max(start + 1, int(np.searchsorted(edges, edges[start] + LONGEST_SECTION, side="right")) - 1)
        parts.append(replace(span, start=start, stop=stop, vented=vented))
        start, vented = stop, vented if span.kind == "rest" else 0.0
    return [*parts, replace(span, start=start, vented=vented)]


def _vented_before(pending: PendingSamples, last: _Span) -> float:
    """Vented rest in s before the bins that stay pending."""
    if last.start == 0:
        return pending.vented
    return 0.0 if last.kind == "rest" else max(last.vented - _seconds(pending.bins, last.start, last.departs), 0.0)


def _left(pending: PendingSamples, start: int, vented: float) -> PendingSamples | None:
    """The pending samples from bin `start` on."""
    if start >= len(pending.bins):
        return None
    at = int(pending.bins.first[start] - pending.bins.first[0])
    samples = pending.samples.part(at, len(pending.samples))
    return PendingSamples(samples, pending.bins.part(start, len(pending.bins)), vented)


def _completed(pending: PendingSamples, span: _Span) -> CompletedSamples:
    edges = np.append(pending.bins.first, pending.samples.first + len(pending.samples)) - pending.samples.first
    samples = pending.samples.part(int(edges[span.start]), int(edges[span.stop]))
    lead = max(span.departs - span.start, 0) if span.kind == "stroke" else 0
    return CompletedSamples(
        span.kind, span.long_hold, samples, pending.bins.part(span.start, span.stop), span.vented, lead
    )


#: Fractions of the reach: least amplitude of a swing and of a swing in slip, least distance between distinct levels,
#: and the range of positions in which the clutch slips.
_SWING, _SLIP_SWING, _APART, _SLIP_ZONE = 0.3, 0.02, 0.08, (0.06, 0.6)

#: Half the number of bins over which these speeds are computed.
_SLOPE_BINS = 5

#: Speeds in reaches per second: slip is slower than `_SLOW`, a controlled return slower than `_EASED` (a free return
#: has 4 or more), a hold slower than `_HOLDS`.
_SLOW, _EASED, _HOLDS = 1.0, 1.5, 0.1

#: Least times in s: of a ramp while opening or in the upper half of the return; of a held level; of any slip; and of a
#: slip that is longer than that of a gear shift.
RAMP, _HELD, _SHORT_SLIP, _LONG_SLIP = 0.8, 0.25, 0.12, 1.2

#: Fractions of a stroke's length: bang-bang motion is still for less than `_MOVING`, a staircase slips for less than
#: `_SLIPPING`.
_MOVING, _SLIPPING = 0.25, 0.45

#: A rest with a larger fraction of its positions missing is labelled "no position".
_MOST_MISSING = 0.5


@dataclass(frozen=True, slots=True)
class MotionFeatures:
    """Features that classify a manoeuvre; positions as fractions of the reach, times in s.

    Length; highest position; number of distinct held levels, and of reversals after swings of `_SWING`; time of slow
    motion while opening, and in the upper half of the final return; time of slow motion in `_SLIP_ZONE` during that
    return, and the reversals in it; time there below `_EASED`; fraction of the length during which the piston is still.
    """

    seconds: float
    peak: float
    levels: int
    swings: int
    opening: float
    upper: float
    slip: float
    slip_swings: int
    eased: float
    still: float


def motion_features(time: FloatArray, y: FloatArray, still: BoolArray) -> MotionFeatures:
    """Features of a stroke that classify it.

    Parameters
    ----------
    time : s
        Bins of about 10 ms, at least two.
    y : 1
        Position above the vented rest as a fraction of the reach, above 0 somewhere.
    still
        Where the position is still.
    """
    step = np.diff(time, append=time[-1])
    peak = float(y.max())
    top = np.flatnonzero(y >= 0.9 * peak)
    back, before, after = y[top[-1] :], slice(0, top[0]), slice(top[-1], None)
    speed = _slopes(time, y)
    creeps = (np.abs(speed) < _SLOW) & (np.abs(speed) > _HOLDS)
    zone = (back > _SLIP_ZONE[0]) & (back < _SLIP_ZONE[1])
    slow = zone & (np.abs(speed[after]) < _SLOW)
    return MotionFeatures(
        seconds=float(time[-1] - time[0]),
        peak=peak,
        levels=_levels(time, y, np.abs(speed) < _HOLDS),
        swings=_swings(y, _SWING),
        opening=float(step[before][creeps[before] & (speed[before] > 0) & (y[before] > 0.1 * peak)].sum()),
        upper=float(step[after][creeps[after] & (back > 0.5 * peak)].sum()),
        slip=float(step[after][slow].sum()),
        slip_swings=_swings(back[slow], _SLIP_SWING),
        eased=float(step[after][zone & (np.abs(speed[after]) < _EASED)].sum()),
        still=float(step[still].sum() / max(step.sum(), 1e-9)),
    )


#: Labels of strokes and their conditions; the first condition that holds decides, and the last one always holds.
_RULES: tuple[tuple[str, Callable[[MotionFeatures], bool]], ...] = (
    ("bang-bang", lambda c: c.swings >= 4 and c.still < _MOVING),
    ("ramp", lambda c: max(c.opening, c.upper) >= RAMP and c.levels <= 1 and c.swings <= 1),
    ("staircase", lambda c: c.swings >= 3 or (c.levels >= 3 and c.slip < _SLIPPING * c.seconds)),
    ("slip control", lambda c: c.slip >= _LONG_SLIP and c.slip_swings >= 1),
    ("partial stroke", lambda c: c.peak < FULL),
    ("full stroke", lambda c: c.eased < _SHORT_SLIP),
    ("gear shift", lambda c: c.slip < _LONG_SLIP),
    ("pull-away", lambda c: True),  # noqa: ARG005
)

#: Labels of strokes, in the field's words.
STROKE_LABELS = tuple(label for label, _ in _RULES)


def stroke_label(bins: Bins) -> str:
    """Label of a stroke, one of `STROKE_LABELS`; "partial stroke" if it stays at the rest level."""
    moving = np.isfinite(bins.position) & (bins.reach > 0)
    y = (bins.position - bins.level)[moving] / bins.reach[moving]
    if y.size < 3 or float(y.max()) <= _SLIP_ZONE[0]:
        return "partial stroke"
    features = motion_features(bins.time[moving], y, bins.still[moving])
    return next(label for label, holds in _RULES if holds(features))


def rest_label(bins: Bins, *, long_hold: bool, missing: float) -> str:
    """Label of a rest, one of `RESTS`: "held" if it is away from the rest level or under pressure."""
    if missing > _MOST_MISSING:
        return "no position"
    pressure = bins.pressure[np.isfinite(bins.pressure)]
    pressed = pressure.size > 0 and float(np.median(pressure)) > _PRESSED * DEFAULTS.P_0
    return "held" if long_hold or pressed or not np.median(bins.inside) else "vented rest"


def _slopes(time: FloatArray, y: FloatArray) -> FloatArray:
    """Slope over `_SLOPE_BINS` bins before and after each bin, fewer at the ends."""
    here = np.arange(time.size)
    a, b = np.maximum(here - _SLOPE_BINS, 0), np.minimum(here + _SLOPE_BINS, time.size - 1)
    return (y[b] - y[a]) / (time[b] - time[a])


def _levels(time: FloatArray, y: FloatArray, slow: BoolArray) -> int:
    """Number of distinct held levels."""
    off = slow & (y > _SLIP_ZONE[0])
    levels = [float(np.median(y[a:b])) for a, b in runs(off) if time[b - 1] - time[a] >= _HELD]
    count, last = 0, -np.inf
    for level in sorted(levels):
        if level > last + _APART:
            count, last = count + 1, level
    return count


def _swings(y: FloatArray, size: float) -> int:
    """Number of reversals after a swing of more than `size`."""
    turns, low, high, rising = 0, np.inf, -np.inf, 0
    for value in y.tolist():
        low, high = min(low, value), max(high, value)
        if rising >= 0 and value < high - size:
            turns += rising > 0 or turns > 0
            rising, low = -1, value
        elif rising <= 0 and value > low + size:
            turns += rising < 0
            rising, high = 1, value
    return int(turns)
