"""What ``clutchid fit`` prints: the summary, what was written, warnings, and the next step; or the JSON object."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from clutchid.cli.common import DONE, EMPTY, FAILED, print_json, print_written
from clutchid.cli.terminal import WIDTH, print_rows, printable_lines
from clutchid.errors import ExportError
from clutchid.names import printable

if TYPE_CHECKING:
    from clutchid.report.next_step import Command
    from clutchid.workflow import Outcome

#: Most warnings of a summary.
MOST_WARNINGS = 3

Writers = Mapping[Path | None, Callable[[Path], None]]


def answer_json(outcome: Outcome, writers: Writers) -> int:
    """Write the files, and print the JSON object; the exit code."""
    from clutchid.report.fit_json import fit_json

    _, failures = _write(writers)
    lost = {"status": "failed", "message": f"the fit is complete, but {'; '.join(failures)}"} if failures else {}
    print_json({**EMPTY, **fit_json(outcome.fit, outcome.single), **lost})
    return FAILED if failures else DONE


def answer(outcome: Outcome, writers: Writers, command: Command, verbose: bool) -> int:
    """Print the result, and write the files; the exit code. Neither costs the other where it fails."""
    from clutchid.report.next_step import next_step
    from clutchid.report.summary import Row, other_warnings

    fit = outcome.fit
    try:
        _print_result(outcome, verbose)
    except (OSError, SystemExit):  # nobody reads on, which Rich makes an exit: the files are wanted all the same
        _complain(_write(writers)[1])
        raise
    warnings = other_warnings(fit)
    _warn(warnings, len(warnings) if verbose else MOST_WARNINGS)
    written, failures = _write(writers)
    print_written(*written)
    _complain(failures)
    if failures:
        return FAILED
    why, what = next_step(fit, command)
    print_rows([Row("next", f"{why}:")])
    print(printable(f"  {what}"))
    return DONE


def _print_result(outcome: Outcome, verbose: bool) -> None:
    from clutchid.report.fit_text import fit_text
    from clutchid.report.summary import summary

    print_rows(summary(outcome.fit, outcome.single, in_full=verbose))
    if verbose:
        print(f"\n{printable_lines(fit_text(outcome.fit, WIDTH))}")
    sys.stdout.flush()


def _complain(failures: Sequence[str]) -> None:
    for failure in failures:
        print(f"clutchid: the fit is complete, but {printable_lines(failure)}", file=sys.stderr)


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
        print(fill(line, WIDTH, break_long_words=False, break_on_hyphens=False), file=sys.stderr)
