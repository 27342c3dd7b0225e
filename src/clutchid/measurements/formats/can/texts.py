"""Frames as lines of text: candump in its forms, and tables with a column for the identifier and for the payload."""

from __future__ import annotations

import base64
import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import lru_cache, partial
from itertools import count, islice
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray
from clutchid.measurements.columns import headings
from clutchid.measurements.formats.can.frames import FrameLine, FrameLog, first_lines, text_log, whole
from clutchid.measurements.formats.csv.cells import nanoseconds, plain_number

_EPOCH = datetime(1970, 1, 1)

#: A line of candump: `-L` writes ``(stamp) can0 123#0102``, the others ``(stamp)  can0  123   [2]  01 02``.
_CANDUMP = re.compile(
    r"\s*(?:\((?P<stamp>[\d.:\- ]{1,40})\)\s+)?(?P<bus>[A-Za-z][\w.-]{0,30})\s+(?:(?P<way>TX|RX)\s[\s\-BE]*)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})"
    r"(?:#(?:#[0-9A-Fa-f])?(?P<data>(?:[0-9A-Fa-f]{2})*)(?P<remote>R\d?)?(?:\s+(?P<sent>[RT]))?"
    r"|\s+\[(?P<length>\d{1,2})\](?:\s+(?P<bytes>[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})*)(?:\s+'.*')?"
    r"|\s+(?P<request>remote request))?)\s*"
)

_NO_STAMPS = (
    "is a log of candump without time stamps; record it with `candump -L`, or with `-ta`, `-tz` or `-td` to read "
    "it as well."
)


def is_candump(head: bytes) -> bool:
    """Whether the first lines of a file are those of candump: two at least, or the only one.

    Examples
    --------
    >>> is_candump(b"(1714564800.0) can0 100#E803\\n(1714564800.1) can0 101#00"), is_candump(b"time [s]\\n0")
    (True, False)
    """
    filled = [line for line in first_lines(head) if line.strip()][:3]
    return bool(filled) and sum(_CANDUMP.fullmatch(line) is not None for line in filled) >= min(2, len(filled))


def candump_log(path: Path) -> FrameLog:
    """The frames of a log of candump.

    Raises
    ------
    DataError
        If it has no time stamps.
    OSError
        If the file cannot be read.
    """
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line.rstrip("\r\n") for line in islice(file, _SHOWN)]
    stamps = [match["stamp"] for line in lines if (match := _CANDUMP.fullmatch(line))]
    if not any(stamps):
        raise DataError(_NO_STAMPS)
    seconds = np.array([_seconds(stamp) for stamp in stamps if stamp])
    steps = np.diff(seconds)
    half = seconds.size // 2
    grown = half > 0 and seconds[half:].mean() - seconds[:half].mean() > _GROWN * np.ptp(seconds)
    between = not grown and half > 0 and np.count_nonzero(steps > 0) < _ON * steps.size and seconds[0] < _YEAR
    zero, start = _origin(float(seconds[0]))
    buses = defaultdict[str, int](count(1).__next__)
    return text_log("candump", start, path, partial(_candump_line, buses, zero), between=bool(between))


def _origin(first: float) -> tuple[int, datetime | None]:
    """Whole seconds that stamps count from, so that these keep microseconds; and that time, where it is known.

    A smaller number than that of 2001 counts from elsewhere, as from 2007 in Vehicle Spy.
    """
    if not first > _YEAR:
        return 0, None
    if first < _SINCE_2001:
        return int(first), None
    try:
        return int(first), _EPOCH + timedelta(seconds=int(first))
    except OverflowError:
        return int(first), None


#: Lines that show what stamps are: those since the line before do not grow over the lines, by this share of their
#: range, nor from line to line, in this share; those since 1970 are above this.
_SHOWN, _GROWN, _ON, _YEAR = 2000, 0.1, 0.9, 3e7
_SINCE_2001 = 1e9


def _candump_line(buses: Mapping[str, int], zero: int, line: str) -> FrameLine | None:
    match = _CANDUMP.fullmatch(line)
    if match is None or match["stamp"] is None:
        return None
    stamp, bus, way, identifier, data, remote, sent, length, spaced, request = match.groups()
    if remote or request:
        return _seconds(stamp, zero), "remote frame"
    payload = whole(bytes.fromhex(data or spaced or ""), int(length or 0))
    fields = buses[bus], int(identifier, 16), len(identifier) == 8, payload, way == "TX" or sent == "T"
    return _seconds(stamp, zero), fields


def _seconds(text: str, zero: int = 0) -> float:
    """A stamp in s from `zero`: a number, or date and time; NaN for any other text."""
    whole, _, fraction = text.replace(",", ".").partition(".")
    if whole.isdigit() and fraction.isdigit():
        return int(whole) - zero + float(f"0.{fraction}")
    number = plain_number(text)
    if number is not None:
        return number - zero
    whole, _, fraction = text.rpartition(".")
    stamp = _whole_second(whole) if fraction.isdigit() and len(fraction) <= 9 else None
    if stamp is not None and stamp % 10**9 == 0:
        return stamp // 10**9 - zero + float(f"0.{fraction}")
    if match := _DAYS.fullmatch(text):
        day, hour, minute, second, millisecond = map(int, match.groups())
        return 86400 * day + 3600 * hour + 60 * minute + second - zero + millisecond * 1e-3
    stamp = nanoseconds(text)
    return math.nan if stamp is None else stamp // 10**9 - zero + stamp % 10**9 * 1e-9


