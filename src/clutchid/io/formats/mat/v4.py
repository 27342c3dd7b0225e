"""MATLAB 4 files: one matrix after the other, each behind a header of five integers and its name."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clutchid.io.formats.mat.tree import COMPLEX, SPARSE, BrokenMat, Node, Numbers, ReadSamples, Struct, Text, counted
from clutchid.io.formats.mat.v5 import samples
from clutchid.log import FloatArray

HEADER = 20

_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_FULL, _TEXT, _SPARSE = range(3)
_LONGEST_NAME = 256


@dataclass(frozen=True, slots=True)
class Place:
    """Where a matrix stands: its first byte, and the type of its numbers."""

    start: int
    dtype: str


@dataclass(frozen=True, slots=True)
class _Header:
    dtype: str
    kind: int
    shape: tuple[int, int]
    is_complex: bool
    name_size: int

    @property
    def size(self) -> int:
        return self.shape[0] * self.shape[1] * np.dtype(self.dtype).itemsize * (2 if self.is_complex else 1)


def is_v4(head: bytes) -> bool:
    """Whether a file that begins so is one of MATLAB 4, which has no signature."""
    header = _header(head[:HEADER])
    return header is not None and len(head) > HEADER and head[HEADER : HEADER + 1].isalpha()


def contents(path: Path) -> Struct:
    """The matrices of the file, by name.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file.
    OSError
        If it cannot be read.
    """
    fields: dict[str, Node] = {}
    with path.open("rb") as file:
        size, at = os.fstat(file.fileno()).st_size, 0
        while at < size:
            file.seek(at)
            header = _header(file.read(HEADER))
            if header is None:
                raise BrokenMat(f"is damaged at byte {at:,}: there is no matrix where one should begin; save it again.")
            name = file.read(header.name_size).partition(b"\0")[0].decode("latin-1")
            start = at + HEADER + header.name_size
            at = start + header.size
            if at > size:
                raise BrokenMat(
                    f"is cut off: '{name}' goes to byte {at:,}, but the file ends at {size:,}; copy it again."
                )
            counted(len(fields))
            fields[name] = _node(header, start)
    return Struct(fields)


@contextmanager
def opened(path: Path) -> Iterator[ReadSamples]:
    """The file, open for reading samples.

    Raises
    ------
    BrokenMat
        If the file became shorter.
    OSError
        If it cannot be read.
    """
    with path.open("rb") as file:

        def cut(offset: int, size: int) -> bytes:
            file.seek(offset)
            return file.read(size)

        def read(numbers: Numbers, channel: int, start: int, stop: int) -> FloatArray:
            place = numbers.place
            if not isinstance(place, Place):
                return np.empty(0)
            return samples(cut, np.dtype(place.dtype), place.start, numbers, (channel, start, stop))

        yield read


def _header(head: bytes) -> _Header | None:
    """The header of a matrix; None where there is none."""
    for order in "<>":
        if len(head) < HEADER:
            return None
        code, rows, columns, is_complex, name_size = struct.unpack(order + "5i", head)
        thousands, hundreds, tens, kind = (code // 10**place % 10 for place in (3, 2, 1, 0))
        known = thousands == "<>".index(order) and hundreds == 0 and tens < len(_TYPES) and kind <= _SPARSE
        sound = min(rows, columns) >= 0 and is_complex in (0, 1) and 1 < name_size <= _LONGEST_NAME
        if 0 <= code < 2000 and known and sound:
            return _Header(order + _TYPES[tens], kind, (rows, columns), bool(is_complex), name_size)
    return None


def _node(header: _Header, start: int) -> Node:
    if header.kind == _TEXT:
        return Text("")
    if header.kind == _SPARSE:
        return SPARSE
    return COMPLEX if header.is_complex else Numbers(header.shape, Place(start, header.dtype))
