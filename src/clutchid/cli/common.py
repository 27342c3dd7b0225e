"""Shared by all commands: exit codes, errors as one sentence, progress, and parsing of options."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TextIO

from cyclopts import Group, Parameter

from clutchid.documents.console import OutputLost, print_rows, printable_lines, put, say, wrapped_sentences
from clutchid.documents.json_text import json_text
from clutchid.names import printable
from clutchid.verbs.failures import failure
from clutchid.verbs.options import ReadingText, RequestText

if TYPE_CHECKING:
    from clutchid.documents import Document

P = ParamSpec("P")

#: Groups of options in the help of every command, in this order.
COMMON = Group("Common options", sort_key=1)
SEARCH = Parameter(group=Group("Method and search", sort_key=2))
FLEET = Parameter(group=Group("Fleet and workers", sort_key=3))
FILES = Parameter(group=Group("Files", sort_key=4))
OUTPUT = Parameter(group=Group("Output", sort_key=5))

#: Options of several commands: how recordings are read, and what is printed and written.
Flag = Annotated[bool, Parameter(negative="", show_default=False)]
_OF_A_RECORD = Parameter(name="*", consume_multiple=True, negative="")
SearchOptions = Annotated[RequestText, _OF_A_RECORD, SEARCH]
FileOptions = Annotated[ReadingText, _OF_A_RECORD, FILES]
ForceFlag = Annotated[Flag, FILES]
OutOption = Annotated[Path, OUTPUT]
PathOutput = Annotated[Path | None, OUTPUT]
OutputFlag = Annotated[Flag, OUTPUT]

#: Exit codes; the last one, of Ctrl-C and SIGTERM, is that of shells.
DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

#: Files that an interrupted command leaves, and how to go on, by its name; others write their files at the end.
_KEPT = {
    "fleet": "the results so far are kept in {out}; run the same command again to continue.",
    "drive --fleet": "{out} has only a part of the fleet, and no tables; delete it and run the same command again.",
}
_STARTS_AGAIN = "no incomplete file was left behind; run the same command again to start from the beginning."


def guarded(command: Callable[P, int]) -> Callable[P, int]:
    """The command, whose errors are one sentence, or with its option `json` an object, and an exit code.

    The exit code is 2 for bad input, 130 where it was interrupted, and 1 for other errors. With its option `debug` the
    traceback goes to standard error first. That standard output is lost is handled by `main`.
    """

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> int:
        shared = kwargs.get("options")
        as_json, debug = (bool(kwargs.get(name, getattr(shared, name, False))) for name in ("json", "debug"))
        try:
            return command(*args, **kwargs)
        except OutputLost:
            raise
        except KeyboardInterrupt:
            if debug:
                traceback.print_exc()
            complain(stopped(command.__name__, kwargs), as_json=as_json, status="failed")
            return INTERRUPTED
        except Exception as error:
            if debug:
                traceback.print_exc()
            message, status = failure(error, debug=debug)
            return complain(message, as_json=as_json, status=status)

    return run


def stopped(command: str, options: Mapping[str, Any]) -> str:
    """Message of an interrupted command: the files that are kept, and how to continue.

    Examples
    --------
    >>> stopped("fleet", {"out": Path("result")})
    'stopped: the results so far are kept in result; run the same command again to continue.'
    """
    of_fleet = command == "drive" and bool(getattr(options.get("service"), "fleet", False))
    words = _KEPT.get("drive --fleet" if of_fleet else command, _STARTS_AGAIN)
    return f"stopped: {words.format(out=options.get('out'))}"


def complain(message: str, *, as_json: bool, status: str) -> int:
    """Print the error `message` and return the exit code."""
    if as_json:
        print_json({"status": status, "message": message})
    else:
        put(wrapped_sentences(f"clutchid: {printable_lines(message)}", sys.stderr), to=sys.stderr)
    return BAD_INPUT if status == "bad_input" else FAILED


#: Keys of every JSON object.
_EMPTY: dict[str, Any] = {
    "status": "failed",
    "message": "",
    "parameters": {},
    "load_curve": None,
    "errors": None,
    "logs": {},
    "warnings": [],
}


def print_written(*paths: Path | None, to: TextIO | None = None) -> None:
    """Print the paths of written files, on standard output by default."""
    for path in paths:
        if path is not None:
            put(f"written: {printable(str(path.resolve()))}", to=to)


def print_json(content: Mapping[str, Any]) -> None:
    """Print `content` as one JSON object with the keys of all; numbers that are not finite become null."""
    put(json_text({**_EMPTY, **content}))


def print_document(document: Document, *, json: bool) -> None:
    """Print a result: as JSON, or its warnings on standard error and its rows."""
    if json:
        print_json(document.data())
        return
    say(notice.text for notice in document.notices)
    print_rows(document.rows)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A progress bar on standard error, or nothing if that is not a terminal; call it with a text and a fraction.

    A negative fraction means that the end is unknown.
    """
    if not sys.stderr.isatty():
        yield lambda _text, _fraction: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()  # the words say the time left
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield lambda text, fraction: bar.update(
            task, description=f"{title}: {text}", total=1.0 if fraction >= 0 else None, completed=max(fraction, 0.0)
        )


#: Units of a rate by their length in s, and of a time that is left.
_RATES = ((1.0, "a second"), (60.0, "a minute"), (3600.0, "an hour"))
_SPANS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


@contextmanager
def progress_of(title: str, clock: Callable[[], float] = monotonic) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error where that is a terminal: call it with recordings done and all.

    Parameters
    ----------
    clock : s
        Time from any origin.
    """
    begin = clock()
    with progress_bar(title) as show:
        yield lambda count, total: show(progress_words(count, total, clock() - begin), count / total)


def progress_words(count: int, total: int, seconds: float) -> str:
    """Recordings done of all, at least one, their rate so far, and the time left at that rate.

    Examples
    --------
    >>> progress_words(30, 1200, 60.0)
    '30 of 1,200 recordings, 30 a minute, 39 min left'
    """
    rate = count / max(seconds, 1e-3)
    return f"{count:,} of {total:,} recordings, {_rate(rate)}, {_span((total - count) / rate)} left"


def _rate(rate: float) -> str:
    """A rate in 1/s with two digits, in the smallest unit of time in which it is 1 or more."""
    size, unit = next((entry for entry in _RATES if rate * entry[0] >= 1.0), _RATES[-1])
    return f"{float(f'{rate * size:.2g}'):,g} {unit}"


def _span(seconds: float) -> str:
    """A time in words."""
    for size, unit in _SPANS:
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
