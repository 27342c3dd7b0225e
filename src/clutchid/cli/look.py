"""``clutchid look``: list and check the contents of a file."""

from __future__ import annotations

import sys
from pathlib import Path

from clutchid.cli.common import BAD_INPUT, DONE, FileOptions, OutputFlag, PathOutput, guarded, print_json, print_written
from clutchid.documents.console import put, wrapped_sentences
from clutchid.verbs.options import USUAL_FILES


@guarded
def look(
    file: Path,
    /,
    *,
    save: PathOutput = None,
    start: Path | None = None,
    files: FileOptions = USUAL_FILES,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """List the contents of a recording (channels, units, ranges, gaps), check it, and propose a channel map.

    Parameters
    ----------
    file
        Recording: CSV, Parquet, MDF, MATLAB, or a CAN log (BLF, ASC, TRC, MF4); each also as .gz.
    save
        Write the proposed channel map (TOML), to be corrected by hand and given to `fit` and `simulate` with --map.
    start
        Calibration (TOML) with which the recording is compared: the actuator and its vented rest.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import document_of
    from clutchid.verbs.looking import looked, save_proposed
    from clutchid.verbs.saving import check_outputs
    from clutchid.verbs.start import content_of

    check_outputs({"--save": save}, [("the recording itself", file), ("the calibration", start)])
    content = None if start is None else content_of(start)
    result = looked(files.reading([file]), content)
    contents = result.contents
    document = document_of(result)
    if json:
        print_json(document.data())
    else:
        put(*(wrapped_sentences(row.text, sys.stdout) for row in document.rows))
    if save is not None:
        proposed = save_proposed(contents, save)
        print_written(save, to=sys.stderr if json else None)
        if not proposed.channels and not json:
            put("No channel could be identified by its name: the saved file lists all channels; write the map by hand.")
        elif contents.needs_map and contents.proposal.open and not json:
            put(f"{contents.proposal.remedy}, as the lines marked - above say, then check the map with --map.")
    return BAD_INPUT if contents.problems else DONE
