"""``clutchid paper``: repeat the paper's study."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from clutchid.cli.common import DONE, FILES, FileOptions, OutOption, OutputFlag, guarded, progress_bar
from clutchid.documents.console import put
from clutchid.errors import ParameterError
from clutchid.verbs.options import USUAL_FILES


@guarded
def paper(
    *,
    out: OutOption,
    fit: Annotated[Path | None, FILES] = None,
    verify: Annotated[Path | None, FILES] = None,
    files: FileOptions = USUAL_FILES,
    literal: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Repeat the study of the paper as one HTML page: Eq. (21), Tables 1 and 2, Figures 2 to 8, verification.

    Parameters
    ----------
    out
        Folder for index.html, PNG and CSV files; created if necessary.
    fit
        Recording to fit; by default the bundled recording, first half for the fit, second half for verification.
    verify
        Recording for verification.
    literal
        Add the paper as printed: what runs, with its effects, and what cannot run, with how it fails.
    debug
        Show the traceback of an error.
    """
    from clutchid.study import halves, paper_study

    if (fit is None) != (verify is None):
        raise ParameterError("--fit and --verify: give both recordings, or neither.")
    fitted, verified = halves() if fit is None or verify is None else files.reading([fit, verify]).read()
    put("Repeating the fits, tables and figures of the paper, within five minutes.", to=sys.stderr)
    with progress_bar("paper") as show:
        paper_study(fitted, verified, out, show, literal=literal)
    put(f"The page: {(out / 'index.html').resolve()}")
    return DONE
