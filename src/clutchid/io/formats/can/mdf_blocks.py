"""Blocks of an MDF 4 file, each checked against the size of the file before it is read.

asammdf reads these files too, but its compiled parts end the whole process on some damaged ones, as bus loggers leave
them when they lose their supply.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from clutchid.errors import DataError

#: Where the header block stands, and how many bytes the head of a block has.
HEADER, _HEAD = 64, 24

_MAGIC = struct.Struct("<8s8s8s4xH30xHH")
_UNFINISHED = b"UnFinMF "
_UPDATE_LAST_DT = 0x4

_LONGEST = 1 << 20
_CHUNK = 1 << 20
_PACKED = struct.Struct("<2sBxLQQ")

#: Bytes of one packed block, unpacked; the standard allows 4 MiB.
_LARGEST = 1 << 26


@dataclass(frozen=True, slots=True)
class Block:
    """A block that describes something: its links to others, and its data."""

    address: int
    kind: bytes
    links: tuple[int, ...]
    data: bytes

    def link(self, index: int) -> int:
        """Where the link `index` leads; 0: nowhere."""
        return self.links[index] if index < len(self.links) else 0

    def unpack(self, form: str) -> tuple[int, ...]:
        """The first numbers in the data.

        Raises
        ------
        DataError
            If the block is too short for them.
        """
        size = struct.calcsize(form)
        if len(self.data) < size:
            raise damaged(self.address, f"a block {self.kind.decode('latin-1')} that is too short")
        return struct.unpack(form, self.data[:size])


def damaged(address: int, reason: str) -> DataError:
    """The error about a damaged file."""
    return DataError(f"is damaged at byte {address:,} ({reason})")


class Blocks:
    """The blocks of an open MDF 4 file, by their addresses."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, 2)
        file.seek(0)
        head = file.read(HEADER)
        if len(head) < HEADER:
            raise DataError("is no complete MDF file: its head is cut off")
        magic, version, _, _, flags, _ = _MAGIC.unpack(head)
        self.version = version.decode("latin-1").strip("\0 ")
        self._open_end = magic == _UNFINISHED and bool(flags & _UPDATE_LAST_DT)

    def read(self, address: int, kind: bytes = b"") -> Block:
        """The block at `address`, which must be of this `kind`.

        Raises
        ------
        DataError
            If it is none, or does not lie inside the file.
        """
        found, length, count = self._head(address)
        if kind and found != kind:
            raise damaged(address, f"no block {kind.decode()}")
        if length > self._size - address or count > (length - _HEAD) // 8 or count * 8 > _LONGEST:
            raise damaged(address, "a block that is longer than the file")
        body = self._file.read(min(length - _HEAD, count * 8 + _LONGEST))
        links = struct.unpack(f"<{count}Q", body[: 8 * count])
        return Block(address, found, links, body[8 * count :])

    def chain(self, address: int, kind: bytes) -> Iterator[Block]:
        """The blocks that follow each other from `address` on.

        Raises
        ------
        DataError
            If one of them is damaged, or the chain leads back.
        """
        seen: set[int] = set()
        while address:
            if address in seen:
                raise damaged(address, "a chain of blocks without end")
            seen.add(address)
            block = self.read(address, kind)
            yield block
            address = block.link(0)

    def text(self, address: int) -> str:
        """The text of a TX or MD block; empty where there is none."""
        if not address:
            return ""
        return self.read(address).data.partition(b"\0")[0].decode("utf-8", errors="replace")

    def data(self, address: int) -> Iterator[bytes]:
        """The bytes of a data block, or of a list of them, in pieces.

        Raises
        ------
        DataError
            If a block is damaged, after the pieces before it were given.
        """
        for place in self._places(address, set()):
            kind, length, _ = self._head(place)
            if kind == b"##DZ":
                found = self._unpacked(place)
                yield from (found[first : first + _CHUNK] for first in range(0, len(found), _CHUNK))
                continue
            if kind not in {b"##DT", b"##SD", b"##RD"}:
                raise damaged(place, f"data in blocks {kind.decode('latin-1')!r}, which are not known here")
            rest = self._size - place - _HEAD
            if length - _HEAD > rest or (self._open_end and length <= _HEAD):
                length, cut = rest + _HEAD, not self._open_end
            else:
                cut = False
            yield from self._plain(place + _HEAD, length - _HEAD)
            if cut:
                raise DataError("is cut off in its last block of data")

    def _places(self, address: int, seen: set[int]) -> Iterator[int]:
        """Addresses of the data blocks in their order."""
        if not address:
            return
        kind = self._head(address)[0]
        if kind == b"##HL":
            yield from self._places(self.read(address).link(0), seen)
        elif kind == b"##DL":
            for block in self.chain(address, b"##DL"):
                for link in block.links[1:]:
                    if link in seen:
                        raise damaged(link, "a block of data that is listed twice")
                    if link:
                        seen.add(link)
                        yield link
        else:
            yield address

    def _head(self, address: int) -> tuple[bytes, int, int]:
        if not HEADER <= address <= self._size - _HEAD:
            raise damaged(min(address, self._size), "a link that leads out of the file")
        self._file.seek(address)
        kind, length, count = struct.unpack("<4s4xQQ", self._file.read(_HEAD))
        if not kind.startswith(b"##") or (length < _HEAD and not (self._open_end and kind == b"##DT")):
            raise damaged(address, "no block where one must start")
        return kind, length, count

    def _plain(self, address: int, length: int) -> Iterator[bytes]:
        while length > 0:
            self._file.seek(address)
            piece = self._file.read(min(length, _CHUNK))
            if not piece:
                return
            yield piece
            address += len(piece)
            length -= len(piece)

    def _unpacked(self, address: int) -> bytes:
        head = self._file.read(_PACKED.size)
        if len(head) < _PACKED.size:
            raise damaged(address, "a packed block that is cut off")
        _, method, columns, size, packed = _PACKED.unpack(head)
        if method > 1:
            raise damaged(address, f"data packed by a method that is not known here, {method}")
        if size > _LARGEST or packed > self._size - address:
            raise damaged(address, "a packed block that is longer than the file")
        try:
            found = zlib.decompressobj().decompress(self._file.read(packed), max(size, 1))
        except zlib.error as error:
            raise damaged(address, "a packed block that cannot be unpacked") from error
        if len(found) != size:
            raise damaged(address, "a packed block that is not complete")
        if method == 0 or columns == 0:
            return found
        whole = size // columns * columns
        turned = np.frombuffer(found[:whole], dtype=np.uint8).reshape(columns, -1).T
        return turned.tobytes() + found[whole:]
