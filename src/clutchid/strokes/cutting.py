"""`cut`: a recording, or the pieces of one, into strokes and rests, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from clutchid.log import Log
from clutchid.strokes.bins import Bins, RawBins, judged, raw_bins, samples_in_bin
from clutchid.strokes.borders import Piece, Waiting, settled
from clutchid.strokes.describing import section
from clutchid.strokes.rest_level import RestLevel, followed, quantum_of, windows_of
from clutchid.strokes.section import Section
from clutchid.strokes.stream import Samples, Stretch, blocks, last_known, pieces_of, stretches, usual_interval


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What goes on from block to block: level of the rest, usual interval, last known position, time of the last."""

    level: RestLevel | None = None
    interval: float = 1.0
    position: float = np.nan
    time: float = np.nan


def cut(recording: Log | Iterable[Log]) -> Iterator[Section]:
    """Strokes and rests of a recording, in order of time.

    The sections are disjoint and hold every sample whose inputs are known. A hole in time or a missing input ends a
    section. A stroke goes from the vented rest back to it, with up to `LEAD` s of the rest before it. What counts as
    rest is learnt from the data, in blocks of `BLOCK` samples: the level to which the piston returns with the supply
    closed, its noise, and how far from there the piston goes. A hold longer than `LONGEST_HOLD` s is a section of its
    own, and what lasts longer than `LONGEST` samples is divided, so memory is bounded by a few such lengths.

    Parameters
    ----------
    recording : Log or Logs
        With a position in m and, where there are any, duty cycles; or consecutive pieces of one, of any lengths: where
        they are divided does not matter.

    Returns
    -------
    sections : Sections
        One after the other, as the recording is read.

    Raises
    ------
    DataError
        If there is no position, or a piece does not continue the one before.

    Examples
    --------
    Half a second up, half a second down, from a sensor whose zero is off by 1 mm:

    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> y = 1e-3 + np.interp(t, [1.5, 1.6, 2.0, 2.3], [0.0, 0.02, 0.02, 0.0])
    >>> for found in cut(Log(t, {"position": y})):
    ...     print(found.label, round(found.start, 2), round(found.end, 2), f"{found.excitation.level * 1e3:.1f} mm")
    vented rest 0.0 1.0 1.0 mm
    full stroke 1.0 2.3 1.0 mm
    vented rest 2.3 4.0 1.0 mm
    """
    known, waiting, name = _Known(), None, "log"
    metadata: dict[str, str] = {}

    def noted() -> Iterator[Log]:
        nonlocal name
        for number, piece in enumerate(pieces_of(recording)):
            if number == 0:
                name = piece.name
                metadata.update(piece.metadata)
            yield piece

    def described(pieces: Iterable[Piece]) -> Iterator[Section]:
        for piece in pieces:
            yield section(piece, name, metadata)

    for block in blocks(noted()):
        known, parts = _observed(block, known)
        for samples, bins, opens in parts:
            if opens and waiting is not None:
                yield from described(settled(waiting, final=True)[0])
                waiting = None
            waiting = Waiting(samples, bins) if waiting is None else waiting.followed_by(samples, bins)
        if waiting is not None:
            pieces, waiting = settled(waiting, final=False)
            yield from described(pieces)
    if waiting is not None:
        yield from described(settled(waiting, final=True)[0])


def _observed(block: Samples, before: _Known) -> tuple[_Known, list[tuple[Samples, Bins, bool]]]:
    """What is known after a block, and its stretches with their bins."""
    interval = usual_interval(block, before.interval)
    width = samples_in_bin(interval)
    found: list[Stretch] = stretches(block, before.time, interval)
    raws: list[RawBins] = []
    last = before.position
    for stretch in found:
        raws.append(raw_bins(block.part(stretch.start, stretch.stop), width, last))
        last = float(raws[-1].filled[-1])
    position = np.concatenate([raw.filled for raw in raws]) if raws else np.zeros(0)
    closed = np.concatenate([raw.closed for raw in raws]) if raws else np.zeros(0, dtype=bool)
    usable = np.isfinite(position)
    window = windows_of(width * interval)
    level = before.level
    if usable.any():
        level = followed(level, position[usable], closed[usable], window, quantum_of(block.columns["position"]))
    judge = RestLevel(np.nan, np.nan, 0.0, 0.0) if level is None else level
    parts = [
        (block.part(stretch.start, stretch.stop), judged(raw, judge, window), stretch.opens)
        for stretch, raw in zip(found, raws, strict=True)
    ]
    return _Known(level, interval, last, last_known(block)), parts
