"""`paper_study`: the paper's study from two recordings to a folder with a page, figures and tables."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from clutchid.errors import ExportError
from clutchid.log import Log
from clutchid.report.files import write_bytes
from clutchid.report.html import render
from clutchid.report.tables import Table, to_csv
from clutchid.study.findings import Findings, find
from clutchid.study.fits import Case, Progress
from clutchid.study.page import study_page


@dataclass(frozen=True, slots=True, eq=False)
class PaperStudy:
    """The study as it was written: every method's results, tables by the stem of their file, and the files."""

    cases: tuple[Case, ...]
    tables: Mapping[str, Table]
    page: Path
    files: tuple[Path, ...]


def paper_study(fit_log: Log, verify_log: Log, out: Path, progress: Progress | None = None) -> PaperStudy:
    """Repeat Section 3 of the paper and write ``index.html``, ``figure_2.png`` to ``figure_8.png`` and a CSV a table.

    Nothing is written before all is done; then each file is replaced in one step, the page last.

    Parameters
    ----------
    fit_log, verify_log : Log
        Recordings with position and both duty cycles, to fit and to verify; with pressure the study is complete.
    out : Path
        The folder; it is made where it does not exist.
    progress : function(text, fraction), optional
        Called before each step with what is done, and how much of the study is, from 0 to 1.

    Raises
    ------
    ExportError
        If the folder or a file cannot be written.
    DataError
        If a recording cannot be fitted.
    SolveError
        If a simulation leaves the finite numbers.

    References
    ----------
    Section 3 of the paper; every deviation is listed on the page.
    """
    report, out = progress or _silent, Path(out)
    made = _folder(out)
    try:
        found = find(fit_log, verify_log, report)
        report("page", 0.95)
        page = render(study_page(found, _command(fit_log, verify_log, out)))
    except BaseException:
        if made:
            out.rmdir()
        raise
    files = _written(found, page, out)
    report("done", 1.0)
    return PaperStudy(found.cases, found.tables, files[-1], files)


def _written(found: Findings, page: str, out: Path) -> tuple[Path, ...]:
    """Write tables, figures and at last the page."""
    contents = {f"{stem}.csv": to_csv(table).encode("utf-8") for stem, table in found.tables.items()}
    contents |= {f"figure_{number}.png": picture for number, picture in found.figures.items()}
    contents["index.html"] = page.encode("utf-8")
    for name, content in contents.items():
        write_bytes(content, out / name)
    return tuple(out / name for name in contents)


def _silent(_text: str, _fraction: float) -> None:
    pass


def _folder(out: Path) -> bool:
    """Make the folder; whether it is new."""
    if out.is_dir():
        if not os.access(out, os.W_OK | os.X_OK):
            raise ExportError(f"{out}: the folder is write-protected; name another one with --out.")
        return False
    try:
        out.mkdir(parents=True)
    except FileExistsError as error:
        raise ExportError(f"{out}: is a file, the study needs a folder; name another one with --out.") from error
    except OSError as error:
        reason = error.strerror or "no reason given"
        raise ExportError(f"{out}: the folder cannot be made ({reason}); name another one with --out.") from error
    return True


def _command(fit_log: Log, verify_log: Log, out: Path) -> str:
    """The command that repeats the study."""
    words = ["clutchid", "paper"]
    if "true_load" not in fit_log.metadata:
        words += ["--fit", fit_log.metadata.get("source", fit_log.name)]
        words += ["--verify", verify_log.metadata.get("source", verify_log.name)]
    return shlex.join([*words, "--out", str(out)])
