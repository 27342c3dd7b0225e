"""`cut`: the strokes of a long recording that say most about the load."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

from clutchid.arguments import checked
from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.verbs.fitting import LogOrPath

if TYPE_CHECKING:
    from clutchid.measurements.map.channel_map import ChannelMap


@checked
def cut(
    recording: LogOrPath,
    *,
    seconds: float = 60.0,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> Log:
    """The strokes of a long recording with the most information about the load, as one recording with holes.

    Parameters
    ----------
    recording : Log or path
        Of any length; a file is read in pieces.
    seconds : s
        Greatest total length of the strokes.
    ambient : Pa, optional
        Ambient pressure for gauge units, by default 101,300 Pa.
    channels, dbc
        As in `clutchid.read`.

    Returns
    -------
    log : Log
        Strokes in order of time; where samples were left out, its time has a hole.

    Raises
    ------
    DataError
        If there is no usable stroke of at most that length.

    Examples
    --------
    The strokes of half a minute that say most about the load, in less than 8 s:

    >>> import clutchid
    >>> best = clutchid.cut(clutchid.bundled_recording(), seconds=8.0)
    >>> bool(len(best) <= 8000), f"{best['position'].max() * 1e3:.0f} mm"
    (True, '23 mm')
    """
    from clutchid.measurements import read_pieces
    from clutchid.strokes import choose, joined
    from clutchid.strokes import cut as sections_of

    if isinstance(recording, Log):
        name, pieces = recording.name, iter([recording])
    else:
        name, pieces = str(recording), read_pieces(recording, ambient=ambient, channels=channels, dbc=dbc)
    chosen = choose(sections_of(pieces), seconds)
    if not chosen:
        raise DataError(f"{name}: no usable stroke of at most {seconds:g} s was found.")
    return joined(chosen)
