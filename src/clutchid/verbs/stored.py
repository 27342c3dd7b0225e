"""A recording copied into columns for the page: to look at, to cut, and to plot any part quickly.

Of a plot each sample is there where they are few, else least and greatest of every pixel: a pulse of one sample is seen
at any zoom, and what is read does not grow with the length of the recording.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import INPUTS, FloatArray, Log, concatenated
from clutchid.measurements import AMBIENT, BLOCK, Heading, Source, in_si, open_source, source_pieces
from clutchid.measurements.look import overview_of
from clutchid.measurements.map.channel_map import read_map
from clutchid.measurements.stored import BIN, StoredColumn, column_of, extremes_of, store, stored, write_column
from clutchid.verbs.looking import NEEDED, Looked, checked_recording

if TYPE_CHECKING:
    from clutchid.measurements.look import FileOverview
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.strokes import Section

#: Index under which the time in s of a time grid is stored: it never decreases.
TIME_INDEX = 1_000_000

#: Most points across a plot.
_MOST_WIDTH = 4000


@dataclass(frozen=True, slots=True)
class StoredRecording:
    """A recording whose columns are in a folder, and how it is read.

    Attributes
    ----------
    source
        The columns, as of an opened file.
    channels
        Channel map, if it has one.
    ambient : Pa
        What gauge pressures count from, if stated.
    """

    source: Source
    channels: ChannelMap | None
    ambient: float | None

    @property
    def grids(self) -> list[list[int]]:
        """Numbers of the columns of each time grid, as `look` has them."""
        return [[heading.index for heading in grid.headings] for grid in self.source.rasters]

    @property
    def shown_ambient(self) -> float:
        """Ambient pressure in Pa, also where it is not stated."""
        return AMBIENT if self.ambient is None else self.ambient

    def contents(self) -> FileOverview:
        """Contents of the file."""
        return overview_of(self.source, self.ambient, self.channels.dbc if self.channels else (), self.channels)

    def checked(self, contents: FileOverview) -> Looked:
        """Checks of the recording.

        Raises
        ------
        DataError
            If its map does not fit it.
        """

        def read(channels: ChannelMap | None) -> Log:
            return next(source_pieces(self.source, channels, self.ambient, NEEDED))

        return checked_recording(contents, self.channels, None, read)

    def cut(self, span: tuple[float, float], out: Path) -> None:
        """Write all samples of a span in s as a recording."""
        from clutchid.measurements import write

        pieces = source_pieces(self.source, self.channels, self.ambient)
        parts = [piece.slice(*np.searchsorted(piece.time, span).tolist()) for piece in pieces]
        write(concatenated([part for part in parts if len(part)] or parts[:1]), out)


def copied(path: Path, folder: Path, progress: Callable[[int, int], None]) -> None:
    """Copy the columns of a file into a folder, which is emptied.

    Raises
    ------
    DataError, MissingExtra
        As `clutchid.read`.
    """
    source = open_source(path)
    shutil.rmtree(folder, ignore_errors=True)
    store(source, folder, BLOCK, progress)


def stored_recording(folder: Path, channels: Path | None, ambient: float | None) -> StoredRecording:
    """A copied recording with a file of its channel map; the time of every grid is stored for plots."""
    recording = StoredRecording(stored(folder), None if channels is None else read_map(channels), ambient)
    _write_clocks(recording.source, recording.channels, folder)
    return recording


def sections(log: Log | None, most: int) -> list[Section]:
    """The first strokes and rests of a recording; none where it lacks position or duty cycles."""
    from clutchid.strokes import sections_of

    if log is None or not {"position", *INPUTS} <= {*log.columns}:
        return []
    return list(islice(sections_of(log), most))


def write_columns(folder: Path, grid: int, time: FloatArray, columns: Iterable[FloatArray]) -> None:
    """Store the columns of a plot over one time."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, values in ((TIME_INDEX, clock_column(time)), *enumerate(columns)):
        write_column(folder, grid, number, values)


