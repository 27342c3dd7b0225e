"""`Table`: the values of a file as written, not yet assigned to quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray, Log, name_and_unit
from clutchid.recordings.columns import Heading

if TYPE_CHECKING:
    import polars as pl

Rows = NDArray[np.int64]

#: Number of locations that a message lists before it counts the rest.
SHOWN = 5

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

    def each_number(self, size: int) -> Rows:
        """The lines or rows of the first `size` samples."""
        return np.arange(self.first, self.first + size) if self.numbers is None else self.numbers

    def each(self, rows: Rows, what: Callable[[int], str]) -> str:
        """The first locations of `rows` with the text `what` about each, and the number of the others."""
        shown = [f"{self.word} {self.number(row)} {what(row)}" for row in rows[:SHOWN].tolist()]
        return and_more(shown, rows.size - len(shown))

    def ranges(self, rows: Rows) -> str:
        """The first runs of consecutive `rows`, and the number of the other runs: ``lines 4-9, 12``."""
        breaks = np.flatnonzero(np.diff(rows) > 1)
        starts, ends = rows[np.r_[0, breaks + 1]], rows[np.r_[breaks, rows.size - 1]]
        pairs = [(self.number(a), self.number(b)) for a, b in zip(starts[:SHOWN], ends[:SHOWN], strict=True)]
        shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in pairs]
        return f"{self.word}{'s' if rows.size > 1 else ''} {and_more(shown, starts.size - len(shown))}"


@dataclass(frozen=True, eq=False, slots=True)
class Table:
    """Headings, values by column index in the units as written, and problems found while reading.

    `unread` has, by column index, the rows with an invalid cell, which a problem reports already.
    """

    headings: tuple[Heading, ...] = ()
    numbers: Mapping[int, FloatArray] = field(default_factory=dict)
    size: int = 0
    places: Places = field(default_factory=Places)
    problems: tuple[str, ...] = ()
    unread: Mapping[int, Rows] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)


class _Part(Protocol):
    """Some samples of a table: numbers by column, rows with an invalid cell by column, and where they stand."""

    @property
    def size(self) -> int: ...
    @property
    def places(self) -> Places: ...
    @property
    def numbers(self) -> Mapping[int, FloatArray]: ...
    @property
    def unread(self) -> Mapping[int, Rows]: ...


def joined_samples(parts: Sequence[_Part]) -> tuple[dict[int, FloatArray], int, Places, dict[int, Rows]]:
    """Consecutive parts of a table as one: numbers, size, places and rows with an invalid cell."""
    starts = np.cumsum([0, *(part.size for part in parts)])
    numbers = {index: np.concatenate([part.numbers[index] for part in parts]) for index in parts[0].numbers}
    unread: dict[int, Rows] = {}
    for start, part in zip(starts, parts, strict=False):
        for index, rows in part.unread.items():
            unread[index] = np.concatenate([unread.get(index, rows[:0]), rows + start])
    places = parts[0].places
    if any(part.places.numbers is not None for part in parts):
        places = Places(places.word, numbers=np.concatenate([part.places.each_number(part.size) for part in parts]))
    return numbers, int(starts[-1]), places, unread


def to_frame(log: Log) -> pl.DataFrame:
    """`log` as a polars data frame with headings in SI, time first."""
    import polars as pl

    return pl.DataFrame(
        {
            "time [s]": log.time,
            **{"{} [{}]".format(*name_and_unit(name)): values for name, values in log.columns.items()},
        }
    )


def wanted(columns: Sequence[Heading], every: bool) -> tuple[Heading, ...]:
    """The columns to read: the known ones, or `every` one."""
    return tuple(column for column in columns if every or column.name is not None)


def and_more(shown: Iterable[str], rest: int) -> str:
    """List the shown items, and the number of the others.

    Examples
    --------
    >>> and_more(["line 4", "line 7"], 3)
    'line 4, line 7 and 3 more'
    """
    return ", ".join(shown) + (f" and {rest} more" if rest else "")
