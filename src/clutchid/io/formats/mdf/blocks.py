"""The blocks of an MDF 4 file, walked and checked before a library follows their links.

asammdf trusts links and lengths: a circle of blocks never ends, a wrong length asks for memory that nobody has. So
every link that it will follow is followed here first, and nothing is believed that the size of the file contradicts.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

#: Bytes of the head of a block: name, reserved, length, number of links.
HEAD = 24

#: A deflated block grows at most by this factor.
GROWTH = 1032

#: The largest block, unpacked, that is accepted; the standard asks for 4 MB.
LARGEST = 1 << 28

# flags of a channel group
VLSD = 1
BUS_EVENT = 2
_REMOTE_MASTER = 8
_DEEPEST = 12

_PLAIN = (b"##DT", b"##SD", b"##RD", b"##DV", b"##DI", b"##RV", b"##RI")
_LISTS = (b"##DL", b"##LD")


class Spoiled(ValueError):
    """A file that contradicts itself; the text is the end of the sentence ``FILE: ...``."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block of the file: where it stands, its name, length, links and the address of what follows the links."""

    address: int
    name: bytes
    length: int
    links: tuple[int, ...]

    @property
    def body(self) -> int:
        """Address of the first byte behind the links."""
        return self.address + HEAD + 8 * len(self.links)

    def link(self, number: int) -> int:
        """The link `number`, 0 where the block has not so many."""
        return self.links[number] if number < len(self.links) else 0


@dataclass(frozen=True, slots=True)
class ChannelGroup:
    """What the walk keeps of a channel group."""

    flags: int
    cycles: int


@dataclass(slots=True)
class Walk:
    """A walk over the blocks of the bytes `data`; `seen` are the blocks that may stand in one chain only."""

    data: bytearray | memoryview | mmap.mmap
    size: int
    seen: set[int] = field(default_factory=set)
    checked: set[int] = field(default_factory=set)

    def block(self, address: int, *names: bytes) -> Block:
        """The block at `address`, which must be one of `names` (none given: any).

        Raises
        ------
        Spoiled
            If it is none, or reaches beyond the end of the file.
        """
        if address + HEAD > self.size:
            raise Spoiled(f"is cut off: byte {address + HEAD} is needed, the file ends at {self.size}; copy it again.")
        name, _, length, count = struct.unpack_from("<4sIQQ", self.data, address)
        if (names and name not in names) or name[:2] != b"##":
            wanted = " or ".join(text.decode() for text in names) or "a block"
            raise Spoiled(f"is damaged: {wanted} should stand at byte {address}, {name!r} does; copy it again.")
        if address + length > self.size:
            end = address + length
            raise Spoiled(f"is cut off: its block {name.decode()} ends at byte {end}, the file at {self.size}; "
                          "copy it again.")  # fmt: skip
        if HEAD + 8 * count > length:
            raise Spoiled(f"is damaged: the block {name.decode()} at byte {address} is too short; copy it again.")
        return Block(address, name, length, struct.unpack_from(f"<{count}Q", self.data, address + HEAD))

    def once(self, address: int, *names: bytes) -> Block:
        """The block at `address`, which no other chain has passed.

        Raises
        ------
        Spoiled
            If it was passed before, and as `block` does.
        """
        if address in self.seen:
            raise Spoiled(f"is damaged: its blocks run in a circle at byte {address}; copy it again.")
        self.seen.add(address)
        return self.block(address, *names)

    def chain(self, address: int, *names: bytes) -> Iterator[Block]:
        """The blocks from `address` on, each linked by the first link of the one before.

        Raises
        ------
        Spoiled
            If one is met twice, and as `block` does.
        """
        while address:
            block = self.once(address, *names)
            yield block
            address = block.link(0)

    def read(self, block: Block, layout: str) -> tuple[int, ...]:
        """The numbers behind the links of `block`.

        Raises
        ------
        Spoiled
            If the block is too short for them.
        """
        if block.body + struct.calcsize(layout) > block.address + block.length:
            raise Spoiled(
                f"is damaged: the block {block.name.decode()} at byte {block.address} is too short; copy it again."
            )
        return struct.unpack_from(layout, self.data, block.body)

    def text(self, address: int) -> str:
        """The text of the block at `address`; empty where there is none.

        Raises
        ------
        Spoiled
            As `block` does.
        """
        if not address:
            return ""
        block = self.block(address, b"##TX", b"##MD")
        return bytes(self.data[block.body : block.address + block.length]).partition(b"\0")[0].decode(errors="replace")


