"""`look`: what is in a file, also where `read` would refuse it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from clutchid.io.checks import AMBIENT, check, holes, in_si, intervals, usual_interval
from clutchid.io.columns import Heading
from clutchid.io.opening import open_table
from clutchid.io.table import SHOWN, Table, and_more
from clutchid.log import FloatArray


@dataclass(frozen=True, slots=True)
class ColumnLook:
    """One column of a file; numbers are NaN and the SI unit None where they are not known.

    `name` is the quantity (None: the column is ignored by `read`), `heading` the text as written, `low` and `high` the
    range in `unit`, `low_si` and `high_si` in `si`, `missing` the number of samples without a finite number.
    """

    heading: str
    name: str | None
    unit: str | None
    si: str | None
    low: float
    high: float
    low_si: float
    high_si: float
    missing: int


@dataclass(frozen=True, slots=True)
class Hole:
    """An interval much longer than the others: the line or row before it, its start and length in s."""

    place: int
    start: float
    length: float


@dataclass(frozen=True, slots=True)
class TimeLook:
    """The time axis in s: first and last sample, shortest, usual and longest interval, and the first of the holes."""

    first: float
    last: float
    shortest: float
    usual: float
    longest: float
    hole_count: int
    holes: tuple[Hole, ...]

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return self.last - self.first

    @property
    def rate(self) -> float:
        """Samples per second, from the usual interval."""
        return 1 / self.usual


@dataclass(frozen=True, slots=True)
class Look:
    """What is in a file: its columns, its time axis (None: there is none), problems and warnings of `read`."""

    source: str
    samples: int
    columns: tuple[ColumnLook, ...]
    time: TimeLook | None
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
    place: str

    def __str__(self) -> str:
        return self.table()

    def table(self) -> str:
        """Everything as plain text for a terminal.

        Raises
        ------
        Nothing.
        """
        lines = [f"{self.source}: {self.samples:,} sample{'' if self.samples == 1 else 's'}{_time_text(self.time)}"]
        if self.columns:
            lines += ["", *_aligned([_TITLES, *map(_row, self.columns)])]
        if self.time and self.time.hole_count:
            shown = [f"{_short(hole.length)} s after {self.place} {hole.place}" for hole in self.time.holes]
            lines += ["", f"Holes: {and_more(shown, self.time.hole_count - len(shown))}"]
        for title, sentences in (("Problems", self.problems), ("Warnings", self.warnings)):
            if sentences:
                lines += ["", f"{title}:", *(f"  - {sentence}" for sentence in sentences)]
        return "\n".join(lines)


def look(path: str | PathLike[str], ambient: float = AMBIENT) -> Look:
    """What is in a CSV or Parquet file, whether or not `read` would accept it.

    Parameters
    ----------
    path
        The file.
    ambient : Pa
        Absolute pressure, above 0, that is added to gauge pressures such as ``bar(g)``.

    Raises
    ------
    DataError
        If there is no file that can be read; what is wrong inside it is in ``Look.problems``.
    ParameterError
        If `ambient` is not a pressure above 0.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("time [ms],position [mm]\\n0,0\\n1,0.5\\n2,\\n")
    ...     seen = look(file)
    >>> seen.time.rate, seen.columns[1].high_si, seen.columns[1].missing
    (1000.0, 0.0005, 1)
    """
    table = open_table(path, every=True)
    checked = check(table, ambient)
    columns = tuple(_column(heading, table, ambient) for heading in table.headings)
    time = _time(table, checked.columns["time"]) if _has_time(table) else None
    return Look(str(path), table.size, columns, time, checked.problems, checked.warnings, table.places.word)


def _has_time(table: Table) -> bool:
    """Whether there is a time column that can be given in s, the first of that name."""
    first = next((heading for heading in table.headings if heading.name == "time"), None)
    return first is not None and first.si is not None and bool(np.isfinite(table.numbers.get(first.index, _NONE)).any())


_NONE = np.empty(0)


def _column(heading: Heading, table: Table, ambient: float) -> ColumnLook:
    written = table.numbers.get(heading.index, _NONE)
    low, high = _range(written)
    low_si, high_si = _range(in_si(heading, written, ambient)) if heading.si else (math.nan, math.nan)
    missing = table.size - int(np.count_nonzero(np.isfinite(written)))
    return ColumnLook(heading.text, heading.name, heading.unit, heading.si, low, high, low_si, high_si, missing)


def _range(values: FloatArray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (math.nan, math.nan)


def _time(table: Table, time: FloatArray) -> TimeLook:
    rows = np.flatnonzero(np.isfinite(time))
    time = time[rows]
    steps = intervals(time) if time.size > 1 else np.array([math.inf])
    after = holes(time)
    shown = tuple(Hole(table.places.number(rows[i]), float(time[i]), float(steps[i])) for i in after[:SHOWN].tolist())
    ends, longest = (float(time[0]), float(time[-1])), float(steps.max())
    return TimeLook(*ends, float(steps.min()), usual_interval(time), longest, int(after.size), shown)


_TITLES = ("column", "as written", "from", "to", "in SI from", "to", "missing")


def _row(column: ColumnLook) -> tuple[str, ...]:
    """The cells of one column in the table."""
    si = f" {column.si}" if column.si not in (None, "1") else ""
    in_unit = [_short(column.low), _short(column.high)]
    converted = [f"{_short(value)}{si}" if math.isfinite(value) else "-" for value in (column.low_si, column.high_si)]
    return (column.name or "(ignored)", column.heading, *in_unit, *converted, f"{column.missing:,}")


def _aligned(rows: Sequence[Sequence[str]]) -> Iterable[str]:
    """Lines of a table: the first two columns to the left, numbers to the right."""
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    for row in rows:
        padded = [
            f"{cell:<{width}}" if i < 2 else f"{cell:>{width}}"
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield ("  " + "  ".join(padded)).rstrip()


def _time_text(time: TimeLook | None) -> str:
    if time is None:
        return ", no time axis"
    if not math.isfinite(time.usual):
        return f" at {_short(time.first)} s"
    rate = f"{_short(time.rate)} Hz, every {_short(time.shortest)} to {_short(time.longest)} s"
    return f", {_short(time.duration)} s from {_short(time.first)} s at {rate}"


def _short(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "-"
