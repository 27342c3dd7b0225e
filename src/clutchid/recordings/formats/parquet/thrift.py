"""Values in the compact protocol of Thrift, in which the footer and the page headers of a Parquet file are written.

A structure keeps the kinds of its fields, so that what is not understood is written again as it was read.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

#: A structure: (kind, value) by the number of the field; of a list the value is (kind, values).
Tree = dict[int, tuple[int, Any]]


class Kind(IntEnum):
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


class Compact:
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
        while (head := self.take(1)[0]) != Kind.STOP:
            field = field + (head >> 4) if head >> 4 else self.value(Kind.I16)
            fields[field] = (head & 15, self.value(head & 15))
        return fields

    def value(self, kind: int) -> Any:
        """The next value, which is of a `Kind`."""
        if kind in (Kind.TRUE, Kind.FALSE):
            return kind == Kind.TRUE
        if kind in (Kind.BYTE, Kind.DOUBLE):
            return self.take(1 if kind == Kind.BYTE else 8)
        if kind == Kind.BINARY:
            return self.take(self.varint())
        if kind in (Kind.LIST, Kind.SET):
            head = self.take(1)[0]
            inner = _inner(head & 15)
            return head & 15, [self.value(inner) for _ in range(self.varint() if head >> 4 == 15 else head >> 4)]
        if kind == Kind.STRUCT:
            return self.struct()
        if not Kind.BYTE < kind < Kind.DOUBLE:
            raise ValueError(f"a value of the unknown kind {kind}")
        number = self.varint()
        return (number >> 1) ^ -(number & 1)


def plain(kind: int, value: Any) -> Any:
    """A value without the kinds of what is in it."""
    if kind == Kind.STRUCT:
        return {field: plain(*each) for field, each in value.items()}
    return [plain(value[0], each) for each in value[1]] if kind in (Kind.LIST, Kind.SET) else value


def _inner(kind: int) -> int:
    """The kind of the values in a list, where a truth value is a byte."""
    return Kind.BYTE if kind in (Kind.TRUE, Kind.FALSE) else kind


def encoded(tree: Mapping[int, tuple[int, Any]]) -> bytes:
    """The bytes of a structure; one in it may be encoded already."""
    parts, before = [], 0
    for field, (kind, value) in sorted(tree.items()):
        step = field - before
        head = bytes([step << 4 | kind]) if 0 < step < 16 else bytes([kind]) + _integer(field)
        parts += [head, _encoded(kind, value)]
        before = field
    return b"".join([*parts, bytes([Kind.STOP])])


def _encoded(kind: int, value: Any) -> bytes:
    if kind == Kind.STRUCT:
        return value if isinstance(value, bytes) else encoded(value)
    if kind == Kind.BINARY:
        return _varint(len(value)) + bytes(value)
    if kind == Kind.LIST:
        inner, values = value
        count = len(values)
        head = bytes([count << 4 | inner]) if count < 15 else bytes([15 << 4 | inner]) + _varint(count)
        return head + b"".join(_encoded(_inner(inner), one) for one in values)
    if kind in (Kind.TRUE, Kind.FALSE):
        return b""
    return bytes(value) if kind in (Kind.BYTE, Kind.DOUBLE) else _integer(value)


def _integer(value: int) -> bytes:
    return _varint(value << 1 if value >= 0 else (-value << 1) - 1)


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    parts.append(value)
    return bytes(parts)
