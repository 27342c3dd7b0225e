"""`Source`: an opened file, as rasters of channels that share their stamps; nothing has a meaning yet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from clutchid.io.columns import REQUIRED, Heading
from clutchid.io.table import Table

#: Samples a block when a recording is read piece by piece.
BLOCK = 1 << 20


@dataclass(frozen=True, slots=True)
class Raster:
    """Channels that share their stamps: the columns of a table, a group of an MDF, a message on a bus.

    `headings` are all its channels in the order of their index, the stamps among them; `clock` is the index of the
    stamps, None where the file does not say which they are; `size` the number of samples of each; `name` how the file
    calls it.
    """

    headings: tuple[Heading, ...]
    size: int
    name: str = ""
    clock: int | None = None


class Tables(Protocol):
    """Reads channels of one raster, in order and block by block."""

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Consecutive tables of at most `rows` samples (None: one table) that hold the `columns` of raster `raster`.

        `Table.headings` are all headings of the raster, `Table.numbers` the asked columns by index in the units as
        written (what is no number is NaN), `Table.places` counts on over the blocks, and `Table.problems` are those of
        the block. Nothing but a block is in memory at a time.
        """


@dataclass(frozen=True, slots=True)
class Source:
    """An opened file: what it is, its rasters, and how they are read.

    `problems` are sentences about the file as such (truncated, empty), `warnings` what was left out of it, `metadata`
    what the file says of itself, and `unnamed` why only a channel map can read it, where no channel has a name.
    """

    path: Path
    format: str
    rasters: tuple[Raster, ...]
    tables: Tables
    problems: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    unnamed: str = ""

    @property
    def tabular(self) -> bool:
        """Whether it is one table whose columns a user can rename, so that misfits are told by the contract."""
        return self.format in ("CSV", "Parquet")


def in_contract(source: Source) -> bool:
    """Whether a file is one table whose columns have the names of the contract, so that it needs no channel map."""
    return len(source.rasters) == 1 and {heading.name for heading in source.rasters[0].headings}.issuperset(REQUIRED)
