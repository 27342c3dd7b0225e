"""Recordings on disk: `read` and `write`, one module per format; all unit conversions are here."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from clutchid.arguments import checked
from clutchid.errors import DataError, ExportError
from clutchid.files import atomic_write, digest, reading
from clutchid.log import Log
from clutchid.measurements.checks import AMBIENT, DUTY_ROUNDING, check_ambient, check_duties, in_si
from clutchid.measurements.columns import QUANTITIES, REQUIRED, Heading
from clutchid.measurements.formats.kinds import function_named, is_recording
from clutchid.measurements.opening import NoFramesError, open_source, with_dbc
from clutchid.measurements.source import BLOCK, UNIT_KEY, VENTED_KEY, Source, in_contract, to_frame
from clutchid.messages import shortened
from clutchid.names import printable

if TYPE_CHECKING:
    from clutchid.measurements.map.channel_map import ChannelMap

_Item = TypeVar("_Item")

#: Functions that write a log, by suffix.
_WRITERS = {
    ".csv": "csv.file.save", ".parquet": "parquet.file.save", ".mf4": "mdf.file.save", ".mat": "mat.file.save",
}  # fmt: skip

__all__ = [
    "AMBIENT", "BLOCK", "DUTY_ROUNDING", "QUANTITIES", "UNIT_KEY", "VENTED_KEY", "Heading", "NoFramesError", "Source",
    "check_duties", "in_si", "is_recording", "open_source", "read", "read_each", "read_frame", "read_pieces",
    "source_pieces", "to_frame", "write",
]  # fmt: skip


@checked
def read(
    path: str | PathLike[str],
    *,
    ambient: float | None = None,
    added: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    required: Sequence[str] = REQUIRED,
) -> Log:
    """Read a recording in any known format, in SI; the format is detected from the content.

    Columns with headings ``name [unit]`` are recognised. In other files `channels` assigns channels to quantities;
    without it, channels are identified by their names if these are unambiguous. An empty cell or NaN is a missing
    sample. Suspicious but usable data give ``Log.warnings``; the metadata has ``source``, ``sha256``, ``ambient_Pa``.

    Parameters
    ----------
    path
        File (CSV, Parquet, MDF, MATLAB, BLF, ASC); its name without suffix is the name of the log.
    ambient : Pa, optional
        Absolute ambient pressure, above 0. It is added to gauge pressures such as ``bar(g)`` and is the pressure of a
        vented chamber; by default `added` is added, and the pressure of a vented chamber is unknown.
    added : Pa, optional
        Pressure that is added to gauge pressures without `ambient`, such as P_0 of a model; by default the standard
        atmosphere, 101,300 Pa.
    channels
        A channel map, or the path of one (TOML).
    dbc
        DBC files that decode a bus log, besides those of the map.
    required
        Quantities that the file must have.

    Returns
    -------
    log : Log
        In SI, with the name of the file without its suffix.

    Raises
    ------
    DataError
        If the file cannot be read or used; the text lists every problem with its line (or row) and column.
    MissingExtra
        If the format needs a library that is not installed.
    ParameterError
        If `ambient` or `added` is not a pressure above 0, or the channel map is invalid.

    Examples
    --------
    >>> import tempfile
    >>> text = "time [ms],position [mm],duty_supply [%],duty_exhaust [%]\\n0,0,100,0\\n1,0.5,100,0\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text(text)
    ...     log = read(file)
    >>> log.name, float(log["position"][1]), float(log["duty_supply"][1])
    ('run', 0.0005, 1.0)
    """
    pieces = read_pieces(path, ambient=ambient, added=added, channels=channels, dbc=dbc, required=required, rows=None)
    log = next(pieces, None)
    if log is None:
        raise DataError(f"{path}: none of its samples can be read, so it is damaged; copy or write it again.")
    return log


def read_frame(frame: Any, name: str, ambient: float | None, channels: Any, required: Sequence[str]) -> Log:
    """A recording from a data frame, see `clutchid.Log.from_frame`."""
    import polars as pl

    from clutchid.measurements.formats.parquet.file import INDEX, frame_source
    from clutchid.measurements.grids import with_own_grids

    check_ambient(ambient)
    try:
        index = getattr(frame, "index", None)
        stamps = getattr(getattr(index, "dtype", None), "kind", "") in ("m", "M")
        column = getattr(index, "name", None) or (INDEX if stamps else None)
        table = pl.DataFrame(frame if column is None else frame.reset_index(names=column))
    except Exception as error:  # of polars, pandas or PyArrow
        reason = shortened(str(error), 200)
        raise DataError(
            f"{name}: a table of pandas, polars or Arrow is needed, a lazy one collected ({reason})."
        ) from error
    source = with_own_grids(frame_source(table, name))
    (log,) = source_pieces(source, _map(channels), ambient, required, None, checksum=False)
    return replace(log, name=name)


def read_each(items: Iterable[_Item], read_one: Callable[[_Item], Log]) -> list[Log]:
    """The recordings that `read_one` makes of `items`.

    Raises
    ------
    DataError
        The text lists the problems of all of them.
    """
    logs, problems = [], list[DataError]()
    for item in items:
        try:
            logs.append(read_one(item))
        except DataError as error:
            problems.append(error)
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise DataError("\n".join(str(error) for error in problems))
    return logs


@checked
def read_pieces(
    path: str | PathLike[str],
    *,
    ambient: float | None = None,
    added: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    required: Sequence[str] = REQUIRED,
    rows: int | None = BLOCK,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Log]:
    r"""Read a recording that does not fit into memory, as consecutive logs of about `rows` samples; else as `read`.

    Parameters
    ----------
    path, ambient, added, channels, dbc, required
        As in `read`.
    rows : int, optional
        Samples of a piece. With None it is one log, and the hash of the file is computed.
    progress : function(samples, all), optional
        Called after every piece with the number of samples read so far, and that of the longest time grid.

    Returns
    -------
    pieces : iterator of Log
        In order of time; a piece ends where the next begins.

    Raises
    ------
    DataError, MissingExtra, ParameterError
        As `read`; errors in the samples are raised when their piece is read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("time [s],position [mm]\n" + "".join(f"{i / 1000},{i / 100}\n" for i in range(2500)))
    ...     pieces = [*read_pieces(file, required=["time", "position"], rows=1000)]
    >>> sum(len(piece) for piece in pieces), f"{pieces[-1]['position'][-1] * 1e3:.2f} mm"
    (2500, '24.99 mm')
    """
    check_ambient(ambient)
    check_ambient(added)
    channel_map = _map(channels)
    source = with_dbc(open_source(path, (*(channel_map.dbc if channel_map else ()), *dbc)), dbc)
    yield from source_pieces(source, channel_map, ambient, required, rows, progress, added)


def source_pieces(
    source: Source,
    channel_map: ChannelMap | None = None,
    ambient: float | None = None,
    required: Sequence[str] = REQUIRED,
    rows: int | None = BLOCK,
    progress: Callable[[int, int], None] | None = None,
    added: float | None = None,
    *,
    checksum: bool = True,
) -> Iterator[Log]:
    """Consecutive logs of an opened file, with a channel map or without, see `read_pieces`.

    The metadata of one read as a whole have its `checksum`, unless it is a table in memory.
    """
    from clutchid.measurements.conversion import check_size, pieces

    added = next((float(pressure) for pressure in (ambient, added) if pressure is not None), AMBIENT)
    metadata = {"source": printable(source.path.name), "ambient_Pa": repr(added)}
    if ambient is not None:
        metadata[VENTED_KEY] = repr(added)
    if rows is None and checksum:
        metadata["sha256"] = digest(source.path)
    if channel_map is None and not in_contract(source):
        from clutchid.measurements.map.proposal import map_for

        if rows is None and len(source.rasters) == 1:
            named = [heading for heading in source.rasters[0].headings if heading.name is not None]
            check_size(source.path, source.rasters[0].size, len(named))
        channel_map = map_for(source, required)
    count, size = 0, max((raster.size for raster in source.rasters), default=0)
    logs = pieces(source, channel_map, added, required, rows)
    while True:
        with reading(source.path):  # an error of the disk names the recording, not a file that is written meanwhile
            log = next(logs, None)
        if log is None:
            return
        yield replace(log, metadata={**log.metadata, **metadata})
        count += len(log)
        if progress is not None:
            progress(count, size)


def _map(channels: ChannelMap | str | PathLike[str] | None) -> ChannelMap | None:
    if channels is None:
        return None
    from clutchid.measurements.map.channel_map import ChannelMap, read_map

    return channels if isinstance(channels, ChannelMap) else read_map(channels)


@checked
def write(log: Log, path: str | PathLike[str]) -> None:
    """Write `log` in SI to a ``.csv``, ``.parquet``, ``.mf4`` or ``.mat`` file; `read` returns the same values.

    An existing file is replaced atomically. All formats except CSV keep the metadata; only Parquet keeps the edges of
    duty cycles between the samples, the others warn.

    Parameters
    ----------
    log : Log
        Any columns.
    path : path
        Its suffix chooses the format.

    Raises
    ------
    ExportError
        If the suffix is unknown or the file cannot be written; an existing file is then unchanged.

    Examples
    --------
    Headings carry the unit, so no reader has to guess:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(Log([0.0, 1e-3], {"position": [0.0, 5e-4]}), f"{folder}/run.csv")
    ...     print(Path(folder, "run.csv").read_text().strip())
    time [s],position [m]
    0.0,0.0
    0.001,0.0005
    """
    suffix = Path(path).suffix
    if suffix.lower() not in _WRITERS:
        *suffixes, last = _WRITERS
        what = f"the suffix '{suffix}' is not known" if suffix else "the name has no suffix"
        raise ExportError(f"{path}: {what}; a log is written as {', '.join(suffixes)} or {last}.")
    if log.edges and suffix.lower() != ".parquet":
        lost = f"{path} does not keep the edges of {' and '.join(log.edges)} between the samples; .parquet does."
        warnings.warn(lost, stacklevel=2)
    with atomic_write(path) as temporary:
        function_named(_WRITERS[suffix.lower()])(log, temporary)
