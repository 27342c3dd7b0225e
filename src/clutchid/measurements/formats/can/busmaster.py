"""Logs of BUSMASTER: text, a line a frame, below a header that says how numbers and times are written.

``11:49:12:9420 Rx 1 0x460 s 8 03 E0 00 00 C0 00 00 00``: the time to tenths of a millisecond, direction, channel,
identifier, type (standard or extended, ``r`` for remote), length and bytes. Numbers are hexadecimal or decimal; times
are those of the day (``SYSTEM MODE``), since the start (``ABSOLUTE MODE``) or the line before (``RELATIVE MODE``).
"""

from __future__ import annotations

import re
from datetime import datetime
from functools import partial
from itertools import takewhile
from pathlib import Path

from clutchid.errors import DataError
from clutchid.measurements.formats.can.frames import FrameLine, FrameLog, first_lines, text_log, whole

_LINE = re.compile(
    r"(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+):(?P<fraction>\d{1,9})\s+(?P<way>Tx|Rx)\s+(?P<bus>\d{1,9})\s+"
    r"(?:0x)?(?P<id>[0-9A-Fa-f]{1,10})\s+(?P<type>[sx])(?P<remote>r?)\s+(?P<length>\d+)(?P<data>(?:\s+[0-9A-Fa-f]{1,3})*)\s*",
    re.IGNORECASE,
)
_STARTED = re.compile(r"\*{3}START DATE AND TIME (\d+:\d+:\d+ \d+:\d+:\d+)")
_PROTOCOL = re.compile(r"\*{3}PROTOCOL (?P<name>[\w ]+)\*{3}")


def is_busmaster(head: bytes) -> bool:
    """Whether the first lines of a file are those of BUSMASTER: its name, and a protocol.

    Examples
    --------
    >>> is_busmaster(b"***BUSMASTER Ver 3.2.2***\\n***PROTOCOL CAN***\\n"), is_busmaster(b"***BUSMASTER***\\ntime [s]")
    (True, False)
    """
    lines = first_lines(head)[:3]
    return bool(lines) and lines[0].startswith("***BUSMASTER") and any(map(_PROTOCOL.match, lines))


def busmaster_log(path: Path) -> FrameLog:
    """The frames of a log of BUSMASTER.

    Raises
    ------
    DataError
        If it is one of another bus than CAN.
    OSError
        If the file cannot be read.
    """
    with path.open(encoding="latin-1") as file:
        header = "".join(takewhile(lambda line: line.startswith("***") or not line.strip(), file)).upper()
    protocol = _PROTOCOL.search(header)
    if protocol and protocol["name"] != "CAN":
        raise DataError(f"is a log of {protocol['name']}; record the frames of the CAN bus in BUSMASTER.")
    base, between = 10 if "***DEC***" in header else 16, "***RELATIVE MODE***" in header
    start = _start(header)
    if start and not between and "***ABSOLUTE MODE***" not in header:
        start = start.replace(hour=0, minute=0, second=0)
    return text_log("BUSMASTER", start, path, partial(_parsed, base), between=between)


def _start(header: str) -> datetime | None:
    """Day, month, year, and time of the first session."""
    started = _STARTED.search(header)
    try:
        return datetime.strptime(started[1], "%d:%m:%Y %H:%M:%S") if started else None
    except ValueError:
        return None


def _parsed(base: int, line: str) -> FrameLine | None:
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    seconds = 3600 * int(match["hour"]) + 60 * int(match["minute"]) + int(match["second"])
    stamp = seconds + int(match["fraction"]) / 10.0 ** len(match["fraction"])
    if match["remote"]:
        return stamp, "remote frame"
    payload = whole(bytes(int(byte, base) for byte in match["data"].split()), int(match["length"]))
    extended, sent = match["type"].lower() == "x", match["way"].lower() == "tx"
    return stamp, (int(match["bus"]), int(match["id"], base), extended, payload, sent)
