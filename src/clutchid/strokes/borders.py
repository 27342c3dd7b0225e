"""Borders between strokes and rests, and the samples of completed ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import BoolArray
from clutchid.parameters import DEFAULTS
from clutchid.strokes.rest_level import STILL, Bins, ranges
from clutchid.strokes.sampled import runs
from clutchid.strokes.section import SectionKind
from clutchid.strokes.stream import StrokeSamples
from clutchid.strokes.stroke import BEGINS

#: Length in s of the vented rest before a stroke that is part of its section: what a fit uses for the initial state.
LEAD = 0.5

#: A hold longer than this, in s, is not part of a stroke, except for `LEAD` s on either side.
LONGEST_HOLD = 10.0

#: Largest number of samples of a section, plus one block: memory is bounded, and a rest of hours is divided.
LONGEST_SECTION = 2**18

#: A chamber is vented where its pressure is at most this factor times the lowest of the rest; a rest above
#: `_PRESSED` times the ambient pressure is a hold.
_VENTED, _PRESSED = 1.1, 1.5

#: Motion within a hold, as a fraction of the reach: below it the piston is held.
_APART = 0.08


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
