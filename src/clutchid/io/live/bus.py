"""A CAN bus through python-can: its name on the command line, and the frames that arrive on it."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from clutchid.errors import DataError
from clutchid.io.formats.can.frames import Frames, check_python_can, in_blocks, quiet
from clutchid.io.live.feed import PACE, PATIENCE

if TYPE_CHECKING:
    import can

#: Frames that wait at most: those that arrive while the ones before them are looked at. More stay with the bus.
MOST_WAITING = 1 << 17

_PREFIX = "can:"

Stopped = Callable[[], bool]


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


@contextmanager
def opened_bus(name: BusName) -> Iterator[can.BusABC]:
    """The bus, open; bit rates and the like are those of python-can's own configuration.

    Raises
    ------
    DataError
        If it cannot be opened.
    MissingExtra
        If python-can is not installed.
    """
    check_python_can("a CAN bus")
    import can

    try:
        with quiet("can"):
            bus = can.Bus(channel=name.channel, interface=name.interface)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise DataError(
            f"{name}: cannot be opened ({_reason(error)}); name a bus as can:CHANNEL for SocketCAN, such as can:can0, "
            "or as can:INTERFACE:CHANNEL, such as can:pcan:PCAN_USBBUS1."
        ) from error
    try:
        yield bus
    finally:
        bus.shutdown()


@contextmanager
def sender(name: BusName) -> Iterator[Callable[[int, bytes], str]]:
    """Function that sends a payload under an identifier of 11 bits; it returns why the bus did not take it, if so.

    Raises
    ------
    DataError
        If the bus cannot be opened.
    MissingExtra
        If python-can is not installed.
    """
    with opened_bus(name) as bus:
        import can

        def send(identifier: int, payload: bytes) -> str:
            try:
                bus.send(can.Message(arbitration_id=identifier, data=payload, is_extended_id=False))
            except (can.CanError, OSError) as error:
                return _reason(error)
            return ""

        yield send


def from_bus(name: BusName, stopped: Stopped) -> Iterator[Frames]:
    """Frames of a bus as they arrive, until it is stopped and those that came before were given.

    A thread of its own takes them from the bus, so that none is lost while those before are looked at.

    Raises
    ------
    DataError
        If it cannot be opened, or fails; the frames before were given then.
    MissingExtra
        If python-can is not installed.
    """
    with opened_bus(name) as bus:
        waiting: deque[can.Message] = deque()
        failures: list[Exception] = []
        closing = threading.Event()
        reader = threading.Thread(target=_read, args=(bus, waiting, failures, stopped, closing), daemon=True)
        reader.start()
        try:
            left_out: Counter[str] = Counter()
            while reader.is_alive() or waiting:
                yield from in_blocks([waiting.popleft() for _ in range(len(waiting))], left_out)
                if not waiting:
                    reader.join(PACE)
        finally:
            closing.set()
            reader.join()
    if failures:
        raise DataError(f"{name}: failed ({_reason(failures[0])}).") from failures[0]


def _read(
    bus: can.BusABC,
    waiting: deque[can.Message],
    failures: list[Exception],
    stopped: Stopped,
    closing: threading.Event,
) -> None:
    """Take messages from a bus until it is stopped, and then those that it has received already."""
    import can

    try:
        while not closing.is_set():
            if len(waiting) >= MOST_WAITING:
                time.sleep(PACE)
                continue
            ending = stopped()
            message = bus.recv(0.0 if ending else PATIENCE)
            if message is not None:
                waiting.append(message)
            elif ending:
                return
    except (can.CanError, OSError, ValueError) as error:
        failures.append(error)


def _reason(error: Exception) -> str:
    return " ".join((getattr(error, "strerror", "") or str(error) or type(error).__name__).split()).rstrip(".")
