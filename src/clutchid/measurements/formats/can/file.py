"""Logs of frames (binary, text and tables), decoded with DBC files: a time grid a message.

The frames are read once when a log is opened, to find the messages in it. Those that a DBC decodes are kept as long as
they take no more than `KEPT_FRAMES` bytes; else the file is read again for each time grid.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.measurements.clock import LONE, Run, Tolerance, cuts, sentences, shifts_of, usual_interval
from clutchid.measurements.formats.can import streams as frame_streams
from clutchid.measurements.formats.can.dbc import Message, read_dbc
from clutchid.measurements.formats.can.frames import Bytes, FrameLog, Frames, payloads
from clutchid.measurements.formats.can.j1939 import group_number
from clutchid.measurements.formats.kinds import format_of, function_named, head_of, kind_of
from clutchid.measurements.source import Places, Rows, Source, Table, refused
from clutchid.messages import listed

#: Bytes of frames that are kept in memory between the passes over a log: about 15 million classic frames.
KEPT_FRAMES = 1 << 28

_MOST_UNKNOWN = 1 << 16


def frame_log(path: Path, kind: str = "") -> FrameLog:
    """The raw frames of a CAN log of the format `kind`, see `kind_of`; detected from the content where it is not given.

    Raises
    ------
    MissingExtra
        If the library that reads the format is not installed.
    DataError
        If it is no CAN log, or cannot be read.
    OSError
        If the file cannot be read.
    """
    frames = format_of(kind or kind_of(head_of(path))).frames
    log: FrameLog | None = function_named(frames)(path) if frames else None
    if log is None:
        raise DataError("is not a CAN log; BLF, ASC, TRC and MF4 bus logs are read.")
    return log


def open_file(path: Path, dbc: Sequence[Path] = (), kind: str = "", log: FrameLog | None = None) -> Source:
    """A CAN log, decoded: a time grid for each message in it, with time stamps in s from the first frame of the file.

    Signals under a multiplexer become time grids of their own, one for each group. A message that comes on several
    buses, or from or to several addresses (J1939), becomes several time grids. What is left out is counted in
    ``Source.warnings``.

    Parameters
    ----------
    path : Path
        The log: BLF, ASC, TRC, or MF4 bus logging.
    dbc : sequence of Path
        The DBC files that decode the frames; of two that define the same frame the first counts.
    kind : str
        The format, if it is known already.
    log : FrameLog
        The frames, if the file is open already.

    Returns
    -------
    source : Source
        Without time grids, and with a problem that gives the reason, if no DBC decodes any frame.

    Raises
    ------
    MissingExtra
        If the library that reads the log or the DBC is not installed.
    DataError
        If a DBC file cannot be read as such.
    OSError
        If a file cannot be read.
    """
    lookup = frame_streams.catalogue([message for file in dbc for message in read_dbc(file)])
    try:
        log = log or frame_log(path, kind)
    except DataError as error:
        return refused(path, "CAN log", str(error))
    scanned = _scan(log, lookup)
    metadata = _metadata(log, scanned.origin, dbc)
    undated = () if log.start else ("does not say when it was recorded: its time stamps start at the first frame.",)
    if problem := _decoding_problem(scanned, dbc, lookup.messages):
        return replace(refused(path, log.format, problem, *log.warnings, *undated), metadata=metadata)
    streams = frame_streams.streams_in_order(scanned.sizes, lookup.messages)
    rasters = frame_streams.stream_rasters(streams, scanned.sizes)

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of one time grid, from the frames that are kept, or else from the file."""
        stream, first = streams[raster], 1
        parts = iter(scanned.stored[stream]) if scanned.stored is not None else _read_again(log, lookup, stream)
        for frames in _in_rows(_on_one_clock(parts, scanned), rows):
            numbers = frame_streams.stream_values(stream, columns, frames.stamp, frames.data, frames.length)
            coded = tuple(sentence for column in columns if (sentence := _coded(stream, column, numbers, frames)))
            yield Table(rasters[raster].headings, numbers, len(frames), Places("frame", first), warnings=coded)
            first += len(frames)

    warnings = (*log.warnings, *undated, *scanned.clock, *_scan_warnings(scanned, streams))
    return Source(path, log.format, rasters, tables, (), warnings, metadata, one_clock=True)