def _write_clocks(source: Source, channels: ChannelMap | None, folder: Path) -> None:
    """The time of every grid in s, as a column: that of the map, of the file, or the number of the sample."""
    from clutchid.measurements.map.picking import own_clock

    for index, raster in enumerate(source.rasters):
        clock = own_clock(raster)[0]
        entry = None if channels is None else channels.channels.get("time")
        if entry is not None:
            named = next((h for h in raster.headings if h.text == entry.channel), None)
            if named is not None:
                clock = Heading(named.index, named.text, "time", entry.unit or named.unit)
        rate = 1.0 if channels is None or channels.rate is None else channels.rate
        parts = []
        count = 0
        for table in source.tables(index, [] if clock is None else [clock.index], BLOCK):
            if clock is None or clock.index not in table.numbers:
                parts.append((count + np.arange(table.size)) / rate)
            else:
                parts.append(in_si(clock, table.numbers[clock.index], AMBIENT))
            count += table.size
        write_column(folder, index, TIME_INDEX, clock_column(np.concatenate(parts) if parts else np.empty(0)))


def clock_column(stamps: FloatArray) -> FloatArray:
    """Time stamps in s for plots: not finite ones and steps back stay at the greatest before them."""
    finite = np.where(np.isfinite(stamps), stamps, -np.inf)
    clock: FloatArray = np.maximum.accumulate(finite)
    first = clock[np.isfinite(clock)]
    return np.where(np.isfinite(clock), clock, first[0] if first.size else 0.0)


def plotted(folder: Path, grid: int, columns: Sequence[int], begin: float, end: float, width: int) -> FloatArray:
    """Time and columns between two times, shape (1 + columns, points).

    Parameters
    ----------
    folder
        Of stored columns, see `clutchid.measurements.stored`, with the time of the grid as the column `TIME_INDEX`.
    grid, columns
        Number of the time grid, and of columns in it.
    begin, end : s
        What is shown; one sample beyond either end is there as well.
    width
        Points across the plot; where there are more than two samples a point, it has the least and the greatest.

    Returns
    -------
    points
        Values as written; NaN where there are none.
    """
    clock = column_of(folder, grid, TIME_INDEX)
    size = clock.size
    first = max(_index(clock, size, begin) - 1, 0)
    last = min(_index(clock, size, end, after=True) + 1, size)
    count, width = max(last - first, 0), min(max(width, 1), _MOST_WIDTH)
    several = [column_of(folder, grid, column) for column in columns]
    if count <= 2 * width:
        return np.vstack([clock.read(first, last), *(column.read(first, last) for column in several)])
    step = -(-count // width)
    if step >= 2 * BIN:
        bins = step // BIN
        start, stop = first // BIN, -(-last // BIN)
        ends = [_merged(column.extremes(start, stop), bins) for column in several]
        stamps = clock.extremes(start, stop)[:, 0]  # of the first sample of each bin, as the time never decreases
        half = bins // 2
    else:
        ends = [extremes_of(column.read(first, last), step) for column in several]
        stamps, bins, half = clock.read(first, last), step, step // 2
    begins = np.arange(0, stamps.size, bins)
    times = stamps[np.column_stack([begins, np.minimum(begins + half, stamps.size - 1)]).ravel()]
    return np.vstack([times, *(values.ravel() for values in ends)])


def _merged(ends: FloatArray, bins: int) -> FloatArray:
    """Least and greatest values over several neighbouring bins."""
    begins = np.arange(0, len(ends), bins)
    low = np.fmin.reduceat(ends[:, 0], begins)
    high = np.fmax.reduceat(ends[:, 1], begins)
    return np.column_stack([low, high])


def _index(clock: StoredColumn, size: int, time: float, *, after: bool = False) -> int:
    """Index of the first sample at or after a time, or with `after` behind it; some twenty samples are read."""

    def is_before(index: int) -> bool:
        at = float(clock.read(index, index + 1)[0])
        return at <= time if after else at < time

    low, high = 0, size
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if is_before(middle) else (low, middle)
    return low
