"""The blocks of an MDF 3 file, walked and checked before a library follows their links."""

from __future__ import annotations

import struct

from clutchid.io.formats.mdf.blocks import Spoiled, Walk

#: The largest data block with the records of several groups mixed, which asammdf sorts in memory.
MIXED = 1 << 26

_LEAST = {b"HD": 20, b"DG": 24, b"CG": 26, b"CN": 218, b"CC": 46, b"TX": 4, b"CE": 6, b"CD": 8, b"TR": 10, b"PR": 4}


def survey3(walk: Walk) -> None:
    """Nothing, once the blocks of an MDF 3 file are found sound.

    Raises
    ------
    Spoiled
        If a block reaches beyond the file, blocks run in a circle, or a group claims more samples than the file holds.
    """
    if struct.unpack_from("<H", walk.data, 24)[0]:
        raise Spoiled("is an MDF 3 file in Motorola byte order, which is not read; convert it to MDF 4 first.")
    _block(walk, 64, b"HD")
    _aside(walk, 64 + 8, b"TX")
    _aside(walk, 64 + 12, b"PR")
    address = _link(walk, 64 + 4)
    while address:
        _once(walk, address, b"DG")
        _aside(walk, address + 12, b"TR")
        _groups(walk, address)
        address = _link(walk, address + 4)


def _groups(walk: Walk, data_group: int) -> None:
    count, id_size = struct.unpack_from("<HH", walk.data, data_group + 20)
    group, claimed = _link(walk, data_group + 8), 0
    for _ in range(count):
        _once(walk, group, b"CG")
        _aside(walk, group + 12, b"TX")
        size, cycles = struct.unpack_from("<HI", walk.data, group + 20)
        claimed += (size + id_size) * cycles
        channel = _link(walk, group + 8)
        while channel:
            _once(walk, channel, b"CN")
            _channel(walk, channel)
            channel = _link(walk, channel + 4)
        group = _link(walk, group + 4)
    start = _link(walk, data_group + 16)
    if start + claimed > walk.size:
        raise Spoiled(f"is cut off: its samples end at byte {start + claimed}, the file at {walk.size}; copy it again.")
    if id_size and claimed > MIXED:
        raise Spoiled(f"mixes {claimed >> 20} MB of records of several groups (unsorted); convert it to MDF 4 first.")


def _channel(walk: Walk, address: int) -> None:
    for offset, name in ((8, b"CC"), (12, b"CE"), (16, b"CD"), (20, b"TX")):
        _aside(walk, address + offset, name)
    length = struct.unpack_from("<H", walk.data, address + 2)[0]
    for offset in (218, 222):
        if length >= offset + 4:
            _aside(walk, address + offset, b"TX")


def _aside(walk: Walk, where: int, name: bytes) -> None:
    address = _link(walk, where)
    if address and address not in walk.checked:
        _block(walk, address, name)
        walk.checked.add(address)


def _once(walk: Walk, address: int, name: bytes) -> None:
    if address in walk.seen:
        raise Spoiled(f"is damaged: its blocks run in a circle at byte {address}; copy it again.")
    walk.seen.add(address)
    _block(walk, address, name)


def _block(walk: Walk, address: int, name: bytes) -> None:
    if address + _LEAST[name] > walk.size:
        raise Spoiled(f"is cut off: byte {address + _LEAST[name]} is needed, the file ends at {walk.size}; "
                      "copy it again.")  # fmt: skip
    found, length = struct.unpack_from("<2sH", walk.data, address)
    if found != name or length < _LEAST[name]:
        raise Spoiled(f"is damaged: a block {name.decode()} should stand at byte {address}; copy it again.")
    if address + length > walk.size:
        raise Spoiled(f"is cut off: its block {name.decode()} ends at byte {address + length}, the file at {walk.size};"
                      " copy it again.")  # fmt: skip


def _link(walk: Walk, where: int) -> int:
    return int(struct.unpack_from("<I", walk.data, where)[0])
