"""Output of the commands to standard output and standard error, wrapped at words on a terminal."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from contextlib import suppress
from shutil import get_terminal_size
from textwrap import fill
from typing import TYPE_CHECKING, TextIO

from clutchid.documents.terminal import lines_of
from clutchid.names import printable
from clutchid.systems import is_closed_pipe

if TYPE_CHECKING:
    from clutchid.documents.document import LabelRow

#: Most columns of a terminal that are used.
TERMINAL_WIDTH = 80

#: How a mood is coloured.
_COLOURS = {"good": "bold green", "with care": "bold yellow", "none": "bold red", "": ""}


class OutputLost(OSError):
    """Standard output cannot be written: its reader has gone, or the disk is full."""


def put(*lines: str, to: TextIO | None = None) -> None:
    """Print lines at once, on standard output by default; failures on other streams are ignored.

    Raises
    ------
    OutputLost
        If standard output cannot be written.
    """
    stream = sys.stdout if to is None else to
    try:
        print(*lines, sep="\n", file=stream, flush=True)
    except UnicodeError:
        raise
    except (OSError, ValueError) as error:  # a stream that is closed is a ValueError
        if stream is not sys.stdout:
            return
        discard_output()
        if isinstance(error, ValueError):
            raise OutputLost("it is closed") from error
        raise OutputLost(*error.args) from error


def say(warnings: Iterable[str]) -> None:
    """Print warnings on standard error; a closed terminal is no error."""
    for warning in warnings:
        put(f"warning: {printable_lines(warning)}", to=sys.stderr)


def discard_output() -> None:
    """Redirect standard output to the null device, so that Python does not write the rest again at exit."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


def lost(error: OSError) -> None:
    """Report that standard output cannot be written; a closed pipe is normal, as in ``clutchid look F | head``."""
    discard_output()
    if not is_closed_pipe(error):
        put(f"clutchid: standard output cannot be written ({error.strerror or error}).", to=sys.stderr)


def text_width() -> int:
    """Columns to use on a terminal."""
    return max(20, min(TERMINAL_WIDTH, get_terminal_size((TERMINAL_WIDTH, 24)).columns))


def printable_lines(text: str) -> str:
    """Text of several lines without control characters."""
    return "\n".join(map(printable, text.splitlines()))


def wrapped_sentences(text: str, stream: TextIO) -> str:
    """Sentences and lists of them for `stream`, wrapped at words if it is a terminal; tables keep their lines."""
    if not stream.isatty():
        return text
    return "\n".join(_wrapped(line) for line in text.splitlines())


def _wrapped(line: str) -> str:
    bullet = re.match(r" *- ", line)
    if line.startswith(" ") and not bullet:
        return line
    indent = " " * (bullet.end() if bullet else 0)
    return fill(line, text_width(), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False) or line


def print_rows(rows: Iterable[LabelRow], to: TextIO | None = None) -> None:
    """Rows with labels, wrapped at words, on standard output by default; coloured on a terminal."""
    from rich.console import Console
    from rich.text import Text

    console = Console(file=sys.stdout if to is None else to, highlight=False, markup=False, emoji=False, soft_wrap=True)
    with console.capture() as drawn:
        for line in lines_of(rows, min(TERMINAL_WIDTH, console.width) if console.is_terminal else TERMINAL_WIDTH):
            console.print(Text(line.label, style="bold").append(line.text, style=_COLOURS[line.mood] or "not bold"))
    if drawn.get():
        put(drawn.get().removesuffix("\n"), to=to)
