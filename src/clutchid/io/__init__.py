"""Recordings on disk: `read` and `write`, one file a format; units are converted here and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from clutchid.errors import DataError, ExportError
from clutchid.io.checks import AMBIENT, check
from clutchid.io.files import atomic_write, digest
from clutchid.io.look import Look, look
from clutchid.io.opening import open_table
from clutchid.log import Log

__all__ = ["AMBIENT", "Look", "atomic_write", "look", "read", "write"]


def read(path: str | PathLike[str], *, ambient: float = AMBIENT) -> Log:
    """The recording in a CSV or Parquet file, in SI; the format is known from the content.

    Columns are headed ``name [unit]``. An empty cell or NaN is a missing sample. What is suspicious but can be used
    is a sentence in ``Log.warnings``; the metadata hold ``source``, ``sha256`` and ``ambient_Pa``.

    Parameters
    ----------
    path
        The file; its name without suffix becomes the name of the log.
    ambient : Pa
        Absolute pressure, above 0, that is added to gauge pressures such as ``bar(g)``.

    Raises
    ------
    DataError
        If the file cannot be read or used; the text lists every problem with its line (Parquet: row) and column.
    ParameterError
        If `ambient` is not a pressure above 0.

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
    table = open_table(path)
    checked = check(table, ambient)
    if checked.problems:
        raise DataError.of(str(path), list(checked.problems))
    columns = dict(checked.columns)
    file = Path(path)
    metadata = {**table.metadata, "source": file.name, "sha256": digest(file), "ambient_Pa": repr(float(ambient))}
    return Log(columns.pop("time"), columns, file.stem, metadata, checked.warnings)


def write(log: Log, path: str | PathLike[str]) -> None:
    """Write `log` in SI to a ``.csv`` or ``.parquet`` file; `read` gives exactly the same numbers back.

    A file that exists is replaced in one step, so nothing is ever half-written. Parquet keeps the metadata too.

    Raises
    ------
    ExportError
        If the suffix is not known or the file cannot be written; an older file is then as it was.
    """
    writers = _writers()
    suffix = Path(path).suffix
    if suffix.lower() not in writers:
        what = f"the suffix '{suffix}' is not known" if suffix else "the name has no suffix"
        raise ExportError(f"{path}: {what}; a log is written as {' or '.join(writers)}.")
    with atomic_write(path) as temporary:
        writers[suffix.lower()](log, temporary)


def _writers() -> dict[str, Callable[[Log, Path], None]]:
    from clutchid.io import csv_file, parquet_file

    return {".csv": csv_file.save, ".parquet": parquet_file.save}
