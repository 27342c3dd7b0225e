"""Opening a recording: the format is told by the content, and its reader loaded only then."""

from __future__ import annotations

from os import PathLike

from clutchid.io.files import plain_file
from clutchid.io.table import Table


def open_table(path: str | PathLike[str], *, every: bool = False) -> Table:
    """The numbers in a CSV or Parquet file; `every` column, or those whose name is known.

    Raises
    ------
    DataError
        If there is no plain file that can be read; what is wrong inside it is in ``Table.problems``.
    """
    file = plain_file(path)
    with file.open("rb") as stream:
        magic = stream.read(4)
    if magic == b"PAR1":
        from clutchid.io import parquet_file

        return parquet_file.load(file, every=every)
    from clutchid.io import csv_file

    return csv_file.load(file, every=every)
