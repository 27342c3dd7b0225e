"""ASC, Vector's log as text: raw frames through python-can."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from clutchid.recordings.formats.can.frames import FrameLog, Frames, check_python_can, in_blocks, quiet
from clutchid.recordings.formats.can.text_lines import LONGEST_LINE, TextLines, readable, text_log

_HEAD_LINES = 200
_BASE = re.compile(r"\s*base\s+(?:hex|dec)(?:\s+timestamps\s+(?P<kind>absolute|relative))?", re.IGNORECASE)
_BEGIN = re.compile(r"\s*begin\s+triggerblock\b", re.IGNORECASE)
_DATE = re.compile(
    r"\s*(?:date|begin\s+triggerblock)\s+\w+\.?\s+(?P<month>[^\W\d]+)\.?\s+(?P<day>\d{1,2})\s+(?P<hour>\d{1,2}):(?P<minute>\d\d):"
    r"(?P<second>\d\d)(?P<fraction>\.\d+)?(?:\s+(?P<half>am|pm))?\s+(?P<year>\d{4})\s*$",
    re.IGNORECASE,
)
_STAMPED = re.compile(r"\s*(?P<stamp>\d{1,15}\.\d{1,15})(?P<rest>\s.*)", re.DOTALL)
_ENGLISH = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTHS = {
    **{name: number for number, name in enumerate(_ENGLISH, 1)},
    **{"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12},
}

#: Lines of the header, and the one that ends it for python-can.
_HEADER = re.compile(r"\s*(?:date\s|base\s|//|$)", re.IGNORECASE)
_END_OF_HEADER = "internal events logged\n"


def is_asc(head: bytes) -> bool:
    """Whether a file that begins with `head` is an ASC log.

    Examples
    --------
    >>> is_asc(b"date Wed Sep 30 15:06:13.191 2017\\nbase hex\\n"), is_asc(b"time [s],position [m]")
    (True, False)
    """
    lines = [
        line
        for line in head.removeprefix(BOM_UTF8).decode("latin-1").splitlines()
        if line.strip() and not line.startswith("//")
    ]
    return any(
        re.match(r"\s*date\s+\w", line, re.IGNORECASE) or _BASE.match(line) or _BEGIN.match(line) for line in lines[:2]
    )


def frame_log(path: Path) -> FrameLog:
    """The frames of an ASC file.

    Raises
    ------
    MissingExtra
        If python-can is not installed.
    OSError
        If the file cannot be read.
    """
    check_python_can("ASC")
    return text_log("ASC", _start(path), lambda: _blocks(path))


def _start(path: Path) -> datetime | None:
    """Clock time of stamp 0: that of the first block of frames, else that of the header."""
    start = None
    with path.open("rb") as file:
        for _ in range(_HEAD_LINES):
            line = file.readline(LONGEST_LINE).removeprefix(BOM_UTF8).decode("utf-8", errors="replace")
            start = _date(line) or start
            if _BEGIN.match(line) or not line:
                break
    return start


def _date(line: str) -> datetime | None:
    match = _DATE.match(line)
    if match is None or (month := _MONTHS.get(match["month"][:3].casefold())) is None:
        return None
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + (12 if match["half"].casefold() == "pm" else 0)
    fraction = round(float(match["fraction"] or "0") * 1e6)
    try:
        return datetime(
            int(match["year"]),
            month,
            int(match["day"]),
            hour,
            int(match["minute"]),
            int(match["second"]),
            min(fraction, 999_999),
        )
    except ValueError:
        return None


def _blocks(path: Path) -> Iterator[Frames]:
    from can.io.asc import ASCReader

    left_out: Counter[str] = Counter()
    with path.open("rb") as file, quiet("can.io.asc"):
        lines = _Lines(file)
        reader = ASCReader(lines, relative_timestamp=True)  # type: ignore[arg-type]
        yield from in_blocks(readable(reader, lines, left_out), left_out)


class _Lines(TextLines):
    """The lines of an ASC file as python-can reads them, each with its stamp from the start.

    python-can takes the first line behind the header for the line "internal events logged", which may be missing: it
    is put in where the header ends.
    """

    def __init__(self, file: BinaryIO) -> None:
        super().__init__(file)
        self._relative = False
        self._stamp = 0.0
        self._first = ""

    def __next__(self) -> str:
        """The next line.

        Raises
        ------
        StopIteration
            At the end of the file.
        """
        line, self._first = self._first or super().__next__(), ""
        if base := _BASE.match(line):
            self._relative = (base["kind"] or "").casefold() == "relative"
        if self.in_header and not _HEADER.match(line):
            self.in_header, self._first = False, line
            return _END_OF_HEADER
        return self._from_start(line) if self._relative else line

    def _from_start(self, line: str) -> str:
        """A line whose stamp counts from the line before it, with a stamp that counts from the start."""
        if (match := _STAMPED.match(line)) is None:
            return line
        self._stamp += float(match["stamp"])
        return f"{self._stamp:.9f}{match['rest']}"