#: Day of the month and time of day to the millisecond, as a logger of CSS Electronics writes them.
_DAYS = re.compile(r"(\d\d)T(\d\d):?(\d\d):?(\d\d)[.:]?(\d{3})")

#: Nanoseconds of a date and time to the second, which all frames of a second share.
_whole_second = lru_cache(maxsize=128)(nanoseconds)


#: Columns of a table of frames by their names, in lower case without blanks and underscores.
_COLUMNS: Mapping[str, frozenset[str]] = {
    "stamp": frozenset(
        {"timestamp", "time", "timestampepoch", "timestamps", "abstime", "reltime", "timeoffset", "t", "zeit"}
    ),
    "id": frozenset(
        {"id", "canid", "arbitrationid", "arbid", "identifier", "idhex", "messageid", "msgid", "frameid", "canidhex"}
        | {"addr", "address"}
    ),
    "data": frozenset({"data", "databytes", "payload", "datahex", "bytes", "databyteshex"}),
    "extended": frozenset({"extended", "ide", "isextended", "isextendedid", "ext", "idtype", "xtd"}),
    "kind": frozenset({"format", "type"}),
    "bus": frozenset({"bus", "buschannel", "channel", "interface", "chn", "network"}),
    "length": frozenset({"len", "dlc", "length", "datalength"}),
    "way": frozenset({"dir", "direction", "rxtx", "txrx", "isrx", "tx"}),
    "remote": frozenset({"remote", "rtr", "remote/edlbrsesi"}),
    "error": frozenset({"error", "iserror", "er"}),
}
_BYTE = re.compile(r"(?:d|b|data|byte|databyte)\[?(\d{1,2})\]?")
_OTHERS = frozenset({"", "flags"})  # which say nothing here
_SEPARATORS = (",", ";", "\t")
_TRUE = frozenset({"true", "t", "1", "yes", "x", "ext", "extended"})

#: Words of a column `kind` for 29 bits; other numbers there mean something else in every tool.
_EXTENDED = frozenset({"x", "ext", "extended", "xtd", "29", "29bit", "29-bit"})

#: Says in what the numbers below are written, in a line above the names.
_FORMAT = re.compile(r"Format of (?P<what>data|id) field\W+(?P<base>HEX|DEC)")
_BASES = {"HEX": 16, "DEC": 10}


@dataclass(frozen=True, slots=True)
class _FrameTable:
    """Layout of a table of frames: separator, columns by their meaning, and those of single bytes in their order.

    `unit` is that of the stamps, `base` that of single bytes, `base_of_id` that of identifiers (0: not known); `header`
    counts the filled lines up to that of the names, and `stamp` is what the stamps are called there.
    """

    separator: str
    columns: Mapping[str, int]
    bytes: tuple[int, ...]
    unit: str
    base: int = 16
    base_of_id: int = 0
    header: int = 1
    stamp: str = ""


def frame_table(lines: Sequence[str]) -> _FrameTable | None:
    """Layout of a table of raw frames, by the words of a line at its start; None where it is none.

    It has a time, an identifier and a payload, and besides at least one of what only frames have.
    """
    bases: dict[str, int] = {}
    for number, line in enumerate(filter(str.strip, lines), start=1):
        if match := _FORMAT.match(line):
            bases[match["what"]] = _BASES[match["base"]]
        if _NAMES.search(line) and (layout := _layout(line)):
            return replace(layout, header=number, base=bases.get("data", 16), base_of_id=bases.get("id", 0))
    return None


#: What one of the names of an identifier has in it, so that other lines are not cut into cells.
_NAMES = re.compile(r"id|addr", re.IGNORECASE)


def _layout(header: str) -> _FrameTable | None:
    for separator in _SEPARATORS:
        cells = headings(header.lstrip("\ufeff").split(separator))
        names = [re.sub(r"[\s_.\-]|\[.*|\(.*", "", cell.text).casefold() if cell.text else "" for cell in cells]
        indexed = [re.sub(r"[\s_.\-]", "", cell.text).casefold() for cell in cells]
        columns = {
            what: i for what, words in _COLUMNS.items() for i, name in reversed(list(enumerate(names))) if name in words
        }
        numbered = sorted((int(match[1]), i) for i, name in enumerate(indexed) if (match := _BYTE.fullmatch(name)))
        payload = "data" in columns or len(numbered) >= 1
        used = {*columns.values(), *(i for _, i in numbered)}
        others = any(i not in used and name not in _OTHERS for i, name in enumerate(names))
        evidence = columns.keys() - {"kind"} if others else columns.keys()  # a table of channels may have a type
        if {"stamp", "id"} <= evidence and payload and len(evidence) >= 4 - (len(numbered) > 1):
            stamp = cells[columns["stamp"]]
            return _FrameTable(separator, columns, tuple(i for _, i in numbered), stamp.unit or "", stamp=stamp.text)
    return None


