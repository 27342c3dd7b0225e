"""`paper_study`: the paper's study from two recordings to a folder with a page, figures and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from clutchid.documents.figures import png
from clutchid.documents.html import page_of
from clutchid.documents.tables import ReportTable, to_csv
from clutchid.files import check_writable, make_folder, not_an_address, write_bytes
from clutchid.log import Log
from clutchid.study.figures import FIGURES
from clutchid.study.literal import LITERAL_TABLES
from clutchid.study.page import study_page
from clutchid.study.results import Case, StudyProgress, find
from clutchid.study.tables import TABLES
from clutchid.systems import command_line


@dataclass(frozen=True, slots=True, eq=False)
class PaperStudy:
    """The completed study: results of all methods, tables by file stem, and the written files."""

    cases: tuple[Case, ...]
    tables: Mapping[str, ReportTable]
    page: Path
    files: tuple[Path, ...]


def paper_study(
    fit_log: Log, verify_log: Log, out: Path, progress: StudyProgress | None = None, *, literal: bool = False
) -> PaperStudy:
    """Repeat Section 3 of the paper and write ``index.html``, ``figure_2.png`` to ``figure_8.png`` and CSV tables.

    Files are written only after all computations, each one atomically, the page last. Folders that were created for a
    study that fails are removed.

    Parameters
    ----------
    fit_log, verify_log : Log
        Recordings with position and both duty cycles, to fit and to verify; with pressure, pressure errors are
        included.
    out : Path
        Output folder; created if necessary.
    progress : function(text, fraction), optional
        Called before each step with its description and the completed fraction, from 0 to 1.
    literal : bool
        Whether the paper as printed is added: what runs, beside what is used, and what cannot run.

    Raises
    ------
    ExportError
        If the folder or a file cannot be written.
    DataError
        If a recording cannot be fitted.
    SolveError
        If a simulation produces values that are not finite.

    References
    ----------
    Section 3 of the paper; every deviation is listed on the page.
    """
    report, out = progress or (lambda _text, _fraction: None), Path(out)
    makers = {**TABLES, **(LITERAL_TABLES if literal else {})}
    names = [*(f"{stem}.csv" for stem in makers), *(f"figure_{number}.png" for number in FIGURES), "index.html"]
    files = tuple(out / name for name in names)
    with _folder(out, names):
        study = find(fit_log, verify_log, report)
        tables = {stem: make(study) for stem, make in makers.items()}
        figures = {}
        for count, (number, make) in enumerate(FIGURES.items()):
            report(f"figure {number}", 0.65 + 0.3 * count / len(FIGURES))
            figures[number] = png(make(study))
        report("page", 0.95)
        command = _command(fit_log, verify_log, out, literal)
        page = page_of(study_page(study, tables, figures, command, names[:-1]))
        contents = [*(to_csv(table).encode("utf-8") for table in tables.values()), *figures.values(), page.encode()]
        for path, content in zip(files, contents, strict=True):  # the page last
            write_bytes(content, path)
    report("done", 1.0)
    return PaperStudy(study.cases, tables, files[-1], files)


@contextmanager
def _folder(out: Path, names: Sequence[str]) -> Iterator[None]:
    """Create the folder and missing parents, and remove them, with the files of the study, if the study fails."""
    folder = out.resolve()
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        not_an_address(out, "--out")  # resolved, it would look like a folder
        make_folder(folder, "--out")
        for name in names:
            check_writable(folder / name)
        yield
    except BaseException:
        for name in names if missing else ():  # then all files in the folder are from this study
            with suppress(OSError):
                (folder / name).unlink(missing_ok=True)
        for parent in missing:
            with suppress(OSError):
                parent.rmdir()
        raise


def _command(fit_log: Log, verify_log: Log, out: Path, literal: bool) -> str:
    """The command that reproduces the study."""
    words = ["clutchid", "paper"]
    if "true_load" not in fit_log.metadata:
        words += ["--fit", fit_log.metadata.get("source", fit_log.name)]
        words += ["--verify", verify_log.metadata.get("source", verify_log.name)]
    return command_line([*words, *["--literal"] * literal, "--out", str(out)])
