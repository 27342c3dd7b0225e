"""``clutchid paper``: repeat the paper's study."""

from __future__ import annotations

from pathlib import Path

from clutchid.cli.common import DONE, Flag, guarded, progress_bar
from clutchid.cli.terminal import put
from clutchid.errors import ParameterError
from clutchid.parameters import Parameters
from clutchid.workflow import FileOptions, read_recordings
from clutchid.workflow.options import pressure


@guarded
def paper(
    *,
    out: Path,
    fit: Path | None = None,
    verify: Path | None = None,
    ambient: str | None = None,
    debug: Flag = False,
) -> int:
    """Repeat the paper's study: Eq. (21), Tables 1 and 2, Figures 2 to 8, verification, as one HTML page.

    Parameters
    ----------
    out
        Folder for index.html, PNG and CSV files; created if necessary.
    fit
        Recording to fit; by default the bundled recording, first half for the fit, second half for verification.
    verify
        Recording for verification.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; P_0 by default.
    debug
        Show the traceback of an error.
    """
    from clutchid.study import bundled_recording, halves, paper_study

    if (fit is None) != (verify is None):
        raise ParameterError("--fit and --verify: give both recordings, or neither.")
    if fit is None or verify is None:
        fitted, verified = halves(bundled_recording())
    else:
        fitted, verified = read_recordings([fit, verify], FileOptions(pressure(ambient, Parameters().P_0)))
    with progress_bar("paper") as show:
        paper_study(fitted, verified, out, progress=show)
    put(f"The page: {(out / 'index.html').resolve()}")
    return DONE