def _metadata(log: FrameLog, origin: float, dbc: Sequence[Path]) -> dict[str, str]:
    metadata = {"dbc": ", ".join(file.name for file in dbc)} if dbc else {}
    try:
        start = log.start + timedelta(seconds=origin) if log.start else None
    except OverflowError:
        start = None
    return {"start": start.isoformat(), **metadata} if start else metadata


@dataclass(frozen=True, eq=False, slots=True)
class StreamFrames:
    """Consecutive frames of one stream: stamps as in the log, payload bytes, and number of these in each frame.

    `run` is the number of the run of the log's clock to which all of them belong.
    """

    stamp: FloatArray
    data: Bytes
    length: Bytes
    run: int = 0

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.stamp.size)

    def part(self, rows: slice) -> StreamFrames:
        """Some of the frames."""
        return StreamFrames(self.stamp[rows], self.data[rows], self.length[rows], self.run)


@dataclass(slots=True)
class ScannedLog:
    """Contents of a log, counted in the first pass; `stored` is None if the frames are too many to keep.

    `runs` are those of the clock, `shifts` by how much each is moved in s, `clock` what is said about it; `few` are
    runs with their streams and numbers of frames where these may be lone ones.
    """

    origin: float = 0.0
    frames: int = 0
    runs: list[Run] = field(default_factory=list)
    shifts: Sequence[float] = ()
    clock: Sequence[str] = ()
    few: list[tuple[int, frame_streams.FrameStream, int]] = field(default_factory=list)
    sizes: Counter[frame_streams.FrameStream] = field(default_factory=Counter)
    short: Counter[str] = field(default_factory=Counter)
    unknown: Counter[int] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    fragments: int = 0
    echoes: int = 0
    damage: str = ""
    stored: dict[frame_streams.FrameStream, list[StreamFrames]] | None = field(default_factory=dict)
    bytes: int = 0


def _scan(log: FrameLog, lookup: frame_streams.MessageCatalogue) -> ScannedLog:
    """Contents of a log, by the messages of `lookup`.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in ``ScannedLog.damage``.
    """
    scanned = ScannedLog()
    tolerance = Tolerance.of(math.inf, shared=True)
    for number, cut_by, frames in _in_runs(_stamped(log, scanned)):
        tolerance = cut_by
        run = Run(scanned.frames, len(frames), float(frames.stamp[0]), float(frames.stamp.max()))
        scanned.runs.append(run if number == len(scanned.runs) else scanned.runs.pop().joined(run))
        scanned.frames += len(frames)
        for stream, rows in frame_streams.by_stream(frames, lookup):
            if stream == frame_streams.UNKNOWN:
                _count_unknown(scanned, frames.take(rows))
            elif stream == frame_streams.FRAGMENT:
                scanned.fragments += rows.size
            elif isinstance(stream, frame_streams.FrameStream):
                _count(scanned, stream, _frames_of(stream, frames, rows, number))
    scanned.shifts, changes, _ = shifts_of(scanned.runs, tolerance)
    scanned.clock = tuple(sentences(changes, Places("frame"), tolerance.apart))
    for number, stream, count in scanned.few:
        scanned.sizes[stream] -= count if math.isnan(scanned.shifts[number]) else 0
    scanned.sizes = +scanned.sizes
    used = [run for run, shift in zip(scanned.runs, scanned.shifts, strict=True) if not math.isnan(shift)]
    triggered = bool(used) and used[0].first < 0.0 <= max(run.last for run in used)  # the trigger has the stamp 0
    scanned.origin = used[0].first if used and not triggered else 0.0
    return scanned


def _in_runs(blocks: Iterable[Frames]) -> Iterator[tuple[int, Tolerance, Frames]]:
    """The frames, cut where the clock of the log is cut, with the number of the run; how it is cut comes with them."""
    number, before, tolerance = -1, -math.inf, Tolerance.of(math.inf, shared=True)
    for frames in blocks:
        if not math.isfinite(tolerance.usual):
            tolerance = Tolerance.of(usual_interval(frames.stamp), shared=True)
        begins = cuts(frames.stamp, before, tolerance).tolist()
        for begin, end in pairwise(sorted({0, *begins, len(frames)})):
            number += begin in begins
            yield number, tolerance, frames if end - begin == len(frames) else frames.take(slice(begin, end))
        before = float(frames.stamp[-1]) if len(frames) else before


