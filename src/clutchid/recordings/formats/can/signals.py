"""Signals in the payload of bus frames, unpacked in bulk with NumPy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.recordings.formats.can.frames import Bytes, Counts

Raw = NDArray[np.uint64]

#: Bits of the numbers that IEEE 754 has, and their types.
FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}


@dataclass(frozen=True, slots=True)
class Signal:
    """A number in the payload of a frame: ``scale * raw + offset`` of `length` bits.

    `begin` is the number of its first bit: in the order of Intel its lowest, where bit 0 is the lowest bit of byte 0;
    in the order of Motorola its highest, where bit 0 is the highest bit of byte 0. `codes` is the first raw number that
    means an error or "not available" (None: there is none).
    """

    name: str
    begin: int
    length: int
    motorola: bool = False
    signed: bool = False
    ieee: bool = False
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    comment: str = ""
    codes: int | None = None

    @property
    def bytes(self) -> int:
        """Number of payload bytes that a frame must have to hold it."""
        return (self.begin + self.length - 1) // 8 + 1


@dataclass(frozen=True, eq=False, slots=True)
class Page:
    """Signals that a message holds at the same time, when every selector holds one of its numbers."""

    signals: tuple[Signal, ...]
    selectors: tuple[tuple[Signal, frozenset[int]], ...] = ()

    @property
    def name(self) -> str:
        """The numbers that select it: ``Mode=3``."""
        return " ".join(f"{selector.name}={_spelled(numbers)}" for selector, numbers in self.selectors)


def raw_bits(signal: Signal, data: Bytes) -> Raw:
    """The raw number of a signal in each payload (a row of `data` each), before sign, scale and offset.

    Raises
    ------
    IndexError
        If the payloads have fewer bytes than the signal needs.
    """
    end = signal.begin + signal.length
    first, last = signal.begin // 8, signal.bytes - 1
    if last >= data.shape[1]:
        raise IndexError(f"signal {signal.name} needs {last + 1} bytes, and there are {data.shape[1]}.")
    places = range(last, first - 1, -1) if signal.motorola else range(first, last + 1)  # the lowest byte first
    below = 8 * (last + 1) - end if signal.motorola else signal.begin - 8 * first
    raw = np.zeros(len(data), dtype=np.uint64)
    for order, place in enumerate(places):
        shift = 8 * order - below
        byte = data[:, place].astype(np.uint64)
        raw |= byte << np.uint64(shift) if shift >= 0 else byte >> np.uint64(-shift)
    return raw & np.uint64((1 << signal.length) - 1)


def decode(signal: Signal, data: Bytes, length: Counts) -> FloatArray:
    """The values of a signal in its unit; NaN where the frame is too short or says that there is no value.

    Parameters
    ----------
    signal : Signal
        The signal, of a page that is present in all frames.
    data : uint8, n x 8 or n x 64
        Payloads, a row a frame.
    length : 1
        Number of bytes that each frame has.

    Returns
    -------
    values : the signal's unit
        One a frame; a number of a value table stays a number.

    Examples
    --------
    Engine speed in bytes 4 and 5, an eighth of a revolution per minute a bit; the second frame has none:

    >>> speed = Signal("EngineSpeed", 24, 16, scale=0.125, unit="rpm", codes=0xFE00)
    >>> frames = np.array([[0, 0, 0, 0x20, 0x1C, 0, 0, 0], [0, 0, 0, 0xFF, 0xFF, 0, 0, 0]], dtype=np.uint8)
    >>> decode(speed, frames, np.array([8, 8]))
    array([900.,  nan])
    """
    if signal.bytes > data.shape[1]:
        return np.full(len(data), np.nan)
    raw = raw_bits(signal, data)
    values = _numbers(signal, raw)
    if (signal.scale, signal.offset) != (1.0, 0.0):
        with np.errstate(over="ignore", invalid="ignore"):
            values = values * signal.scale + signal.offset
    missing = length < signal.bytes
    if signal.codes is not None:
        missing |= raw >= np.uint64(signal.codes)
    values[missing] = np.nan
    return values


def _numbers(signal: Signal, raw: Raw) -> FloatArray:
    if signal.ieee:
        unsigned, ieee = FLOATS[signal.length]
        with np.errstate(invalid="ignore"):
            return np.asarray(raw.astype(unsigned).view(ieee).astype(np.float64))
    if signal.signed:
        spare = 64 - signal.length
        return ((raw << np.uint64(spare)).view(np.int64) >> np.int64(spare)).astype(np.float64)
    return raw.astype(np.float64)


def present(page: Page, data: Bytes, length: Counts) -> NDArray[np.bool_]:
    """In which frames a page is present: all of its selectors are in the frame and hold one of their numbers."""
    there = np.ones(len(data), dtype=np.bool_)
    for selector, numbers in page.selectors:
        if selector.bytes > data.shape[1]:
            return np.zeros(len(data), dtype=np.bool_)
        wanted = np.array([n & (1 << selector.length) - 1 for n in numbers], dtype=np.uint64)
        there &= np.isin(raw_bits(selector, data), wanted) & (length >= selector.bytes)
    return there


def _spelled(numbers: frozenset[int]) -> str:
    """Numbers as ranges: ``0-3,7``."""
    starts = sorted(n for n in numbers if n - 1 not in numbers)
    ends = sorted(n for n in numbers if n + 1 not in numbers)
    return ",".join(f"{a}" if a == b else f"{a}-{b}" for a, b in zip(starts, ends, strict=True))
