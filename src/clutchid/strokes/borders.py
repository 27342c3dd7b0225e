"""Where strokes and rests begin and end, and how much of what waits can be settled before more has come."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.parameters import Parameters
from clutchid.strokes.bins import Bins
from clutchid.strokes.rest_level import STILL, BoolArray
from clutchid.strokes.section import Kind
from clutchid.strokes.stream import Samples

#: Vented rest before a stroke that goes with it, in s: as much as a fit looks at to tell the start.
LEAD = 0.5

#: A hold longer than this, in s, is no part of a stroke, but for `LEAD` s of it on either side.
LONGEST_HOLD = 10.0

#: No section has more samples than this and a block: memory is bounded, and a rest of hours comes in parts.
LONGEST = 2**18

#: A chamber is vented where its pressure is at most this many times the lowest of the rest; a rest at more than
#: `PRESSED` times the ambient pressure is a hold.
VENTED, PRESSED = 1.1, 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Waiting:
    """Samples of one stretch that are not yet settled, and their bins; `vented` is the rest already settled in s."""

    samples: Samples
    bins: Bins
    vented: float = 0.0

    def followed_by(self, samples: Samples, bins: Bins) -> Waiting:
        """The same with more samples."""
        return Waiting(self.samples.followed_by(samples), self.bins.followed_by(bins), self.vented)


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A settled stroke or rest; `vented` is the vented rest before it (in it, for a rest) in s, `held` a long hold.

    `lead` is the number of bins of rest with which a stroke begins.
    """

    kind: Kind
    held: bool
    samples: Samples
    bins: Bins
    vented: float
    lead: int


@dataclass(frozen=True, slots=True)
class _Span:
    """Bins `start` to `stop` of what waits; a stroke's rest ends at bin `departs`."""

    kind: Kind
    start: int
    stop: int
    vented: float = 0.0
    held: bool = False
    departs: int = 0


def settled(waiting: Waiting, *, final: bool) -> tuple[list[Piece], Waiting | None]:
    """Strokes and rests that are over, and what still waits; with `final` everything is over."""
    bins, n = waiting.bins, len(waiting.bins)
    full = len(waiting.samples) > LONGEST
    spans = [part for span in _spans(waiting) for part in _without_holds(bins, span, final=final or full)]
    if final:
        return [_piece(waiting, part) for span in spans for part in _divided(bins, span)], None
    *over, last = spans
    if not full:
        rest = _left(waiting, last.start, _vented_before(waiting, last))
        return [_piece(waiting, span) for span in over], rest
    still = last.kind == "rest"
    keep = min(n - 1, int(np.searchsorted(bins.time, bins.time[-1] - LEAD))) if still else n
    keep = max(keep, last.start + 1)
    parts = [*over, *_divided(bins, replace(last, stop=keep))]
    vented = last.vented if still and not last.held else 0.0
    overlap = float(bins.time[-1] - bins.time[keep]) if keep < n else 0.0
    return [_piece(waiting, span) for span in parts], _left(waiting, keep, max(vented - overlap, 0.0))


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Ranges (start, stop) in which `mask` is true throughout."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _spans(waiting: Waiting) -> list[_Span]:
    """Rests and strokes of what waits, in order and without gaps."""
    bins, n = waiting.bins, len(waiting.bins)
    found: list[_Span] = []
    at = departs = 0
    vented = 0.0
    for a, b in _rests(bins):
        begin, end = _still_part(bins, a, b)
        found.append(_Span("stroke", at, begin, vented, departs=departs))
        vented, departs = _vented(waiting, begin, end), end
        at = end if b == n else max(begin, int(np.searchsorted(bins.time, bins.time[end] - LEAD)))
        if b < n and _seconds(bins, begin, at) < STILL:
            at = begin
        found.append(_Span("rest", begin, at, vented))
    found.append(_Span("stroke", at, n, vented, departs=departs))
    return [span for span in found if span.stop > span.start]


def _still_part(bins: Bins, a: int, b: int) -> tuple[int, int]:
    """The part of a rest in which only noise moves the position: the band is wider, and the piston settles slowly.

    Supply pulses within `LEAD` s before the motion, and before each other, belong to it: their air is in the chamber.
    """
    begin, end = a, b
    if a > 0:
        off = np.abs(bins.filled[a:b] - np.median(bins.filled[a:b]))
        begin = a + int(np.argmax(off <= bins.near[a:b]))
    if b < len(bins):
        late = max(begin, int(np.searchsorted(bins.time, bins.time[b] - LEAD)))
        off = np.abs(bins.filled[late:b] - np.median(bins.filled[late:b]))
        end = max(begin, b - int(np.argmax((off <= bins.near[late:b])[::-1])))
        for opened in reversed((begin + np.flatnonzero(~bins.closed[begin:end])).tolist()):
            if bins.time[end] - bins.time[opened] > LEAD:
                break
            end = opened
    return begin, end


