"""SAE J1939: parts of a 29-bit identifier, numbers that are none, and parameters of the air supply and the weather."""

from __future__ import annotations

import re
from typing import NamedTuple

#: Address that means "all", and the one that DBC files write where any sender is meant.
EVERYBODY, ANYBODY = 0xFF, 0xFE

#: Groups of the transport protocols: pieces of longer messages and the talk about them.
TRANSPORT = frozenset({0xEB00, 0xEC00, 0xC700, 0xC800})

_FIRST_BROADCAST = 240

#: What a comment begins with that names a parameter of the standard, and a mention of its number.
_MARK = "SAE J1939 "
_MARKED = re.compile(rf"{_MARK}\w+: (?P<title>[^(;]+)")
_MENTIONED = re.compile(r"\bSPN[\s_:=#]*(?P<number>\d{1,6})\b", re.IGNORECASE)


class Parameter(NamedTuple):
    """A parameter of SAE J1939-71: group, first bit and length in it, scale and offset, number (SPN), title.

    Pressures are in kPa, temperatures in degC. A pressure is a gauge pressure unless it is `absolute`.
    """

    group: int
    acronym: str
    begin: int
    length: int
    scale: float
    offset: float
    number: int | None
    title: str
    absolute: bool = False

    @property
    def comment(self) -> str:
        """Text that identifies it in the comment on a channel."""
        return f"{_MARK}{self.acronym}: {self.title}" + (f" (SPN {self.number})" if self.number else "")


_AIR, _WEATHER = (65198, "AIR1"), (65269, "AMB")
_CELSIUS = (0.03125, -273.0)

#: Air supply pressure and ambient conditions, each sent once a second. The number of the powertrain circuit is missing:
#: public databases agree on its place, and none of them has it.
PARAMETERS = (
    Parameter(*_AIR, 0, 8, 8.0, 0.0, 46, "pneumatic supply pressure"),
    Parameter(*_AIR, 8, 8, 8.0, 0.0, 1086, "parking and trailer air pressure"),
    Parameter(*_AIR, 16, 8, 8.0, 0.0, 1087, "service brake circuit 1 air pressure"),
    Parameter(*_AIR, 24, 8, 8.0, 0.0, 1088, "service brake circuit 2 air pressure"),
    Parameter(*_AIR, 32, 8, 8.0, 0.0, 1089, "auxiliary equipment supply pressure"),
    Parameter(*_AIR, 40, 8, 8.0, 0.0, 1090, "air suspension supply pressure"),
    Parameter(*_AIR, 56, 8, 8.0, 0.0, None, "powertrain circuit air supply pressure"),
    Parameter(*_WEATHER, 0, 8, 0.5, 0.0, 108, "barometric pressure", absolute=True),
    Parameter(*_WEATHER, 8, 16, *_CELSIUS, 170, "cab interior temperature"),
    Parameter(*_WEATHER, 24, 16, *_CELSIUS, 171, "ambient air temperature"),
    Parameter(*_WEATHER, 40, 8, 1.0, -40.0, 172, "engine air intake temperature"),
    Parameter(*_WEATHER, 48, 16, *_CELSIUS, 79, "road surface temperature"),
)

_BY_PLACE = {
    (parameter.group, parameter.begin, parameter.length, parameter.scale, parameter.offset): parameter
    for parameter in PARAMETERS
}
_BY_NUMBER = {parameter.number: parameter for parameter in PARAMETERS if parameter.number}
_BY_TITLE = {parameter.title: parameter for parameter in PARAMETERS}


def parameter_at(group: int, begin: int, length: int, scale: float, offset: float) -> Parameter | None:
    """The parameter at a place of a group, if it has the scale and the offset of the standard.

    Examples
    --------
    >>> parameter_at(65269, 24, 16, 0.03125, -273.0).title, parameter_at(65269, 24, 16, 1.0, 0.0)
    ('ambient air temperature', None)
    """
    return _BY_PLACE.get((group, begin, length, scale, offset))


def parameter_in(text: str) -> Parameter | None:
    """The parameter that a comment or the name of a channel identifies, by our own mark or by its number.

    Examples
    --------
    >>> parameter_in("Luftdruck Kreis 4, SPN 1089").title, parameter_in("see SPN 4711")
    ('auxiliary equipment supply pressure', None)
    """
    if marked := _MARKED.search(text):
        return _BY_TITLE.get(marked["title"].strip())
    mentioned = _MENTIONED.search(text)
    return _BY_NUMBER.get(int(mentioned["number"])) if mentioned else None


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

    From 8 bits on the highest byte is 0xFE for an error, 0xFF for not available; below, the highest two numbers are.

    Examples
    --------
    >>> [hex(first_code(bits)) for bits in (2, 4, 8, 16, 32)]
    ['0x2', '0xe', '0xfe', '0xfe00', '0xfe000000']
    """
    if not 2 <= length <= 32:
        return None
    return (1 << length) - 2 if length < 8 else 0xFE << (length - 8)
