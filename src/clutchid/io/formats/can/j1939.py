"""SAE J1939: what a 29-bit identifier says, and which numbers are none."""

from __future__ import annotations

#: Address that means "all", and the one that DBC files write where any sender is meant.
EVERYBODY, ANYBODY = 0xFF, 0xFE

#: Groups of the transport protocols: pieces of longer messages and the talk about them.
TRANSPORT = frozenset({0xEB00, 0xEC00, 0xC700, 0xC800})

_FIRST_BROADCAST = 240


def group_number(identifier: int) -> int:
    """The parameter group number (PGN) of an identifier; its destination, where it has one, is no part of it.

    Examples
    --------
    EEC1 is a broadcast; TSC1 here goes to the engine:

    >>> group_number(0x0CF00400), group_number(0x0C00000B)
    (61444, 0)
    """
    number = identifier >> 8 & 0x3FFFF
    return number if number >> 8 & 0xFF >= _FIRST_BROADCAST else number & 0x3FF00


def addresses(identifier: int) -> tuple[int, int]:
    """Source and destination address of an identifier; the destination of a broadcast is `EVERYBODY`.

    Examples
    --------
    >>> addresses(0x0CF00400), addresses(0x0C00000B)
    ((0, 255), (11, 0))
    """
    broadcast = identifier >> 16 & 0xFF >= _FIRST_BROADCAST
    return identifier & 0xFF, EVERYBODY if broadcast else identifier >> 8 & 0xFF


def first_code(length: int) -> int | None:
    """The first raw number of `length` bits that means "error" or, higher up, "not available", by SAE J1939-71.

    From 8 bits on the highest byte tells: 0xFE error, 0xFF not available. Below, the highest two numbers do.

    Examples
    --------
    >>> [hex(first_code(bits)) for bits in (2, 4, 8, 16, 32)]
    ['0x2', '0xe', '0xfe', '0xfe00', '0xfe000000']
    """
    if not 2 <= length <= 32:
        return None
    return (1 << length) - 2 if length < 8 else 0xFE << (length - 8)
