"""Footer and page headers of a Parquet file, in the compact protocol of Thrift: read, checked, joined.

A structure keeps the kinds of its fields, so that what is not understood is written again as it was read.

Of 20,000 damaged files two had a number of samples for which polars asked for 2**61 bytes, which ends the process.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

#: A structure: (kind, value) by the number of the field; of a list the value is (kind, values).
Tree = dict[int, tuple[int, Any]]


class ThriftKind(IntEnum):
    """Kinds of values in the compact protocol of Thrift, as far as they are named here."""

    STOP = 0
    TRUE = 1
    FALSE = 2
    BYTE = 3
    I16 = 4
    DOUBLE = 7
    BINARY = 8
    LIST = 9
    SET = 10
    STRUCT = 12


class CompactReader:
    """Values one behind the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, size: int) -> bytes:
        """The next bytes."""
        self.at += size
        if self.at > len(self.data):
            raise ValueError("it ends too early")
        return self.data[self.at - size : self.at]

    def varint(self) -> int:
        """The next number without a sign."""
        value = shift = 0
        while (byte := self.take(1)[0]) & 128:
            value |= (byte & 127) << shift
            shift += 7
        return value | byte << shift

    def struct(self) -> Tree:
        """The next structure."""
        fields: Tree = {}
        field = 0
        while (head := self.take(1)[0]) != ThriftKind.STOP:
            field = field + (head >> 4) if head >> 4 else self.value(ThriftKind.I16)
            fields[field] = (head & 15, self.value(head & 15))
        return fields

    def value(self, kind: int) -> Any:
        """The next value, which is of a `ThriftKind`."""
        if kind in (ThriftKind.TRUE, ThriftKind.FALSE):
            return kind == ThriftKind.TRUE
        if kind in (ThriftKind.BYTE, ThriftKind.DOUBLE):
            return self.take(1 if kind == ThriftKind.BYTE else 8)
        if kind == ThriftKind.BINARY:
            return self.take(self.varint())
        if kind in (ThriftKind.LIST, ThriftKind.SET):
            head = self.take(1)[0]
            inner = _inner(head & 15)
            return head & 15, [self.value(inner) for _ in range(self.varint() if head >> 4 == 15 else head >> 4)]
        if kind == ThriftKind.STRUCT:
            return self.struct()
        if not ThriftKind.BYTE < kind < ThriftKind.DOUBLE:
            raise ValueError(f"a value of the unknown kind {kind}")
        number = self.varint()
        return (number >> 1) ^ -(number & 1)


def _plain(kind: int, value: Any) -> Any:
    """A value without the kinds of its parts."""
    if kind == ThriftKind.STRUCT:
        return {field: _plain(*item) for field, item in value.items()}
    return [_plain(value[0], item) for item in value[1]] if kind in (ThriftKind.LIST, ThriftKind.SET) else value


def _inner(kind: int) -> int:
    """The kind of the values in a list, where a truth value is a byte."""
    return ThriftKind.BYTE if kind in (ThriftKind.TRUE, ThriftKind.FALSE) else kind


def _encoded_structure(tree: Mapping[int, tuple[int, Any]]) -> bytes:
    """The bytes of a structure; one in it may be encoded already."""
    parts, before = [], 0
    for field, (kind, value) in sorted(tree.items()):
        step = field - before
        head = bytes([step << 4 | kind]) if 0 < step < 16 else bytes([kind]) + _integer(field)
        parts += [head, _encoded(kind, value)]
        before = field
    return b"".join([*parts, bytes([ThriftKind.STOP])])


def _encoded(kind: int, value: Any) -> bytes:
    if kind == ThriftKind.STRUCT:
        return value if isinstance(value, bytes) else _encoded_structure(value)
    if kind == ThriftKind.BINARY:
        return _varint(len(value)) + bytes(value)
    if kind == ThriftKind.LIST:
        inner, values = value
        count = len(values)
        head = bytes([count << 4 | inner]) if count < 15 else bytes([15 << 4 | inner]) + _varint(count)
        return head + b"".join(_encoded(_inner(inner), item) for item in values)
    if kind in (ThriftKind.TRUE, ThriftKind.FALSE):
        return b""
    return bytes(value) if kind in (ThriftKind.BYTE, ThriftKind.DOUBLE) else _integer(value)


def _integer(value: int) -> bytes:
    return _varint(value << 1 if value >= 0 else (-value << 1) - 1)


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    parts.append(value)
    return bytes(parts)


