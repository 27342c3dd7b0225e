"""Text on a terminal: wrapped at words; files and pipes get it as it is."""

from __future__ import annotations

import re
from shutil import get_terminal_size
from textwrap import fill
from typing import TextIO

from clutchid.names import printable

#: Most columns of a terminal that are used.
WIDTH = 80


def columns() -> int:
    """Columns to use on a terminal."""
    return max(20, min(WIDTH, get_terminal_size((WIDTH, 24)).columns))


def printable_lines(text: str) -> str:
    """Text of several lines without control characters."""
    return "\n".join(map(printable, text.splitlines()))


def sentences(text: str, stream: TextIO) -> str:
    """Sentences and lists of them for `stream`, wrapped at words if it is a terminal; tables keep their lines."""
    if not stream.isatty():
        return text
    return "\n".join(_wrapped(line) for line in text.splitlines())


def _wrapped(line: str) -> str:
    bullet = re.match(r" *- ", line)
    if line.startswith(" ") and not bullet:
        return line
    indent = " " * (bullet.end() if bullet else 0)
    return fill(line, columns(), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or line
