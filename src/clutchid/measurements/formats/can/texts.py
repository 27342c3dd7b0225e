"""Logs of candump in its forms, a line a frame."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Mapping
from datetime import datetime, timedelta
from functools import lru_cache, partial
from itertools import count, islice
from pathlib import Path

import numpy as np

from clutchid.errors import DataError
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
    """Whole seconds that stamps count from, so that these keep microseconds; and that time, if it is after 2001."""
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
    stamp = nanoseconds(text)
    return math.nan if stamp is None else stamp // 10**9 - zero + stamp % 10**9 * 1e-9


#: Nanoseconds of a date and time to the second, which all frames of a second share.
_whole_second = lru_cache(maxsize=128)(nanoseconds)
