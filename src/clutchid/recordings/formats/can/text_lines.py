"""Lines of a log that is a text, and the frames that python-can makes of them, ASC and TRC alike."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from typing import TYPE_CHECKING, BinaryIO

from clutchid.recordings.formats.can.frames import FrameLog, Frames

if TYPE_CHECKING:
    import can

#: Bytes of a line; a longer one is read in parts.
LONGEST_LINE = 1 << 16

_NOT_READ = "unreadable line"


class TextLines:
    """The lines of a log as python-can reads them; `in_header` from where it begins, or goes on behind a bad line."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.number = 0
        self.in_header = True

    def __iter__(self) -> TextLines:
        return self

    def __next__(self) -> str:
        """The next line.

        Raises
        ------
        StopIteration
            At the end of the file.
        """
        raw = self._file.readline(LONGEST_LINE)
        if not raw:
            raise StopIteration
        self.number += 1
        return raw.decode("utf-8", errors="replace")

    def close(self) -> None:
        """Nothing: who opened the file closes it."""


def text_log(form: str, start: datetime | None, blocks: Callable[[], Iterator[Frames]]) -> FrameLog:
    """The log of a text of the format `form`, with a warning where it does not say when it was recorded."""
    lost = "does not say when it was recorded: its stamps count from its first frame only."
    return FrameLog(form, start, blocks, () if start else (lost,))


def readable(reader: Iterable[can.Message], lines: TextLines, left_out: Counter[str]) -> Iterator[can.Message]:
    """The frames; a line that python-can takes for a frame and cannot read is counted in `left_out` and passed over."""
    number = -1
    while lines.number > number:
        number = lines.number
        try:
            for message in reader:
                if math.isfinite(message.timestamp):
                    yield message
                else:
                    left_out[_NOT_READ] += 1
        except (ValueError, LookupError, OverflowError, TypeError):
            left_out[_NOT_READ] += 1
            lines.in_header = True
        else:
            return
