"""A CAN bus through python-can: its name on the command line, and the frames that arrive on it."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty, Full, Queue
from typing import TYPE_CHECKING, NamedTuple

from clutchid.errors import DataError
from clutchid.recordings.formats.can.frames import Frames, check_python_can, in_blocks, quiet
from clutchid.recordings.live.feed import PACE, PATIENCE

if TYPE_CHECKING:
    import can

#: Frames that wait at most: those that arrive while the ones before them are looked at. More stay with the bus.
MOST_WAITING = 1 << 17

#: Samples whose frames wait to be sent at most, and time in s for which a bus that sends none is waited for.
MOST_TO_SEND, STALL = 512, 2.0

#: Identifier of 11 bits and bytes of a frame.
Payload = tuple[int, bytes]

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
    bus = _open(name)
    try:
        yield bus
    finally:
        bus.shutdown()


def _open(name: BusName) -> can.BusABC:
    check_python_can("a CAN bus")
    import can

    try:
        with quiet("can"):
            return can.Bus(channel=name.channel, interface=name.interface)
    except (can.CanError, OSError, ValueError, ImportError) as error:
        raise DataError(
            f"{name}: cannot be opened ({_reason(error)}); name a bus as can:CHANNEL for SocketCAN, such as can:can0, "
            "or as can:INTERFACE:CHANNEL, such as can:pcan:PCAN_USBBUS1."
        ) from error


@contextmanager
def sender(name: BusName, stopped: Stopped) -> Iterator[Callable[[Sequence[Payload]], str]]:
    """Function that sends payloads that belong together; it returns why the bus did not take all so far, if so.

    A thread of its own sends them, so that a bus that does not go on holds up nothing: it is waited for `STALL`
    seconds, and then takes no more until it goes on. Once `stopped`, it is waited for only at the end.

    Raises
    ------
    DataError
        If the bus cannot be opened.
    MissingExtra
        If python-can is not installed.
    """
    bus = _open(name)
    waiting: Queue[Sequence[Payload]] = Queue(MOST_TO_SEND)
    reasons: list[str] = []
    closing = threading.Event()
    thread = threading.Thread(target=_send, args=(bus, waiting, reasons, closing), daemon=True)
    thread.start()
    stalled = False

    def send(together: Sequence[Payload]) -> str:
        nonlocal stalled
        until = time.monotonic() + (0.0 if stalled else STALL)
        while True:
            try:
                waiting.put(together, timeout=PATIENCE if not stalled else 1e-4)
            except Full:
                if stopped() or time.monotonic() >= until:
                    stalled = True
                    return f"it took none for {STALL:g} s"
            else:
                stalled = False
                return reasons[0] if reasons else ""

    try:
        yield send
    finally:
        closing.set()
        thread.join(0.0 if stalled else STALL)


def _send(bus: can.BusABC, waiting: Queue[Sequence[Payload]], reasons: list[str], closing: threading.Event) -> None:
    """Send what waits, and then close the bus; the first reason of a frame that it did not take is kept."""
    import can

    while not (closing.is_set() and waiting.empty()):
        with suppress(Empty):
            for identifier, payload in waiting.get(timeout=PACE):
                try:
                    bus.send(can.Message(arbitration_id=identifier, data=payload, is_extended_id=False))
                except (can.CanError, OSError) as error:
                    if not reasons:
                        reasons.append(_reason(error))
    bus.shutdown()


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
