"""The numbers in a Parquet file that its reader trusts: of samples and bytes, in the footer and in each page's header.

A damaged number of samples would make the reader ask for more memory than there is, which ends the whole process.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, BinaryIO

#: Bytes that a header of a page may have, and by how much old writers count the bytes of a column wrongly.
_HEADER = 1 << 16
_SLACK = 1 << 20

_DEEPEST = 16
_EMPTY, _TRUE, _FALSE = 0, 1, 2
_BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 3, 7, 8, 9, 10, 12


class _Compact:
    """Values in the compact protocol of Thrift, one behind the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def byte(self) -> int:
        self.at += 1
        return self.data[self.at - 1]

    def varint(self) -> int:
        value = shift = 0
        while shift < 70:
            byte = self.byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
        raise ValueError("an endless number")

    def integer(self) -> int:
        value = self.varint()
        return (value >> 1) ^ -(value & 1)

    def skip(self, length: int) -> None:
        if length > len(self.data) - self.at:
            raise ValueError("a text that is longer than the file")
        self.at += length

    def value(self, kind: int, depth: int) -> Any:
        if kind in (_TRUE, _FALSE, _BYTE):
            return kind == _TRUE if kind != _BYTE else self.byte()
        if kind in (_DOUBLE, _BINARY):
            return self.skip(8 if kind == _DOUBLE else self.varint())
        if kind in (_LIST, _SET):
            head = self.byte()
            count = self.varint() if head >> 4 == 15 else head >> 4
            if count > len(self.data) - self.at:
                raise ValueError("a list that is longer than the file")
            inner = head & 15
            if inner in (_TRUE, _FALSE):
                return self.skip(count)
            return [self.value(inner, depth + 1) for _ in range(count)]
        if kind == _STRUCT:
            return self.struct(depth + 1)
        if _BYTE < kind < _DOUBLE:
            return self.integer()
        raise ValueError(f"a value of the unknown kind {kind}")

    def struct(self, depth: int = 0) -> dict[int, Any]:
        """The fields of a structure by their numbers."""
        if depth > _DEEPEST:
            raise ValueError("structures without end")
        fields: dict[int, Any] = {}
        field = 0
        while head := self.byte():
            field = field + (head >> 4) if head >> 4 else self.integer()
            fields[field] = self.value(head & 15, depth)
        return fields


def damage(path: Path) -> str:
    """What is wrong with the numbers of samples and bytes in a Parquet file; empty where nothing is.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        try:
            footer = _footer(file, size)
            groups = footer.get(4, [])
            if sum(group[3] for group in groups) != footer[3] or any(group[3] < 0 for group in groups):
                return "the samples of its parts are not those of the whole"
            columns = [column[3] for group in groups for column in group[1]]
            return next((found for column in columns if (found := _pages(file, size, column))), "")
        except (ValueError, IndexError, KeyError, TypeError, AttributeError) as error:
            return f"its description is damaged: {error}"


def _footer(file: BinaryIO, size: int) -> dict[int, Any]:
    file.seek(max(0, size - 8))
    tail = file.read(8)
    length = int.from_bytes(tail[:4], "little")
    if tail[4:] != b"PAR1" or length > size - 12:
        raise ValueError("it does not end as such a file ends")
    file.seek(size - 8 - length)
    return _Compact(file.read(length)).struct()


def _pages(file: BinaryIO, size: int, column: dict[int, Any]) -> str:
    """What is wrong with the pages of one column of one part."""
    start = column[9] if not column.get(11) else min(column[9], column[11])
    samples = 0
    while samples < column[5]:
        if not 0 < start < size:
            return f"a page at byte {start} is not in the file"
        file.seek(start)
        reader = _Compact(file.read(_HEADER))
        page = reader.struct()
        start += reader.at + page[3]
        data = page.get(5) or page.get(8)
        held = (data or page.get(7) or {1: 0})[1]
        limit = column[5] - samples if data else page[2]
        if not (page[3] >= 0 and start <= size and 0 <= page[2] <= column[6] + _SLACK and 0 <= held <= limit):
            return f"the page before byte {start} claims {held} samples in {page[2]} bytes"
        samples += held if data else 0
    return "" if column[5] >= 0 else "a column claims less than no samples"
