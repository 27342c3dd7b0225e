"""Names of buses, as a command has them; every command asks whether it is given one."""

from __future__ import annotations

from typing import NamedTuple

_PREFIX = "can:"


class BusName(NamedTuple):
    """A bus: python-can's interface, such as ``socketcan`` or ``virtual``, and the channel of it."""

    interface: str
    channel: str

    def __str__(self) -> str:
        return f"{_PREFIX}{self.interface}:{self.channel}"


def bus_name(text: str) -> BusName | None:
    """The bus that ``can:CHANNEL`` (SocketCAN) or ``can:INTERFACE:CHANNEL`` names; None for any other text.

    Examples
    --------
    >>> bus_name("can:can0")
    BusName(interface='socketcan', channel='can0')
    >>> str(bus_name("can:virtual:truck"))
    'can:virtual:truck'
    >>> bus_name("can.csv") is bus_name("can:") is None
    True
    """
    if not text.startswith(_PREFIX):
        return None
    interface, _, channel = text.removeprefix(_PREFIX).rpartition(":")
    return BusName(interface or "socketcan", channel) if channel else None
