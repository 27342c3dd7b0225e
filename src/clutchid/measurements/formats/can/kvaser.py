"""Logs of Kvaser as text: those of CanKing, and those that are converted from a Memorator as plain text.

CanKing writes ``0    0CFBFFDB X       8  1B  31  20  EB  B3  FF  D9  FF     100.000139 R``: channel, identifier, flags,
length, bytes, time in s, direction. A Memorator's has the time, the channel, the identifier (an ``x`` behind one of 29
bits), direction and flags, the length, the bytes and a counter. Memorators' CSV is a table of frames.
"""

from __future__ import annotations

import re
from functools import partial
from itertools import islice
from pathlib import Path

from clutchid.measurements.formats.can.frames import FrameLine, FrameLog, first_lines, text_log, whole

_HEAD = re.compile(r"\s*Chn\s+Identifier\s+Flg\s+DLC\b.*\bTime\b", re.IGNORECASE)
_MEMORATOR = re.compile(r"\s*Kvaser Memorator Log\b")

#: Flags are X (29 bits) and R (remote); that a number is decimal is said for a Memorator, and seen in bytes of CanKing.
_CANKING = re.compile(
    r"\s*(?P<bus>\d+)\s+(?P<id>[0-9A-Fa-f]+)(?P<flags>(?:\s+[A-Z])*)\s+(?P<length>\d{1,2})"
    r"(?P<data>(?:\s+[0-9A-Fa-f]{1,3})*)\s+(?P<stamp>\d+\.\d+)\s+(?P<way>[RT])\s*"
)
_CONVERTED = re.compile(
    r"\s*(?P<stamp>-?\d+[.,]\d+)\s+(?P<bus>\d+)\s+(?P<id>[0-9A-Fa-f]+)(?P<extended>x?)\s+(?P<way>TxRq|Tx|Rx)"
    r"\s*(?P<flags>(?:[EFBPRW#]\s*)*)\s(?P<length>\d{1,2})\s(?P<data>(?:\s*[0-9A-Fa-f]{1,3}\s)*)\s*\d+\s*"
)
_LINE = re.compile(r"\s*-?\d")
_IN_DECIMAL = re.compile(r"Format of (?P<what>data|id) field:?\s+DEC")
_NO_PAYLOAD = re.compile(r"\b(?P<error>ErrorFrame|ERROR FRAME)|\bRTR\b|\sR\s+\d{1,2}\s+\d+\.\d+\s+[RT]\s*$")

#: Lines that show how numbers are written.
_SHOWN = 200


def is_kvaser(head: bytes) -> bool:
    """Whether the first lines of a file are those of a text of Kvaser.

    Examples
    --------
    >>> is_kvaser(b"Chn Identifier Flg   DLC  D0...1...2  Time     Dir\\n"), is_kvaser(b"Chn;Identifier;Time\\n")
    (True, False)
    """
    return any(_HEAD.match(line) or _MEMORATOR.match(line) for line in first_lines(head)[:5])


def kvaser_log(path: Path) -> FrameLog:
    """The frames of a text of Kvaser.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open(encoding="latin-1") as file:
        lines = list(islice(file, _SHOWN))
    decimal = {match["what"] for line in lines if (match := _IN_DECIMAL.search(line))}
    if any(
        len(byte) > len("FF") for line in lines if (row := _CANKING.fullmatch(line)) for byte in row["data"].split()
    ):
        decimal = {"data", "id"}
    parse = partial(_parsed, 10 if "id" in decimal else 16, 10 if "data" in decimal else 16)
    return text_log("Kvaser", None, path, parse)


def _parsed(base: int, base_of_bytes: int, line: str) -> FrameLine | None:
    if not _LINE.match(line) or "Trigger" in line:
        return 0.0, ""
    if without := _NO_PAYLOAD.search(line):
        return 0.0, "error frame" if without["error"] else "remote frame"
    match = _CANKING.fullmatch(line) or _CONVERTED.fullmatch(line)
    if match is None:
        return None
    fields = match.groupdict()
    extended = "X" in fields["flags"] or bool(fields.get("extended"))
    payload = whole(bytes(int(byte, base_of_bytes) for byte in fields["data"].split()), int(fields["length"]))
    stamp, sent = float(fields["stamp"].replace(",", ".")), fields["way"].startswith("T")
    return stamp, (int(fields["bus"]) + ("extended" not in fields), int(fields["id"], base), extended, payload, sent)
