"""The numbers of samples and bytes in a Parquet file that polars trusts: in the footer and in each page's header.

Of 20,000 damaged files two had a number of samples for which polars asked for 2**61 bytes, which ends the process.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any, BinaryIO

from clutchid.recordings.formats.parquet.thrift import Compact, Kind, plain

#: Bytes that a header of a page may have, and by how much old writers count the bytes of a column wrongly.
_HEADER = 1 << 13
_SLACK = 1 << 20


class EncryptedParquet(ValueError):
    """The file, or columns of it, are encrypted."""


def damage(path: Path, columns: Collection[str] | None = None) -> str:
    """What is wrong with the numbers of samples and bytes of these columns (None: all); empty where nothing is.

    Raises
    ------
    EncryptedParquet
        If the file, or columns of it, are encrypted.
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        try:
            chunks = [chunk[3] for group in _footer(file, size).get(4, []) for chunk in group[1]]
            asked = [chunk for chunk in chunks if columns is None or chunk[3][0].decode() in columns]
            return next((found for chunk in asked if (found := _pages(file, size, chunk))), "")
        except EncryptedParquet:
            raise
        except (ValueError, IndexError, KeyError, TypeError, AttributeError, RecursionError) as error:
            return f"its description is damaged{f': {error}' if isinstance(error, ValueError) else ''}"


def _footer(file: BinaryIO, size: int) -> dict[int, Any]:
    file.seek(max(0, size - 8))
    tail = file.read(8)
    length = int.from_bytes(tail[:4], "little")
    if tail[4:] == b"PARE":
        raise EncryptedParquet
    if tail[4:] != b"PAR1" or length > size - 12:
        raise ValueError("it does not end as such a file ends")
    file.seek(size - 8 - length)
    footer: dict[int, Any] = plain(Kind.STRUCT, Compact(file.read(length)).struct())
    if 8 in footer:  # how its columns are encrypted
        raise EncryptedParquet
    return footer


def _pages(file: BinaryIO, size: int, chunk: dict[int, Any]) -> str:
    """What is wrong with the pages of one column of one part."""
    start = chunk[9] if not chunk.get(11) else min(chunk[9], chunk[11])
    samples = 0
    while samples < chunk[5]:
        if not 0 < start < size:
            return f"a page at byte {start} is not in the file"
        file.seek(start)
        reader = Compact(file.read(_HEADER))
        page = plain(Kind.STRUCT, reader.struct())
        start += reader.at + page[3]
        data = page.get(5) or page.get(8)
        held = (data or page.get(7) or {1: 0})[1]
        limit = chunk[5] - samples if data else page[2]
        if not (page[3] >= 0 and start <= size and 0 <= page[2] <= chunk[6] + _SLACK and 0 <= held <= limit):
            return f"the page before byte {start} claims {held} samples in {page[2]} bytes"
        samples += held if data else 0
    return "" if chunk[5] >= 0 else "a column claims less than no samples"
