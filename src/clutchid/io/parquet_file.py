"""Parquet: columns named ``name [unit]``, one row a sample."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.io.columns import Heading, headings, shortened
from clutchid.io.table import EXAMPLE, Places, Table, to_frame, wanted
from clutchid.log import Log

if TYPE_CHECKING:
    import polars as pl

_KEY = "clutchid"


def load(path: Path, *, every: bool = False) -> Table:
    """The numbers of a Parquet file; `every` column, or those whose name is known.

    Raises
    ------
    OSError
        If the file cannot be read; what is wrong inside it is in ``Table.problems``.
    """
    import polars as pl

    try:
        with path.open("rb") as file:  # an open file, because polars would expand wildcards in a name
            names = list(pl.read_parquet_schema(file))
            columns = headings(names)
            selected = wanted(columns, every)
            file.seek(0)
            frame = pl.read_parquet(file, columns=[names[column.index] for column in selected] or names[:1])
            file.seek(0)
            metadata = _metadata(pl.read_parquet_metadata(file).get(_KEY))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = shortened(str(error), 200)
        return Table(problems=(f"is no complete Parquet file ({reason}); copy or write it again.",))
    if names and frame.height == 0:
        return Table(columns, problems=(f"there are columns, but no samples; {EXAMPLE}",))
    usable = [column for column in selected if _numeric(frame[names[column.index]])]
    numbers = {column.index: frame[names[column.index]].cast(pl.Float64).to_numpy() for column in usable}
    problems = [_no_numbers(column, frame[names[column.index]]) for column in selected if column not in usable]
    shown = tuple(problem for problem in problems if problem)
    return Table(columns, numbers, frame.height, Places(), shown, metadata=metadata)


def save(log: Log, path: Path) -> None:
    """Write `log` in SI with its metadata; a missing sample is NaN.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    to_frame(log).write_parquet(path, metadata={_KEY: json.dumps(dict(log.metadata))})


def _numeric(series: pl.Series) -> bool:
    import polars as pl

    return series.dtype.is_numeric() or series.dtype == pl.Null


def _no_numbers(column: Heading, series: pl.Series) -> str:
    """The problem of a column that holds text, dates or truth values; none where it has no meaning anyway."""
    if column.name is None:
        return ""
    return f"column '{column.text}' holds {series.dtype} values; write numbers (Float64) in its unit."


def _metadata(text: str | None) -> dict[str, str]:
    """The metadata of the log that was written; none where they are from another program."""
    try:
        values = json.loads(text or "{}")
    except json.JSONDecodeError:
        return {}
    return {str(key): str(value) for key, value in values.items()} if isinstance(values, dict) else {}
