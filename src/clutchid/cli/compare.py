"""``clutchid compare``: loads of saved calibrations and estimates side by side, without fitting again."""

from __future__ import annotations

from pathlib import Path

from clutchid.cli.common import DONE, OutputFlag, PathOutput, guarded, print_document, print_written
from clutchid.errors import ParameterError


@guarded
def compare(*saved: Path, report: PathOutput = None, json: OutputFlag = False, debug: OutputFlag = False) -> int:
    """Compare the loads of saved calibrations and estimates, without fitting again.

    Parameters
    ----------
    saved
        Files that `clutchid calibrate`, `estimate` or `fit` have written with --save (TOML).
    report
        Write a self-contained HTML page.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import document_of, write_page
    from clutchid.documents.results import SavedLoads
    from clutchid.verbs.commands import argument, typed
    from clutchid.verbs.saving import check_outputs
    from clutchid.verbs.start import saved_load

    if not saved:
        raise ParameterError("no file given; clutchid compare NEW.toml WORN.toml, as written by --save.")
    check_outputs({"--report": report}, [("a file that is compared", path) for path in saved])
    words = ["compare", *map(argument, saved), *(["--report", argument(report)] if report else [])]
    document = document_of(SavedLoads(tuple(map(saved_load, saved))), typed(words))
    if report is not None:
        write_page(document, report)
    print_document(document, json=json)
    if not json:
        print_written(report)
    return DONE