#: Bytes that a header of a page may have, and by how much old writers count the bytes of a column wrongly.
_HEADER = 1 << 13
_SLACK = 1 << 20


class EncryptedParquet(ValueError):
    """The file, or columns of it, are encrypted."""


def damage(path: Path, columns: Collection[str] | None = None) -> str:
    """Error in the numbers of samples and bytes of these columns (None: all); empty where there is none.

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
            return next((reason for chunk in asked if (reason := _pages(file, size, chunk))), "")
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
    footer: dict[int, Any] = _plain(ThriftKind.STRUCT, CompactReader(file.read(length)).struct())
    if 8 in footer:  # how its columns are encrypted
        raise EncryptedParquet
    return footer


def _pages(file: BinaryIO, size: int, chunk: dict[int, Any]) -> str:
    """Error in the pages of one column of one row group."""
    start = chunk[9] if not chunk.get(11) else min(chunk[9], chunk[11])
    samples = 0
    while samples < chunk[5]:
        if not 0 < start < size:
            return f"a page at byte {start} is not in the file"
        file.seek(start)
        reader = CompactReader(file.read(_HEADER))
        page = _plain(ThriftKind.STRUCT, reader.struct())
        start += reader.at + page[3]
        data = page.get(5) or page.get(8)
        held = (data or page.get(7) or {1: 0})[1]
        limit = chunk[5] - samples if data else page[2]
        if not (page[3] >= 0 and start <= size and 0 <= page[2] <= chunk[6] + _SLACK and 0 <= held <= limit):
            return f"the page before byte {start} claims {held} samples in {page[2]} bytes"
        samples += held if data else 0
    return "" if chunk[5] >= 0 else "a column claims less than no samples"


#: Bytes at the start and at the end of a Parquet file.
MAGIC = b"PAR1"

#: Fields of the footer: samples, row groups; of a row group its number.
_ROWS, _GROUPS, _ORDINAL = 3, 4, 7

#: Fields of a row group that are places in the file: its first byte, and those of a column (1) and its description (3).
_OFFSETS = frozenset({(5,), *((1, field) for field in (2, 4, 6)), *((1, 3, field) for field in (9, 10, 11, 14))})


class RowGroups(NamedTuple):
    """Row groups that are in a file up to the byte `end`, and its footer, None before the first.

    Each group of the footer is encoded once, when it is added, so that a footer costs no more the longer a file grows.
    """

    end: int = len(MAGIC)
    footer: Tree | None = None


def appended(groups: RowGroups, whole: bytes) -> tuple[RowGroups, bytes]:
    """Row groups with those of another whole file behind them, and the bytes to write at ``groups.end``."""
    length = int.from_bytes(whole[-8:-4], "little")
    cut = len(whole) - 8 - length
    new, shift = CompactReader(whole[cut:-8]).struct(), groups.end - len(MAGIC)
    before = [] if groups.footer is None else groups.footer[_GROUPS][1][1]
    kind, (inner, added) = new[_GROUPS]
    moved = [
        _encoded_structure(_moved(ThriftKind.STRUCT, _numbered(group, len(before) + i), shift))
        for i, group in enumerate(added)
    ]
    rows = new[_ROWS][1] + (0 if groups.footer is None else groups.footer[_ROWS][1])
    footer = {**new, _ROWS: (new[_ROWS][0], rows), _GROUPS: (kind, (inner, [*before, *moved]))}
    return RowGroups(shift + cut, footer), whole[len(MAGIC) : cut]


def footer_bytes(groups: RowGroups) -> bytes:
    """Bytes behind the row groups in a whole file."""
    content = _encoded_structure(groups.footer or {})
    return content + len(content).to_bytes(4, "little") + MAGIC


def _numbered(group: Tree, number: int) -> Tree:
    return group if _ORDINAL not in group else {**group, _ORDINAL: (group[_ORDINAL][0], number)}


def _moved(kind: int, value: Any, shift: int, path: tuple[int, ...] = ()) -> Any:
    """A value whose places in the file are moved, at this path of fields of a row group; 0 is none."""
    if kind == ThriftKind.STRUCT:
        return {field: (inner, _moved(inner, item, shift, (*path, field))) for field, (inner, item) in value.items()}
    if kind == ThriftKind.LIST and value[0] == ThriftKind.STRUCT:
        return value[0], [_moved(ThriftKind.STRUCT, item, shift, path) for item in value[1]]
    return value + shift if value and path in _OFFSETS else value