def _rests(bins: Bins) -> list[tuple[int, int]]:
    """Bins at rest: in the band, supply closed, for `STILL` s; a pulse that moves nothing belongs to a rest."""
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


def _vented(waiting: Waiting, begin: int, end: int) -> float:
    """Time in s at the end of a rest for which the supply has been closed and, where it is measured, the air is out."""
    bins = waiting.bins
    opened = np.flatnonzero(~bins.closed[begin:end])
    since = begin + (int(opened[-1]) + 1 if opened.size else 0)
    pressure = bins.pressure[since:end]
    known = pressure[np.isfinite(pressure)]
    if known.size:
        floor = float(known.min())
        if floor > PRESSED * Parameters().P_0:
            return 0.0
        pressed = np.flatnonzero(pressure > VENTED * floor)
        since += int(pressed[-1]) + 1 if pressed.size and pressed[-1] < pressure.size - 1 else 0
    earlier = waiting.vented if since == 0 else 0.0
    return earlier + _seconds(bins, since, end)


def _without_holds(bins: Bins, span: _Span, *, final: bool) -> list[_Span]:
    """A stroke without the long holds in it, which become rests, or wholly a hold; a hold that is not over waits."""
    if span.kind == "rest":
        return [span]
    if span.departs <= span.start and bins.still[span.start : span.stop].all():
        return [replace(span, kind="rest", vented=0.0, held=True)]
    found, at, vented, departs = [], span.start, span.vented, span.departs
    for a, b in runs(bins.still[span.start : span.stop]):
        begin, end = a + span.start, b + span.start
        if _seconds(bins, begin, end) < LONGEST_HOLD or (end == len(bins) and not final):
            continue
        first = begin if begin == at else int(np.searchsorted(bins.time, bins.time[begin] + LEAD))
        last = end if end == span.stop else int(np.searchsorted(bins.time, bins.time[end] - LEAD))
        if first > at:
            found.append(_Span("stroke", at, first, vented, departs=departs))
        found.append(_Span("rest", first, last, 0.0, held=True))
        at, vented, departs = last, 0.0, end
    return [*found, _Span("stroke", at, span.stop, vented, departs=departs)] if at < span.stop else found


def _divided(bins: Bins, span: _Span) -> list[_Span]:
    """A span in parts of at most `LONGEST` samples; only the first one has the vented rest of a stroke before it."""
    edges = np.append(bins.first, bins.first[-1] + bins.count[-1])
    found, start, vented = [], span.start, span.vented
    while edges[span.stop] - edges[start] > LONGEST:
        stop = max(start + 1, int(np.searchsorted(edges, edges[start] + LONGEST, side="right")) - 1)
        found.append(replace(span, start=start, stop=stop, vented=vented))
        start, vented = stop, vented if span.kind == "rest" else 0.0
    return [*found, replace(span, start=start, vented=vented)]


def _vented_before(waiting: Waiting, last: _Span) -> float:
    """Vented rest in s before what is left waiting."""
    if last.start == 0:
        return waiting.vented
    return 0.0 if last.kind == "rest" else max(last.vented - _seconds(waiting.bins, last.start, last.departs), 0.0)


def _left(waiting: Waiting, start: int, vented: float) -> Waiting | None:
    """What waits from bin `start` on."""
    if start >= len(waiting.bins):
        return None
    at = int(waiting.bins.first[start] - waiting.bins.first[0])
    samples = waiting.samples.part(at, len(waiting.samples))
    return Waiting(samples, waiting.bins.part(start, len(waiting.bins)), vented)


def _piece(waiting: Waiting, span: _Span) -> Piece:
    edges = np.append(waiting.bins.first, waiting.samples.first + len(waiting.samples)) - waiting.samples.first
    samples = waiting.samples.part(int(edges[span.start]), int(edges[span.stop]))
    lead = max(span.departs - span.start, 0) if span.kind == "stroke" else 0
    return Piece(span.kind, span.held, samples, waiting.bins.part(span.start, span.stop), span.vented, lead)
