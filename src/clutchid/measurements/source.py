"""`Source`: an opened file, channels grouped by common stamps; `Table`: its values as written."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray, Log, Samples, name_and_unit
from clutchid.measurements.columns import REQUIRED, Heading
from clutchid.measurements.suffixes import recording_name
from clutchid.messages import SHOWN, listed
from clutchid.names import printable

if TYPE_CHECKING:
    import polars as pl

Rows: TypeAlias = NDArray[np.int64]

#: End of a message about a file without data.
EXAMPLE = "a header such as time [s],position [m],duty_supply [1],duty_exhaust [1] and samples below it are needed."


@dataclass(frozen=True, eq=False, slots=True)
class Places:
    """Location of the samples in the file: lines of a text, rows of a Parquet table; both count from 1."""

    word: str = "row"
    first: int = 1
    numbers: Rows | None = None

    def number(self, index: int) -> int:
        """The line or row of the sample `index`."""
        return self.first + int(index) if self.numbers is None else int(self.numbers[index])

    def take(self, part: Rows | slice) -> Places:
        """Those of some of the samples."""
        if self.numbers is not None:
            return Places(self.word, numbers=self.numbers[part])
        if isinstance(part, slice):
            return Places(self.word, self.first + part.start)
        return Places(self.word, numbers=self.first + part)

    def each(self, rows: Rows, what: Callable[[int], str]) -> str:
        """The first locations of `rows` with the text `what` about each, and the number of the others."""
        shown = [f"{self.word} {self.number(row)} {what(row)}" for row in rows[:SHOWN].tolist()]
        return listed(shown, total=rows.size)

    def ranges(self, rows: Rows) -> str:
        """The first runs of consecutive `rows`, and the number of the other runs: ``lines 4-9, 12``."""
        breaks = np.flatnonzero(np.diff(rows) > 1)
        starts, ends = rows[np.r_[0, breaks + 1]], rows[np.r_[breaks, rows.size - 1]]
        pairs = [(self.number(a), self.number(b)) for a, b in zip(starts[:SHOWN], ends[:SHOWN], strict=True)]
        shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in pairs]
        return f"{self.word}{'s' if rows.size > 1 else ''} {listed(shown, total=starts.size)}"


@dataclass(frozen=True, eq=False, slots=True)
class Table:
    """Headings, values by column index in the units as written, and problems found while reading.

    `unread` has, by column index, the rows with an invalid cell, which a problem reports already; `warnings` say what
    was left out of the selected columns.
    """

    headings: tuple[Heading, ...] = ()
    numbers: Mapping[int, FloatArray] = field(default_factory=dict)
    size: int = 0
    places: Places = field(default_factory=Places)
    problems: tuple[str, ...] = ()
    unread: Mapping[int, Rows] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def take(self, rows: Rows) -> Table:
        """Some of the rows; consecutive ones as views."""
        apart = not rows.size or (np.diff(rows) != 1).any()
        part = rows if apart else slice(int(rows[0]), int(rows[-1]) + 1)
        return replace(
            self,
            numbers={index: values[part] for index, values in self.numbers.items()},
            size=rows.size,
            places=self.places.take(part),
            unread={index: np.flatnonzero(np.isin(rows, unread)) for index, unread in self.unread.items()},
        )

    def parts(self, rows: int | None) -> Iterator[Table]:
        """The table in parts of at most `rows` samples (None: whole); its problems are those of the first part."""
        for begin in range(0, max(self.size, 1), rows or max(self.size, 1)):
            part = self.take(np.arange(begin, min(begin + (rows or self.size), self.size)))
            yield part if begin == 0 else replace(part, problems=())


def joined_tables(tables: Sequence[Table]) -> Table:
    """Consecutive tables as one, with the headings of the first."""
    first = tables[0]
    if len(tables) == 1:
        return first
    starts = np.cumsum([0, *(table.size for table in tables)])
    unread: dict[int, Rows] = {}
    for start, table in zip(starts, tables, strict=False):
        for index, rows in table.unread.items():
            unread[index] = np.concatenate([unread.get(index, rows[:0]), rows + start])
    places = first.places
    if any(table.places.numbers is not None for table in tables):
        lines = [np.asarray(table.places.take(np.arange(table.size)).numbers) for table in tables]
        places = Places(places.word, numbers=np.concatenate(lines))
    return replace(
        first,
        numbers={index: np.concatenate([table.numbers[index] for table in tables]) for index in first.numbers},
        size=int(starts[-1]),
        places=places,
        problems=tuple(dict.fromkeys(problem for table in tables for problem in table.problems)),
        unread=unread,
        warnings=tuple(dict.fromkeys(warning for table in tables for warning in table.warnings)),
    )


def to_frame(log: Log) -> pl.DataFrame:
    """`log` as a polars data frame with headings in SI, time first."""
    import polars as pl

    return pl.DataFrame(
        {
            "time [s]": log.time,
            **{"{} [{}]".format(*name_and_unit(name)): values for name, values in log.columns.items()},
        }
    )


#: Metadata: the unit in which the chamber pressure is written in the file.
UNIT_KEY = "pressure_a_unit"

#: Metadata: the pressure in Pa that a sensor without offset shows while the chamber is vented, if known.
VENTED_KEY = "vented_Pa"

#: Samples per block when a recording is read in pieces.
BLOCK = 1 << 20


@dataclass(frozen=True, slots=True)
class Raster:
    """Channels on one time grid: the columns of a table, a group of an MDF file, a message on a bus.

    `headings` are all its channels in order of their index, including the time stamps; `clock` is the index of the time
    stamps, None if the file does not define it; `size` the number of samples per channel; `name` its name in the file.
    `others` are its channels that cannot be read as numbers: name, and what they hold ("text", "3 x 4 numbers").
    """

    headings: tuple[Heading, ...]
    size: int
    name: str = ""
    clock: int | None = None
    others: tuple[tuple[str, str], ...] = ()


class Tables(Protocol):
    """Function that reads channels of one time grid, block by block."""

    def __call__(self, raster: int, columns: Sequence[int], /, rows: int | None = None) -> Iterator[Table]:
        """Consecutive tables of at most `rows` samples (None: one table) with the `columns` of time grid `raster`.

        `Table.headings` are all headings of the time grid, `Table.numbers` the selected columns by index in the units
        of the file (NaN where not numeric), `Table.places` counts over all blocks, and `Table.problems` are those of
        the block. Only one block is in memory at a time.
        """


@dataclass(frozen=True, slots=True)
class Source:
    """An opened file: format, time grids, and the function that reads them.

    `problems` are messages about the file as a whole (truncated, empty), `warnings` about parts that were ignored,
    `metadata` that of the file, `unnamed` why it needs a channel map if its channels have no names, and `edges` those
    of the log that was written, see `clutchid.log.Log`. With `one_clock` the stamps of all its time grids come from one
    clock, which the reader has repaired.
    """

    path: Path
    format: str
    rasters: tuple[Raster, ...]
    tables: Tables
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    unnamed: str = ""
    edges: Mapping[str, Samples] = field(default_factory=dict)
    one_clock: bool = False

    @property
    def name(self) -> str:
        """Name of the recording: that of the file without its suffix, also that of a packed file, printable."""
        return printable(recording_name(self.path.name))

    @property
    def headings(self) -> list[Heading]:
        """The headings of all its time grids."""
        return [heading for raster in self.rasters for heading in raster.headings]

    @property
    def tabular(self) -> bool:
        """Whether it is a table whose columns the user can rename, so that messages ask for the standard names."""
        return self.format in ("CSV", "Parquet", "JSON lines")


def own_metadata(text: str | None) -> dict[str, str] | None:
    """The metadata of the log that clutchid wrote as JSON to a file; None where the text is from another program."""
    try:
        values = json.loads(text or "")
    except (json.JSONDecodeError, RecursionError):
        return None
    return {str(key): str(value) for key, value in values.items()} if isinstance(values, dict) else None


def no_tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:  # noqa: ARG001
    """The tables of a file that cannot be read: none."""
    return iter(())


def refused(path: Path, form: str, problem: str, *warnings: str) -> Source:
    """A file of the format `form` of which nothing can be read, and why."""
    return Source(path, form, (), no_tables, (problem,), warnings)


def in_contract(source: Source) -> bool:
    """Whether a file is one table whose columns have the standard names, so that it needs no channel map.

    In a file whose channels cannot be renamed they have units as well, which a map may give.
    """
    if len(source.rasters) != 1:
        return False
    named = {heading.name: heading for heading in source.rasters[0].headings if heading.name is not None}
    complete = source.tabular or all(heading.si for heading in named.values())
    return complete and set(named).issuperset(REQUIRED)


def with_unit(metadata: Mapping[str, str], headings: Iterable[Heading]) -> dict[str, str]:
    """Metadata of a recording with the unit in which the chamber pressure is written, unless that is Pa.

    Examples
    --------
    >>> from clutchid.measurements.columns import headings
    >>> with_unit({"start": "2026"}, headings(["pressure_a [bar]"])), with_unit({}, headings(["pressure_a [Pa]"]))
    ({'start': '2026', 'pressure_a_unit': 'bar'}, {})
    """
    unit = next((heading.unit for heading in headings if heading.name == "pressure_a"), None)
    others = {key: text for key, text in metadata.items() if key != UNIT_KEY}
    return others if unit in (None, "Pa") else {**others, UNIT_KEY: str(unit)}
