"""``clutchid app``: a page on this machine, on which recordings are opened, looked at, fitted and compared."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import DONE, OutputFlag, guarded, print_written
from clutchid.documents.console import put
from clutchid.errors import missing


@guarded
def app(
    *files: Path,
    port: int = 0,
    folder: Path | None = None,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
    keep: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Open a page in the browser: recordings, channel maps, calibrations and loads, all on this machine.

    The address that is printed has a token; nobody without it can use the page. Ctrl-C ends it.

    Parameters
    ----------
    files
        Recordings and calibrations (TOML) that are opened at once.
    port
        Port of this machine; by default a free one.
    folder
        Folder of a project: its recordings can be opened by path, and recordings, maps and results are kept in
        DIR/.clutchid-app for the next time. By default those of the present one can be opened, and nothing is kept.
    browser
        Whether the browser is started.
    keep
        Keep uploads, maps and results at the end, and print in which folder.
    debug
        Show the traceback of an error, also of one in a job.
    """
    for name, library in (("starlette", "Starlette"), ("uvicorn", "uvicorn")):
        if find_spec(name) is None:
            raise missing("clutchid app", library, "app")
    from clutchid.app.folder import cache_folder
    from clutchid.app.server import serve

    base = serve(
        files,
        folder or Path(),
        cache_folder(),
        put,
        port=port,
        browser=browser,
        keep=keep,
        project=folder is not None,
        trace=lambda text: put(text, to=sys.stderr) if debug else None,
    )
    if keep:
        print_written(base)
    return DONE