def is_frame_table(head: bytes) -> bool:
    """Whether a file begins with the header of a table of frames."""
    lower = head.lower()
    return any(name in lower for name in (b"id", b"addr")) and frame_table(first_lines(head)) is not None


def frame_table_log(path: Path) -> FrameLog:
    """The frames of a table.

    Raises
    ------
    DataError
        If it is no such table.
    OSError
        If the file cannot be read.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = list(islice(file, _SHOWN))
    layout = frame_table(lines)
    if layout is None:
        raise DataError("is no table of frames; a time, an identifier and a payload are needed in its header.")
    filled = [line for line in lines if line.strip()][layout.header :]
    rows = [cells for line in filled if len(cells := line.split(layout.separator)) > max(layout.columns.values())]
    texts = [cells[layout.columns["stamp"]].strip() for cells in rows]
    stamps = np.array(list(map(_seconds, texts)))
    scale = _scale(stamps, layout.unit, whole=all(text.isdigit() for text in texts))
    single = [cells[i].strip() for cells in rows for i in layout.bytes if i < len(cells)]
    if any(len(cell) > len("FF") for cell in single) and all(cell.isdigit() for cell in single if cell):
        layout = replace(layout, base=10)
    ids = [cells[layout.columns["id"]] for cells in rows]
    identifier = layout.base_of_id or (layout.base if layout.base == 10 else _base(ids))
    zero, start = _origin(next((float(stamp) * scale for stamp in stamps if math.isfinite(stamp)), 0.0))
    parse = partial(_table_line, layout, dict[str, int](), scale, round(zero / scale), identifier)
    return text_log("CSV of frames", start, path, parse, header=layout.header)


_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def _scale(stamps: FloatArray, unit: str, *, whole: bool) -> float:
    """Unit of the stamps in s, which whole numbers without one show by their steps: frames come every 10 us to 1 s."""
    if unit in _UNITS:
        return _UNITS[unit]
    steps = np.diff(stamps[np.isfinite(stamps)])
    steps = steps[steps > 0]
    usual = float(np.median(steps)) if steps.size else 0.0
    return 1.0 if not whole else 1e-9 if usual >= 2e4 else 1e-6 if usual >= 20.0 else 1e-3


def _base(cells: Sequence[str]) -> int:
    """10 where identifiers are decimal: none has a letter, and those of a bus would be too long otherwise; else 16."""
    plain = [cell.strip().removesuffix("h") for cell in cells]
    return 16 if any(not cell.isdigit() or len(cell) in (3, 8) for cell in plain) else 10


def _table_line(layout: _FrameTable, buses: dict[str, int], scale: float, zero: int, base: int, line: str) -> FrameLine:
    columns = layout.columns
    cells = [cell.strip().strip('"') for cell in line.split(layout.separator)]
    if cells[columns["stamp"]] == layout.stamp:  # names of frames of another bus
        return 0.0, ""
    for what in ("remote", "error"):
        if _is_true(cells, columns.get(what)) or (what == "error" and not cells[columns["id"]]):
            return 0.0, f"{what} frame"
    identifier = int(cells[columns["id"]].removesuffix("h"), base)
    extended = (
        identifier > 0x7FF
        or _is_true(cells, columns.get("extended"))
        or ("kind" in columns and cells[columns["kind"]].casefold() in _EXTENDED)
    )
    bus = cells[columns["bus"]] if "bus" in columns else ""
    sent = "way" in columns and cells[columns["way"]].casefold() in ("tx", "t", "1")
    stamp, payload = _seconds(cells[columns["stamp"]], zero) * scale, _payload(cells, layout, ends=line.endswith("\n"))
    number = buses.setdefault(bus, int(bus) + 1 if bus.isdigit() else len(buses) + 1)
    return stamp, (number, identifier, extended, payload, sent)


def _is_true(cells: Sequence[str], index: int | None) -> bool:
    return index is not None and cells[index].casefold() in _TRUE


def _payload(cells: Sequence[str], layout: _FrameTable, *, ends: bool) -> bytes:
    """The payload of a line: single bytes, or one text, hexadecimal or as python-can writes it (base 64).

    A line that `ends` may do so early, as that of a short frame; the last one of a file may be cut off.
    """
    length = cells[layout.columns["length"]] if "length" in layout.columns else ""
    if layout.bytes and not length and not ends and len(cells) <= layout.bytes[-1]:
        raise ValueError("the line was cut off")
    if layout.bytes:
        payload = bytes(int(cells[i], layout.base) for i in layout.bytes if i < len(cells) and cells[i])
    elif re.fullmatch(r"(?:0x)?(?:[0-9A-Fa-f]{2}[ .:\-]?)*", text := cells[layout.columns["data"]]):
        payload = bytes.fromhex(re.sub(r"[ .:\-]|^0x", "", text))
    else:
        payload = base64.b64decode(text, validate=True)
    return whole(payload, int(length or 0))[: int(length) if length else None]
