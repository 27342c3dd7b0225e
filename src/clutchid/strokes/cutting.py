"""`sections_of`: divide a recording, or consecutive pieces of one, into strokes and rests in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain

import numpy as np

from clutchid.log import Log, sample_interval
from clutchid.strokes.borders import CompletedSamples, PendingSamples, completed
from clutchid.strokes.rest_level import (
    Bins,
    RawBins,
    RestLevel,
    quantum_of,
    raw_bins,
    relative_to_rest,
    samples_in_bin,
    updated_levels,
    windows_of,
)
from clutchid.strokes.section import Section, SectionSummary
from clutchid.strokes.stream import StrokeSamples, blocks, last_known, pieces_of, stretches


@dataclass(frozen=True, slots=True, eq=False)
class _CuttingState:
    """State carried between blocks: rest level, sampling interval, last known position, time of the last sample."""

    level: RestLevel | None = None
    interval: float = 1.0
    position: float = np.nan
    time: float = np.nan


def sections_of(recording: Log | Iterable[Log]) -> Iterator[Section]:
    """Strokes and rests of a recording, in order of time.

    The sections are disjoint and contain every sample with known inputs. A hole in time or a missing input ends a
    section. A stroke goes from the vented rest back to it, with up to `LEAD` s of the rest before it. The level of the
    rest is estimated from the data, in blocks of `BLOCK` samples: the position to which the piston returns with the
    supply closed, its noise, and the reach from there. A hold longer than `LONGEST_HOLD` s is a section of its own, and
    sections longer than `LONGEST_SECTION` samples are divided, so memory is bounded by a few such lengths;
    `Section.divided` says where a stroke is.

    Parameters
    ----------
    recording : Log or Logs
        With a position in m and, if measured, duty cycles; or consecutive pieces of one recording. The lengths of the
        pieces have no influence on the result.

    Returns
    -------
    sections : Sections
        One after another while the recording is read.

    Raises
    ------
    DataError
        If there is no position, or a piece does not continue the one before.

    Examples
    --------
    Half a second up, half a second down, from a sensor whose zero is off by 1 mm:

    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> y = 1e-3 + np.interp(t, [1.5, 1.6, 2.0, 2.3], [0.0, 0.02, 0.02, 0.0])
    >>> for found in sections_of(Log(t, {"position": y})):
    ...     print(found.kind, round(found.start, 2), round(found.end, 2), f"{found.summary.level * 1e3:.1f} mm")
    rest 0.0 1.0 1.0 mm
    stroke 1.0 2.3 1.0 mm
    rest 2.3 4.0 1.0 mm
    """
    pieces = pieces_of(recording)
    first = next(pieces, None)
    if first is None:
        return
    described = partial(section, name=first.name, metadata=first.metadata)
    whole = blocks(chain([first], pieces))
    del first  # so that its samples can be freed
    after_stroke = -1
    for part in _parts(whole):
        if part is None:
            after_stroke = -1
            continue
        goes_on = part.samples.first == after_stroke and (part.long_hold or (part.kind == "stroke" and part.lead == 0))
        after_stroke = part.samples.first + len(part.samples) if part.kind == "stroke" else -1
        yield described(part, divided=goes_on)


def _parts(whole: Iterable[StrokeSamples]) -> Iterator[CompletedSamples | None]:
    """Completed strokes and rests of consecutive blocks, None at a hole."""
    carried, pending = _CuttingState(), None
    for block in whole:
        carried, binned = _binned(block, carried)
        for samples, bins, opens in binned:
            if opens and pending is not None:
                yield from (*completed(pending, final=True)[0], None)
                pending = None
            pending = PendingSamples(samples, bins) if pending is None else pending.followed_by(samples, bins)
        if pending is not None:
            parts, pending = completed(pending, final=False)
            yield from parts
    if pending is not None:
        yield from completed(pending, final=True)[0]


def _binned(
    block: StrokeSamples, before: _CuttingState
) -> tuple[_CuttingState, list[tuple[StrokeSamples, Bins, bool]]]:
    """State after a block, and the stretches of the block with their bins."""
    interval = sample_interval(block.time, before.interval)
    width = samples_in_bin(interval)
    pieces = stretches(block, before.time, interval)
    raws: list[RawBins] = []
    last = before.position
    for samples, _ in pieces:
        raws.append(raw_bins(samples, width, last))
        last = float(raws[-1].filled[-1])
    position = np.concatenate([np.zeros(0), *(raw.filled for raw in raws)])
    closed = np.concatenate([np.zeros(0, dtype=bool), *(raw.closed for raw in raws)])
    usable = np.isfinite(position)
    window = windows_of(width * interval)
    level = before.level
    if usable.any():
        level = updated_levels(level, position[usable], closed[usable], window, quantum_of(block.columns["position"]))
    rest = RestLevel(np.nan, np.nan, 0.0, 0.0) if level is None else level
    parts = [
        (samples, relative_to_rest(raw, rest, window), opens)
        for (samples, opens), raw in zip(pieces, raws, strict=True)
    ]
    return _CuttingState(level, interval, last, last_known(block)), parts


def section(part: CompletedSamples, name: str, metadata: Mapping[str, str], *, divided: bool) -> Section:
    """The section of a completed stroke or rest; samples are copied so that the recording can be freed."""
    samples = part.samples
    columns = {column: values.copy() for column, values in samples.columns.items()}
    log = Log(samples.time.copy(), columns, name, metadata, edges=samples.edges)
    departure = float(part.bins.time[min(part.lead, len(part.bins) - 1)])
    start, end = float(log.time[0]), float(log.time[-1])
    return Section(part.kind, log, start, end, departure, samples.first, _summary(part), divided)


def _summary(part: CompletedSamples) -> SectionSummary:
    samples, bins = part.samples, part.bins
    finite = int(np.count_nonzero(np.isfinite(samples.columns["position"])))
    return SectionSummary(
        lowest=float(np.fmin.reduce(bins.position)),
        highest=float(np.fmax.reduce(bins.position)),
        level=float(bins.level[0]),
        reach=float(bins.reach[0]),
        vented_rest=part.vented,
        missing=1.0 - finite / len(samples),
    )