def _stamped(log: FrameLog, scanned: ScannedLog) -> Iterator[Frames]:
    """The blocks of a log up to where it is damaged, without frames whose stamp is no number; both are noted."""
    echoes: dict[int, bool] = {}
    try:
        for block in log.blocks():
            frames = frame_streams.without_echoes(block, echoes)
            stamped = np.isfinite(frames.stamp)
            scanned.left_out.update(block.left_out)
            scanned.left_out.update({"frame without a stamp": int(stamped.size - stamped.sum())})
            scanned.echoes += len(block) - len(frames)
            yield frames if stamped.all() else frames.take(stamped)
    except DataError as error:
        scanned.damage = str(error)


def _count_unknown(scanned: ScannedLog, frames: Frames) -> None:
    identifiers, counts = np.unique(frame_streams.identifiers(frames), return_counts=True)
    scanned.unknown.update(dict(zip(identifiers.tolist(), counts.tolist(), strict=True)))
    if len(scanned.unknown) > _MOST_UNKNOWN:  # noise: a damaged file can hold any number of them
        scanned.unknown = Counter(dict(scanned.unknown.most_common(_MOST_UNKNOWN // 2)))


def _count(scanned: ScannedLog, stream: frame_streams.FrameStream, frames: StreamFrames) -> None:
    scanned.sizes[stream] += len(frames)
    if len(frames) <= LONE:
        scanned.few.append((frames.run, stream, len(frames)))
    group = stream.group.name
    name = f"{stream.message.name} ({group})" if group else stream.message.name
    scanned.short[name] += int(np.sum(frames.length < min(stream.group.bytes, 255)))
    if scanned.stored is not None:
        scanned.bytes += frames.stamp.nbytes + frames.data.nbytes + frames.length.nbytes
        scanned.stored.setdefault(stream, []).append(frames)
        if scanned.bytes > KEPT_FRAMES:
            scanned.stored = None


def _frames_of(stream: frame_streams.FrameStream, frames: Frames, rows: Rows, run: int) -> StreamFrames:
    data = frames.data[rows, : stream.group.bytes]
    return StreamFrames(frames.stamp[rows], data, frames.length[rows].astype(np.uint8), run)


def _coded(
    stream: frame_streams.FrameStream, column: int, numbers: Mapping[int, FloatArray], frames: StreamFrames
) -> str:
    """Sentence about the frames that say that a signal has no value; empty where none does."""
    if column == 0:
        return ""
    signal = stream.group.signals[column - 1]
    count = int(np.sum(np.isnan(numbers[column]) & (frames.length >= min(signal.bytes, 255))))
    if not count or not signal.none:
        return ""
    verb = "frame says" if count == 1 else "frames say"
    return f"{signal.name}: {count:,} {verb} 'error' or 'not available'; these samples are missing."


def _on_one_clock(parts: Iterator[StreamFrames], scanned: ScannedLog) -> Iterator[StreamFrames]:
    """The frames with stamps in s from the origin, moved as the clock of the log says; without lone stamps."""
    for part in parts:
        shift = scanned.shifts[part.run]
        if not math.isnan(shift):
            yield replace(part, stamp=part.stamp + (shift - scanned.origin))


def _read_again(
    log: FrameLog, lookup: frame_streams.MessageCatalogue, stream: frame_streams.FrameStream
) -> Iterator[StreamFrames]:
    """The frames of one stream, from the file."""
    for number, _, frames in _in_runs(_stamped(log, ScannedLog())):
        for other, rows in frame_streams.by_stream(frames, lookup):
            if other == stream:
                yield _frames_of(stream, frames, rows, number)


def _in_rows(parts: Iterator[StreamFrames], rows: int | None) -> Iterator[StreamFrames]:
    """The same frames in parts of exactly `rows`, but for the last; in one where `rows` is None."""
    waiting: list[StreamFrames] = []
    for part in parts:
        waiting.append(part)
        while rows is not None and sum(map(len, waiting)) >= rows:
            joined = _joined(waiting)
            yield joined.part(slice(rows))
            waiting = [joined.part(slice(rows, None))]
    if any(map(len, waiting)):
        yield _joined(waiting)


def _joined(parts: Sequence[StreamFrames]) -> StreamFrames:
    stamps, lengths = [part.stamp for part in parts], [part.length for part in parts]
    return StreamFrames(np.concatenate(stamps), payloads([part.data for part in parts]), np.concatenate(lengths))


def _other_sender(scanned: ScannedLog, messages: Sequence[Message]) -> str:
    """The commonest frame whose identifier differs from that of a message in its last byte only; empty if none."""
    groups = {group_number(message.identifier) for message in messages if message.extended}
    parts = (frame_streams.identifier_parts(number) for number, _ in scanned.unknown.most_common())
    return next((f"0x{i:08X}" for i, extended in parts if extended and group_number(i) in groups), "")


def _decoding_problem(scanned: ScannedLog, dbc: Sequence[Path], messages: Sequence[Message]) -> str:
    """Reason why a log cannot be decoded, in one sentence; empty where it can."""
    if scanned.frames == 0 and scanned.damage:
        return f"{scanned.damage}; copy it again."
    if scanned.frames == 0:
        others = listed(_counted(count, what) for what, count in scanned.left_out.items() if count)
        return f"holds no data frames of a CAN bus{others and f', only {others}'}; record it again."
    if scanned.sizes:
        return ""
    frames, identifiers = f"{scanned.frames:,}", _counted(len(scanned.unknown), "identifier")
    if not dbc:
        return f"holds raw frames ({frames}) of {identifiers}; give the DBC with --dbc FILE."
    names = ", ".join(file.name for file in dbc)
    if sender := _other_sender(scanned, messages):
        return (
            f"{sender} is not in {names}, which has this message from another sender only; add this identifier to "
            "the DBC."
        )
    count = scanned.fragments
    fragments = f", and {count:,} belong to multi-frame messages, which are not reassembled" if count else ""
    common = f" (the most frequent: {_commonest(scanned.unknown)}{fragments})" if scanned.unknown else ""
    return f"none of its {frames} frames{common} holds a signal of {names}; give the DBC of this bus with --dbc FILE."


def _scan_warnings(scanned: ScannedLog, streams: Sequence[frame_streams.FrameStream]) -> list[str]:
    """Sentences about what was left out of a log."""
    warnings = [f"{scanned.damage}; the {scanned.frames:,} frames before it are used."] if scanned.damage else []
    counts = (
        *((count, what, "left out.") for what, count in scanned.left_out.items()),
        (scanned.echoes, "frame", "in the log twice, as sent and as received; each is used once."),
        (
            scanned.fragments,
            "frame",
            "left out: parts of multi-frame messages (J1939 transport protocol, NMEA 2000 fast packets).",
        ),
        (
            sum(scanned.unknown.values()),
            "frame",
            f"left out, of {_counted(len(scanned.unknown), 'identifier')} that no DBC defines; the most frequent: "
            f"{_commonest(scanned.unknown)}.",
        ),
    )
    warnings += [
        f"{_counted(count, what)} {'is' if count == 1 else 'are'} {rest}" for count, what, rest in counts if count
    ]
    if short := [f"{count:,} of {name}" for name, count in scanned.short.items() if count]:
        warnings.append(
            f"some frames are shorter than the DBC says ({listed(short)}): the signals beyond their end are missing."
        )
    messages: set[Message] = {stream.message for stream in streams}
    if lacking := sorted(f"{name} of {message.name}" for message in messages for name in message.undecodable):
        warnings.append(f"signals that are not numbers of at most 64 bits are left out: {listed(lacking)}.")
    return warnings


def _counted(count: int, what: str) -> str:
    head, blank, tail = what.partition(" without ")
    return f"1 {what}" if count == 1 else f"{count:,} {head}s{blank}{tail}"


def _commonest(unknown: Counter[int]) -> str:
    """The commonest identifiers with their counts."""
    parts = ((frame_streams.identifier_parts(number), count) for number, count in unknown.most_common())
    return listed(f"0x{i:0{8 if extended else 3}X} ({count:,})" for (i, extended), count in parts)