def survey(walk: Walk) -> tuple[ChannelGroup, ...]:
    """The channel groups of a file whose blocks are all sound.

    Raises
    ------
    Spoiled
        If a block reaches beyond the file, blocks run in a circle, or a group claims more samples than the file holds.
    """
    header = walk.block(64, b"##HD")
    walk.text(header.link(5))
    for number, name in ((1, b"##FH"), (3, b"##AT"), (4, b"##EV")):
        for block in walk.chain(header.link(number), name):
            _aside(walk, block.links[1:])
    groups: list[ChannelGroup] = []
    for data_group in walk.chain(header.link(0), b"##DG"):
        groups += _data_group(walk, data_group)
    return tuple(groups)


def data_size(walk: Walk, address: int) -> int:
    """Bytes of the records that start at `address`, unpacked.

    Raises
    ------
    Spoiled
        If a list of blocks runs in a circle or a packed block claims more than it can hold.
    """
    if not address:
        return 0
    block = walk.once(address)
    if block.name in _PLAIN:
        return block.length - HEAD
    if block.name == b"##DZ":
        return _unpacked(walk, block)
    if block.name == b"##HL":
        return data_size(walk, block.link(0))
    if block.name not in _LISTS:
        raise Spoiled(f"is damaged: data should stand at byte {address}, {block.name!r} does; copy it again.")
    walk.seen.discard(address)
    total = 0
    for part in walk.chain(address, block.name):
        for link in filter(None, part.links[1:]):
            leaf = walk.once(link, *_PLAIN, b"##DZ")
            total += _unpacked(walk, leaf) if leaf.name == b"##DZ" else leaf.length - HEAD
    return total


def _unpacked(walk: Walk, block: Block) -> int:
    _, _, _, columns, original, packed = walk.read(block, "<2sBBIQQ")
    fits = block.body + HEAD + packed <= block.address + block.length and columns <= max(original, 1)
    if not fits or original > min(LARGEST, GROWTH * (packed + 1)):
        raise Spoiled(f"is damaged: the packed block at byte {block.address} claims {original} bytes; copy it again.")
    return original


def _data_group(walk: Walk, data_group: Block) -> list[ChannelGroup]:
    id_size = walk.read(data_group, "<B")[0]
    _aside(walk, data_group.links[3:])
    groups: list[ChannelGroup] = []
    claimed = 0
    for group in walk.chain(data_group.link(1), b"##CG"):
        _, cycles, flags, _, _, bytes_, invalid = walk.read(group, "<QQHHIII")
        _aside(walk, group.links[2:4] + group.links[5:6])
        _channels(walk, group.link(1), 0)
        groups.append(ChannelGroup(flags, cycles))
        if not flags & VLSD:
            claimed += cycles * (bytes_ + id_size + (0 if flags & _REMOTE_MASTER else invalid))
    total = data_size(walk, data_group.link(2))
    if claimed > total:
        raise Spoiled(f"is damaged: its groups claim {claimed} bytes of samples where {total} stand; copy it again.")
    return groups


def _channels(walk: Walk, address: int, depth: int) -> None:
    if depth > _DEEPEST:
        raise Spoiled(f"is damaged: its channels are nested more than {_DEEPEST} deep; copy it again.")
    for channel in walk.chain(address, b"##CN"):
        walk.read(channel, "<BBBBIIIIB")
        _aside(walk, channel.links[2:5] + channel.links[6:8])
        inner = channel.link(1)
        while inner and walk.block(inner).name == b"##CA":
            inner = walk.once(inner).link(0)
        _channels(walk, inner, depth + 1)
        target = channel.link(5)
        if target and target not in walk.seen and walk.block(target).name in (*_PLAIN, *_LISTS, b"##DZ", b"##HL"):
            data_size(walk, target)


def _aside(walk: Walk, links: Sequence[int], depth: int = 0) -> None:
    """Texts, sources and conversions, which many blocks may share."""
    for link in links:
        if not link or link in walk.checked:
            continue
        block = walk.block(link)
        if depth > _DEEPEST:
            raise Spoiled(f"is damaged: its conversions are nested more than {_DEEPEST} deep; copy it again.")
        walk.checked.add(link)
        if block.name in (b"##CC", b"##SI"):
            _aside(walk, block.links, depth + 1)
