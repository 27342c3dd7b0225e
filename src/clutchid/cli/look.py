"""``clutchid look``: list and check the contents of a file."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.cli.common import (
    BAD_INPUT,
    DONE,
    DbcOption,
    Flag,
    MapOption,
    check_outputs,
    guarded,
    pressure,
    print_written,
)
from clutchid.cli.terminal import put, sentences
from clutchid.errors import DataError
from clutchid.parameters import Parameters
from clutchid.workflow import start_file

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.recordings.map.channel_map import ChannelMap
    from clutchid.recordings.overview import FileOverview


@guarded
def look(
    file: Path,
    /,
    *,
    save: Path | None = None,
    map_: MapOption = None,
    dbc: DbcOption = None,
    ambient: str | None = None,
    start: Path | None = None,
    debug: Flag = False,
) -> int:
    """List the channels of a recording with unit, time grid, range and holes, all problems, and a channel map.

    Parameters
    ----------
    file
        Recording: CSV, Parquet, MDF, MATLAB, or a CAN log (BLF, ASC, TRC, MF4); each also as .gz.
    save
        Write the proposed channel map (TOML), to be corrected by hand and given to `fit` and `simulate` with --map.
    map_
        Channel map: quantities, time axis, problems and checks are those of `fit` with this map.
    dbc
        DBC files that decode a bus log; several may follow each other.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; P_0 by default.
    start
        Calibration (TOML) that the recording is compared with: its actuator, and where its vented rest was.
    debug
        Show the traceback of an error.
    """
    from clutchid.recordings.look import look as look_at
    from clutchid.recordings.map.channel_map import read_map, write_map

    check_outputs({"--save": save}, [("the recording itself", file), ("the calibration", start)])
    content = None if start is None else start_file(start, None)
    at = pressure(ambient, (content.actuator.parameters if content else Parameters()).P_0)
    given = None if map_ is None else read_map(map_)
    contents = look_at(file, at, tuple(dbc or ()), given)
    put(sentences(contents.table(), sys.stdout))
    put(sentences(_checks(file, contents, given, at, content), sys.stdout))
    if save is not None:
        proposed = contents.proposal.channels
        write_map(replace(proposed, comments={**proposed.comments, "": contents.listing()}), save)
        print_written(save)
        if not proposed.channels:
            put("No channel could be identified by its name: the file lists all channels, write the map by hand.")
    return BAD_INPUT if contents.problems else DONE


def _checks(
    file: Path, contents: FileOverview, given: ChannelMap | None, ambient: float, content: ParameterFile | None = None
) -> str:
    """Results of the checks before a fit on the recording, or on its first million samples.

    A file that needs a channel map and has none is read with the proposed one.
    """
    from clutchid.preparation.inspection import inspect
    from clutchid.recordings import read_pieces

    if contents.problems:
        return "\nNot checked: the recording has problems."
    proposed = contents.proposal.channels
    channels = replace(given, dbc=proposed.dbc) if given else proposed if contents.needs_map else None
    if channels is proposed and "position" not in proposed.channels:
        return "\nNot checked: no channel could be identified as the position; a channel map is needed."
    try:
        log = next(read_pieces(file, ambient=ambient, channels=channels, required=("time", "position")))
    except DataError as error:
        if given or contents.proposal.complete:
            raise
        return f"\nNot checked, because the proposed channel map does not fit:\n{error}"
    how = "" if contents.proposal.complete or channels is not proposed else " with the proposed channel map"
    found = inspect(log, content.actuator, content.rest) if content else inspect(log)
    return f"\n{found.table(how)}"
