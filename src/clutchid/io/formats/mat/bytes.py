"""The variables of a MATLAB 5 to 7 file as runs of bytes, those of version 7 inflated one by one.

Nothing is allocated by a number in the file before it is held against the bytes that are there, and a compressed
variable is never inflated beyond the size that it declares. `scipy.io.loadmat` does neither.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

from clutchid.io.formats.mat.tree import BEST_RATIO, BrokenMat

#: Bytes that all compressed variables of a file may have together once inflated.
LARGEST = 2_000_000_000

HEADER = 128

#: Kinds of elements that a variable may be.
MATRIX, COMPRESSED = 14, 15

_CHUNK = 1 << 20

#: Gives so many bytes from an offset on, or fewer where they end.
Cut = Callable[[int, int], bytes | memoryview]


@dataclass(frozen=True, slots=True)
class Element:
    """A variable in the file: the first of its bytes, their count, and (0: not compressed) their count inflated."""

    start: int
    size: int
    inflated: int = 0


def byte_order(file: BinaryIO) -> str:
    """``<`` or ``>``, as the header of the file says.

    Raises
    ------
    BrokenMat
        If it has no such header.
    """
    header = file.read(HEADER)
    if len(header) < HEADER or header[126:] not in (b"IM", b"MI"):
        raise BrokenMat("is no MATLAB 5 file: its header is damaged; copy or save it again.")
    return "<" if header[126:] == b"IM" else ">"


def elements(file: BinaryIO, order: str) -> Iterator[Element]:
    """The variables, one after the other.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file, or would take more than `LARGEST` bytes inflated.
    """
    size, at, inflated = os.fstat(file.fileno()).st_size, HEADER, 0
    while at < size:
        file.seek(at)
        head = file.read(8)
        kind, length = struct.unpack(order + "II", head) if len(head) == 8 else (0, 8)
        end = at + 8 + length
        if end > size:
            raise BrokenMat(
                f"is cut off: a variable goes to byte {end:,}, but the file ends at {size:,}; copy it again."
            )
        if kind not in (MATRIX, COMPRESSED):
            raise BrokenMat(f"is damaged at byte {at:,}: there is no variable where one should begin; save it again.")
        if kind == COMPRESSED:
            element = Element(at + 8, length, _declared(file.read(min(length, 1024)), length, order))
            inflated += element.inflated
            if inflated > LARGEST:
                limit = f"{LARGEST / 1e9:g} GB"
                raise BrokenMat(
                    f"holds more than {limit} once inflated; save it with '-v7.3', which is read piece by piece."
                )
            yield element
        else:
            yield Element(at, length + 8)
        at = end


def _declared(start: bytes, length: int, order: str) -> int:
    """The size that a compressed variable says it has once inflated, from its first bytes."""
    try:
        head = zlib.decompressobj().decompress(start, 8)
    except zlib.error:
        head = b""
    kind, size = struct.unpack(order + "II", head) if len(head) == 8 else (0, 0)
    if kind != MATRIX or size > BEST_RATIO * length:
        raise BrokenMat("is damaged: a compressed variable cannot be inflated; save it again.")
    return int(size) + 8


def bytes_of(file: BinaryIO, element: Element) -> Cut:
    """What gives bytes of a variable: from the file, or from all of it inflated.

    Raises
    ------
    BrokenMat
        If it cannot be inflated.
    """
    if not element.inflated:

        def from_file(offset: int, size: int) -> bytes:
            file.seek(element.start + offset)
            return file.read(size)

        return from_file
    whole = memoryview(_inflated(file, element))
    return lambda offset, size: whole[offset : offset + size]


def _inflated(file: BinaryIO, element: Element) -> bytearray:
    """A compressed variable inflated, whose checksum is right."""
    inflate, whole, left = zlib.decompressobj(), bytearray(), element.size
    file.seek(element.start)
    try:
        while not inflate.eof and len(whole) <= element.inflated:
            more = file.read(min(left, _CHUNK))
            left -= len(more)
            if not more and not inflate.unconsumed_tail:
                break
            whole += inflate.decompress(inflate.unconsumed_tail + more, element.inflated + 1 - len(whole))
    except zlib.error:
        whole.clear()
    if len(whole) != element.inflated or not inflate.eof:
        raise BrokenMat("is damaged: the checksum of a compressed variable is wrong; copy or save it again.")
    return whole
