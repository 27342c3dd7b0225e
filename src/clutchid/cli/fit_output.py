"""What ``clutchid fit`` prints: the summary, what was written, warnings, and the next step; or the JSON object."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from clutchid.cli.common import DONE, EMPTY, FAILED, print_json, print_written
from clutchid.cli.terminal import WIDTH, print_rows, printable_lines, put
from clutchid.errors import ExportError
from clutchid.names import printable

if TYPE_CHECKING:
    from clutchid.reports.next_step import Command
    from clutchid.workflow import Outcome

#: Most warnings of a summary.
MOST_WARNINGS = 3

Writers = Mapping[Path | None, Callable[[Path], None]]


def answer_json(outcome: Outcome, writers: Writers) -> int:
    """Write the files, and print the JSON object; the exit code."""
    from clutchid.reports.fit_json import fit_json

    _, failures = _write(writers)
    lost = {"status": "failed", "message": f"the fit is complete, but {'; '.join(failures)}"} if failures else {}
    print_json({**EMPTY, **fit_json(outcome.fit), **lost})
    return FAILED if failures else DONE


def answer(outcome: Outcome, writers: Writers, command: Command, verbose: bool) -> int:
    """Write the files, and print the result; the exit code. Neither costs the other where it fails, or stalls."""
    from clutchid.reports.next_step import next_step
    from clutchid.reports.summary import Row, other_warnings

    written, failures = _write(writers)
    _complain(failures)
    _print_result(outcome, verbose)
    warnings = other_warnings(outcome.fit)
    _warn(warnings, len(warnings) if verbose else MOST_WARNINGS)
    print_written(*written)
    if failures:
        return FAILED
    why, what = next_step(outcome.fit, command)
    print_rows([Row("next", f"{why}:")])
    put(printable(f"  {what}"))
    return DONE


def _print_result(outcome: Outcome, verbose: bool) -> None:
    from clutchid.reports.fit_text import fit_text
    from clutchid.reports.summary import summary

    print_rows(summary(outcome.fit, in_full=verbose))
    if verbose:
        put(f"\n{printable_lines(fit_text(outcome.fit, WIDTH))}")


def _complain(failures: Sequence[str]) -> None:
    for failure in failures:
        put(f"clutchid: the fit is complete, but {printable_lines(failure)}", to=sys.stderr)


def _write(writers: Writers) -> tuple[list[Path], list[str]]:
    """Write the files; those written, and why others could not be."""
    written, failures = [], []
    for path, write in writers.items():
        try:
            if path is not None:
                write(path)
                written.append(path)
        except ExportError as error:
            failures.append(str(error))
    return written, failures


def _warn(warnings: Sequence[str], most: int) -> None:
    """The first warnings on standard error."""
    shown = [f"warning: {printable_lines(warning)}" for warning in warnings[:most]]
    if len(warnings) > most:
        more = len(warnings) - most
        shown.append(f"{more} more warning{'s' if more > 1 else ''}: --verbose")
    for line in shown:
        put(fill(line, WIDTH, break_long_words=False, break_on_hyphens=False), to=sys.stderr)
