"""``clutchid look``: what is in a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from clutchid.cli.common import BAD_INPUT, DONE, check_outputs, guarded, pressure
from clutchid.parameters import Parameters

if TYPE_CHECKING:
    from clutchid.io.seen import Look


def look(
    file: Path,
    /,
    *,
    save: Path | None = None,
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    dbc: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    ambient: str | None = None,
    debug: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """List the channels of a recording with unit, raster, range and holes, every problem found, and a channel map.

    Parameters
    ----------
    file
        Recording: CSV, Parquet, MDF, MATLAB, or a CAN log (BLF, ASC, MF4).
    save
        Write the proposed channel map (TOML), to be mended by hand and given to `fit` and `simulate` with --map.
    map_
        Channel map to check the recording with; without it the proposed one.
    dbc
        DBC files that decode a bus log, several after each other.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; default P_0.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid.io.channel_map import write_map
        from clutchid.io.look import look as look_at

        check_outputs({"--save": save}, [("the recording itself", file)])
        at = pressure(ambient, Parameters().P_0)
        seen = look_at(file, at, tuple(dbc or ()))
        print(seen.table())
        print(_checks(file, seen, map_, at))
        if save is not None:
            proposed = seen.proposal.channels
            write_map(replace(proposed, comments={**proposed.comments, "": seen.listing()}), save)
            print(f"written: {save.resolve()}")
            if not proposed.channels:
                print("No channel has a name that tells what it is: the file lists them, write the map by hand.")
        return BAD_INPUT if seen.problems else DONE

    return guarded(work, as_json=False, debug=debug)


def _checks(file: Path, seen: Look, map_: Path | None, ambient: float) -> str:
    """What the checks before a fit find in the recording, or in its first million samples."""
    from clutchid.inspection import inspect
    from clutchid.io import channel_map, read_pieces

    channels = channel_map.read_map(map_) if map_ else seen.proposal.channels
    if map_ is None and (seen.problems or (seen.needs_map and not seen.proposal.complete)):
        return "\nNot checked: a fit cannot read the recording yet."
    chosen = channels if map_ or seen.needs_map else None
    log = next(read_pieces(file, ambient=ambient, channels=chosen, required=("time", "position")))
    return f"\n{inspect(log).table()}"
