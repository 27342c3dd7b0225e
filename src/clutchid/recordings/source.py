"""`Source`: an opened file, as groups of channels with common time stamps, not yet assigned to quantities."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from clutchid.log import Samples
from clutchid.names import printable
from clutchid.recordings.columns import REQUIRED, Heading
from clutchid.recordings.table import Table

#: Metadata: the unit in which the chamber pressure is written in the file.
UNIT_KEY = "pressure_a_unit"

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

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
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
    of the log that was written, see `clutchid.log.Log`.
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

    @property
    def name(self) -> str:
        """Name of the recording: that of the file without its suffix and ``.gz``, printable."""
        return printable(Path(self.path.name.removesuffix(".gz")).stem)

    @property
    def tabular(self) -> bool:
        """Whether it is a table whose columns the user can rename, so that messages ask for the standard names."""
        return self.format in ("CSV", "Parquet")


def own_metadata(text: str | None) -> dict[str, str] | None:
    """The metadata of the log that clutchid wrote as JSON to a file; None where the text is from another program."""
    try:
        values = json.loads(text or "")
    except (json.JSONDecodeError, RecursionError):
        return None
    return {str(key): str(value) for key, value in values.items()} if isinstance(values, dict) else None


def refused(path: Path, form: str, problem: str, *warnings: str) -> Source:
    """A file of the format `form` of which nothing can be read, and why."""
    return Source(path, form, (), lambda *_: iter(()), (problem,), warnings)


def in_contract(source: Source) -> bool:
    """Whether a file is one table whose columns have the standard names, so that it needs no channel map."""
    return len(source.rasters) == 1 and {heading.name for heading in source.rasters[0].headings}.issuperset(REQUIRED)


def with_unit(metadata: Mapping[str, str], headings: Iterable[Heading]) -> dict[str, str]:
    """Metadata of a recording with the unit in which the chamber pressure is written, unless that is Pa.

    Examples
    --------
    >>> from clutchid.recordings.columns import headings
    >>> with_unit({"start": "2026"}, headings(["pressure_a [bar]"])), with_unit({}, headings(["pressure_a [Pa]"]))
    ({'start': '2026', 'pressure_a_unit': 'bar'}, {})
    """
    unit = next((heading.unit for heading in headings if heading.name == "pressure_a"), None)
    kept = {key: text for key, text in metadata.items() if key != UNIT_KEY}
    return kept if unit in (None, "Pa") else {**kept, UNIT_KEY: str(unit)}
