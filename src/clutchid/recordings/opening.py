"""Open a recording: the format is detected from the content.

Text, and Parquet of moderate size, is read in this process; everything else in the guarded reader process (`io.guard`).
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from clutchid.recordings.files import plain_file
from clutchid.recordings.formats.kinds import readable_kind
from clutchid.recordings.formats.opening import opened_here
from clutchid.recordings.source import Source

#: Bytes in memory up to which a Parquet file is read in this process.
_MODERATE = 256_000_000


def open_source(path: str | PathLike[str], dbc: Sequence[str | PathLike[str]] = ()) -> Source:
    """Open a file of any known format; `dbc` files decode the frames of a bus log.

    Raises
    ------
    DataError
        If the recording or a DBC file is not a readable plain file, is no recording, or ended the reader process;
        problems inside a recording are in ``Source.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    """
    file = plain_file(path)
    databases = [plain_file(name, "DBC file") for name in dbc]
    kind = readable_kind(file)
    if kind == "csv" or (kind == "parquet" and _is_moderate(file)):
        return opened_here(file, databases, kind)
    from clutchid.recordings.guard.process import guarded_source

    return guarded_source(file, databases, kind)


def _is_moderate(file: Path) -> bool:
    """Whether a Parquet file says that its columns of numbers need no more memory than may be used in this process."""
    from clutchid.recordings.formats.parquet.file import promised_bytes

    promised = promised_bytes(file)
    return promised is not None and promised <= _MODERATE
