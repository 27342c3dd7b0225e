"""``clutchid paper``: repeat the paper's study."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from clutchid.cli.common import DONE, FILES, FileOptions, OutOption, OutputFlag, guarded, progress_bar
from clutchid.documents.console import put
from clutchid.errors import ParameterError
from clutchid.verbs.options import USUAL_FILES

#: Printed before the study, which is silent where standard error is no terminal.
STARTED = "Repeating the fits, tables and figures of the paper: one to five minutes, depending on the machine."


@guarded
def paper(
    *,
    out: OutOption,
    fit: Annotated[Path | None, FILES] = None,
    verify: Annotated[Path | None, FILES] = None,
    files: FileOptions = USUAL_FILES,
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
    debug
        Show the traceback of an error.
    """
    from clutchid.study import halves, paper_study

    if (fit is None) != (verify is None):
        raise ParameterError("--fit and --verify: give both recordings, or neither.")
    fitted, verified = halves() if fit is None or verify is None else files.reading([fit, verify]).read()
    put(STARTED, to=sys.stderr)
    with progress_bar("paper") as show:
        paper_study(fitted, verified, out, progress=show)
    put(f"The page: {(out / 'index.html').resolve()}")
    return DONE
