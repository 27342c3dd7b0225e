"""ASC, Vector's log as text: raw frames through python-can."""

from __future__ import annotations

import math
import re
from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from clutchid.errors import MissingExtra
from clutchid.io.formats.can.frames import FrameLog, Frames, in_blocks, quiet

if TYPE_CHECKING:
    import can

_LONGEST_LINE = 1 << 16
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

#: A line that ends the header for python-can, so that it goes on with the next line.
_GO_ON = "internal events logged\n"

_NOT_READ = "unreadable line"


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
    try:
        import can  # noqa: F401
    except ImportError as error:
        raise MissingExtra("reading ASC needs python-can; install it with pip install 'clutchid[can]'.") from error
    start = _start(path)
    lost = "does not say when it was recorded: its stamps count from its first frame only."
    return FrameLog("ASC", start, lambda: _blocks(path), () if start else (lost,))


def _start(path: Path) -> datetime | None:
    """Clock time of stamp 0: that of the first block of frames, else that of the header."""
    start = None
    with path.open("rb") as file:
        for _ in range(_HEAD_LINES):
            line = file.readline(_LONGEST_LINE).removeprefix(BOM_UTF8).decode("utf-8", errors="replace")
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
        yield from in_blocks(_messages(reader, lines, left_out), left_out)


def _messages(reader: can.ASCReader, lines: _Lines, left_out: Counter[str]) -> Iterator[can.Message]:
    """The frames; a line that python-can takes for a frame and cannot read is counted and passed over."""
    while True:
        try:
            for message in reader:
                if math.isfinite(message.timestamp):
                    yield message
                else:
                    left_out[_NOT_READ] += 1
        except (ValueError, LookupError, OverflowError, TypeError):
            left_out[_NOT_READ] += 1
            lines.again = _GO_ON
        else:
            return


class _Lines:
    """The lines of an ASC file as python-can reads them, none too long, each with its stamp from the start."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._relative = False
        self._stamp = 0.0
        self.again = ""
        self.number = 0

    def __iter__(self) -> _Lines:
        return self

    def __next__(self) -> str:
        if self.again:
            line, self.again = self.again, ""
            return line
        raw = self._file.readline(_LONGEST_LINE)
        if not raw:
            raise StopIteration
        self.number += 1
        line = raw.decode("utf-8", errors="replace")
        if base := _BASE.match(line):
            self._relative = (base["kind"] or "").casefold() == "relative"
        return self._from_start(line) if self._relative else line

    def _from_start(self, line: str) -> str:
        """A line whose stamp counts from the line before it, with a stamp that counts from the start."""
        if (match := _STAMPED.match(line)) is None:
            return line
        self._stamp += float(match["stamp"])
        return f"{self._stamp:.9f}{match['rest']}"

    def close(self) -> None:
        """Nothing: who opened the file closes it."""
