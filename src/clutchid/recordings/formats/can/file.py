"""CAN logs: BLF, ASC, TRC and MF4 bus logging, decoded with DBC files; a raster a message.

The frames are read once when a log is opened, to see which messages occur in it. Those that a DBC knows are kept as
long as they take no more than `can_scan.KEPT` bytes; else the file is read again for each raster.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.recordings.columns import Heading
from clutchid.recordings.formats.can.dbc import decode, read_dbc
from clutchid.recordings.formats.can.frames import FrameLog, payloads
from clutchid.recordings.formats.can.scan import Piece, decoding_problem, pieces, raster_names, scan, scan_warnings
from clutchid.recordings.formats.can.streams import Book, Stream, book, channels_of, in_order
from clutchid.recordings.formats.kinds import head_of, kind_of
from clutchid.recordings.source import Places, Raster, Source, Table, refused


def frame_log(path: Path, kind: str = "") -> FrameLog:
    """The raw frames of a CAN log of the format `kind`, see `kind_of`; it is found where it is not given.

    Raises
    ------
    MissingExtra
        If the library that reads the format is not installed.
    DataError
        If it is none of them, or cannot be read.
    OSError
        If the file cannot be read.
    """
    from clutchid.recordings.formats.can import blf, mf4, text

    readers = {"blf": blf.frame_log, "asc": text.asc_log, "trc": text.trc_log, "mdf": mf4.frame_log}
    kind = kind or kind_of(head_of(path))
    if kind not in readers:
        raise DataError("is no CAN log; BLF, ASC, TRC and MF4 bus logging are read.")
    return readers[kind](path)


def open_file(path: Path, dbc: Sequence[Path] = (), kind: str = "") -> Source:
    """A CAN log, decoded: a raster a message that occurs in it, its stamps in s from the first frame of the file.

    Signals under a multiplexer become rasters of their own, one a page. A message that comes on several buses, or from
    or to several addresses (J1939), becomes several rasters. What is left out is counted in ``Source.warnings``.

    Parameters
    ----------
    path : Path
        The log: BLF, ASC, TRC, or MF4 bus logging.
    dbc : sequence of Path
        The DBC files that say what the frames mean; of two that know the same frame the first counts.
    kind : str
        The format, where it is known already.

    Returns
    -------
    source : Source
        Without rasters, and with a problem that says why, where there is no DBC or nothing that it knows.

    Raises
    ------
    MissingExtra
        If the library that reads the log or the DBC is not installed.
    DataError
        If a DBC file cannot be read as such.
    OSError
        If a file cannot be read.
    """
    messages = tuple(message for file in dbc for message in read_dbc(Path(file)))
    try:
        log = frame_log(path, kind)
    except DataError as error:
        return refused(path, "CAN log", str(error))
    known = book(messages)
    seen = scan(log, known)
    problem = decoding_problem(seen, dbc)
    metadata = _metadata(log, seen.origin, dbc)
    if problem:
        return replace(refused(path, log.format, problem, *log.warnings), metadata=metadata)
    streams = in_order(seen.sizes, messages)
    names = raster_names(streams)
    rasters = tuple(
        Raster(channels_of(stream), seen.sizes[stream], name, 0) for stream, name in zip(streams, names, strict=True)
    )
    tables = _Reading(log, known, tuple(streams), tuple(raster.headings for raster in rasters), seen.origin, seen.kept)
    warnings = (*log.warnings, *scan_warnings(seen, streams))
    return Source(path, log.format, rasters, tables, (), warnings, metadata)


def _metadata(log: FrameLog, origin: float, dbc: Sequence[Path]) -> dict[str, str]:
    found = {"dbc": ", ".join(Path(file).name for file in dbc)} if dbc else {}
    try:
        start = log.start + timedelta(seconds=origin) if log.start else None
    except OverflowError:
        start = None
    return {"start": start.isoformat(), **found} if start else found


@dataclass(frozen=True, eq=False, slots=True)
class _Reading:
    """Reads the rasters of a log, from the frames that are kept or else from the file."""

    log: FrameLog
    known: Book
    streams: tuple[Stream, ...]
    headings: tuple[tuple[Heading, ...], ...]
    origin: float
    kept: Mapping[Stream, list[Piece]] | None

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of at most `rows` frames of one raster."""
        stream, headings = self.streams[raster], self.headings[raster]
        first = 1
        found = iter(self.kept[stream]) if self.kept is not None else pieces(self.log, self.known, stream)
        for piece in _in_rows(found, rows):
            numbers = {column: self._numbers(stream, column, piece) for column in columns}
            yield Table(headings, numbers, len(piece), Places("frame", first))
            first += len(piece)

    def _numbers(self, stream: Stream, column: int, piece: Piece) -> FloatArray:
        if column == 0:
            return piece.stamp - self.origin
        return decode(stream.page.signals[column - 1], piece.data, piece.length.astype(np.int64))


def _in_rows(pieces: Iterator[Piece], rows: int | None) -> Iterator[Piece]:
    """The same frames in pieces of exactly `rows`, but for the last; in one where `rows` is None."""
    waiting: list[Piece] = []
    for piece in pieces:
        waiting.append(piece)
        while rows is not None and sum(map(len, waiting)) >= rows:
            joined = _joined(waiting)
            yield Piece(joined.stamp[:rows], joined.data[:rows], joined.length[:rows])
            waiting = [Piece(joined.stamp[rows:], joined.data[rows:], joined.length[rows:])]
    if any(map(len, waiting)):
        yield _joined(waiting)


def _joined(pieces: Sequence[Piece]) -> Piece:
    stamps, lengths = [piece.stamp for piece in pieces], [piece.length for piece in pieces]
    return Piece(np.concatenate(stamps), payloads([piece.data for piece in pieces]), np.concatenate(lengths))
