"""DBC: the meaning of frames, read by cantools, and signals unpacked in bulk.

cantools decodes one message in about 2 µs, so it reads the database only; `decode` unpacks the frames.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, missing
from clutchid.files import small_file
from clutchid.log import FloatArray
from clutchid.measurements.columns import unit_spelled
from clutchid.measurements.formats.can.frames import Bytes, Counts, quiet
from clutchid.measurements.formats.can.j1939 import first_code
from clutchid.measurements.no_value import means_no_value
from clutchid.messages import shortened

if TYPE_CHECKING:
    from cantools.database.can import Database
    from cantools.database.can import Message as CantoolsMessage
    from cantools.database.can import Signal as CantoolsSignal

Raw: TypeAlias = NDArray[np.uint64]

#: Bits of the numbers that IEEE 754 has, and their types.
_FLOATS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}


@dataclass(frozen=True, slots=True)
class Signal:
    """A number in the payload of a frame: ``scale * raw + offset`` of `length` bits.

    `begin` is the number of its first bit: in the order of Intel its lowest, where bit 0 is the lowest bit of byte 0;
    in the order of Motorola its highest, where bit 0 is the highest bit of byte 0. `none` are raw
    numbers that mean an error or "not available", the first and the last of each range.
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
    none: tuple[tuple[int, int], ...] = ()

    @property
    def bytes(self) -> int:
        """Number of payload bytes that a frame must have to hold it."""
        return (self.begin + self.length - 1) // 8 + 1


#: Selectors with the numbers that each may hold.
Condition = tuple[tuple[Signal, frozenset[int]], ...]


@dataclass(frozen=True, eq=False, slots=True)
class SignalGroup:
    """Signals that a message holds at the same time, when every selector holds one of its numbers."""

    signals: tuple[Signal, ...]
    selectors: Condition = ()

    @property
    def name(self) -> str:
        """The numbers that select it: ``Mode=3``."""
        return " ".join(f"{selector.name}={_spelled(numbers)}" for selector, numbers in self.selectors)

    @property
    def bytes(self) -> int:
        """Number of payload bytes that its signals need."""
        return max((signal.bytes for signal in self.signals), default=0)


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
        The signal, of a group that is present in all frames.
    data : uint8, a column a byte
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

    >>> speed = Signal("EngineSpeed", 24, 16, scale=0.125, unit="rpm", none=((0xFE00, 0xFFFF),))
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
    for first, last in signal.none:
        missing |= (raw >= np.uint64(first)) & (raw <= np.uint64(last))
    values[missing] = np.nan
    return values


def _numbers(signal: Signal, raw: Raw) -> FloatArray:
    if signal.ieee:
        unsigned, ieee = _FLOATS[signal.length]
        with np.errstate(invalid="ignore"):
            return np.asarray(raw.astype(unsigned).view(ieee).astype(np.float64))
    if signal.signed:
        spare = 64 - signal.length
        return ((raw << np.uint64(spare)).view(np.int64) >> np.int64(spare)).astype(np.float64)
    return raw.astype(np.float64)


def present(group: SignalGroup, data: Bytes, length: Counts) -> NDArray[np.bool_]:
    """Whether each frame has a signal group: all of its selectors are in the frame and hold one of their numbers."""
    there = np.ones(len(data), dtype=np.bool_)
    for selector, numbers in group.selectors:
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


_LARGEST_FILE = 1 << 26
_MOST_SELECTORS = 1 << 16
_PROTOCOLS = ("J1939", "NMEA2000", "ISO11783")

#: A statement behind the text: cantools says nothing where a text ends in the middle of another one.
_END = '\nCM_ "end";\n'

#: How an ARXML or a KCD file begins, or a SYM file after its remarks.
_OTHER = re.compile(r"\s*<|\s*(?://.*\s+)*FormatVersion=")

#: A start bit beyond this lies in no message; J1939 sends at most 1785 bytes in pieces.
_LAST_BIT = 1 << 14


@dataclass(frozen=True, eq=False, slots=True)
class Message:
    """A message of a database: its frames, and the signal groups in them; one where nothing is multiplexed."""

    name: str
    identifier: int
    extended: bool
    length: int
    j1939: bool
    groups: tuple[SignalGroup, ...]
    undecodable: tuple[str, ...] = ()


def read_dbc(path: Path) -> tuple[Message, ...]:
    """The messages of a DBC file.

    Raises
    ------
    MissingExtra
        If cantools is not installed.
    DataError
        If it cannot be read or is none; the text names the file, and for a DBC the line.
    """
    content = small_file(path, "DBC file", _LARGEST_FILE)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    return messages_in(text, str(path))


def messages_in(text: str, source: str = "DBC") -> tuple[Message, ...]:
    """The messages of the text of a database that is called `source` in errors.

    Raises
    ------
    MissingExtra
        If cantools is not installed.
    DataError
        If it cannot be read; the text names the line of a DBC.
    """
    try:
        from cantools.database import load_string
    except ImportError as error:
        raise missing("reading a DBC", "cantools", "can") from error
    other = "is ARXML, KCD or SYM; convert it to DBC: cantools convert FILE bus.dbc." if _OTHER.match(text) else ""
    if problem := other or _too_many_selectors(text):
        raise DataError(f"{source}: {problem}")
    try:
        with quiet("cantools.database.can.database"):
            database: Any = load_string(text + _END, "dbc", strict=False)
        named = _protocol(database)
        messages = tuple(_message(message, named) for message in database.messages)
    except (Exception, RecursionError) as error:
        raise DataError(f"{source}: {_refusal(str(error) or type(error).__name__, text)}") from error
    if not messages:
        raise DataError(f"{source}: holds no messages; name the DBC of the bus.")
    return messages


def _refusal(reason: str, text: str) -> str:
    match = re.search(r"line (\d+), column (\d+)", reason)
    if match is None:
        return f"cannot be read as DBC ({shortened(reason, 120)}); correct it, or export the DBC again."
    lines = len(text.rstrip().splitlines())
    if int(match[1]) > lines:
        return f"is cut off after line {lines}; export the DBC again."
    return f"line {match[1]}, column {match[2]} cannot be read as DBC; correct it, or export the DBC again."


def _too_many_selectors(text: str) -> str:
    """Problem of ranges of multiplexing with more numbers than can be listed, as cantools does."""
    total = 0
    for statement in re.finditer(r"^[ \t]*SG_MUL_VAL_\s[^;]*;", text, re.MULTILINE):
        for first, last in re.findall(r"\b(\d{1,20})\s*-\s*(\d{1,20})\b", statement[0]):
            total += max(0, int(last) - int(first))
            if total > _MOST_SELECTORS:
                line = text.count("\n", 0, statement.start()) + 1
                return f"line {line}: more than {_MOST_SELECTORS:,} multiplexer numbers are named; narrow their ranges."
    return ""


def _protocol(database: Database) -> bool:
    """Whether the DBC as a whole is said to be J1939, or built on it."""
    specifics = database.dbc
    if specifics is None:
        return False
    attribute = specifics.attributes.get("ProtocolType")
    definition = specifics.attribute_definitions.get("ProtocolType")
    value = attribute.value if attribute is not None else getattr(definition, "default_value", None)
    return str(value).upper().replace(" ", "") in _PROTOCOLS


def _message(message: CantoolsMessage, named: bool) -> Message:
    own = message.dbc.attributes if message.dbc is not None else {}
    by_protocol = named and message.is_extended_frame and "VFrameFormat" not in own
    j1939 = message.protocol == "j1939" or by_protocol
    by_name = {signal.name: signal for signal in message.signals}
    usable = [s for s in message.signals if all(_usable(part) for part in (s, *_above(s, by_name)))]
    return Message(
        message.name,
        message.frame_id & 0x1FFFFFFF,
        bool(message.is_extended_frame),
        int(message.length),
        j1939,
        _groups(usable, j1939),
        tuple(signal.name for signal in message.signals if signal not in usable),
    )


def _usable(signal: CantoolsSignal) -> bool:
    sizes = _FLOATS if signal.is_float else range(1, 65)
    return signal.length in sizes and 0 <= signal.start < _LAST_BIT


def _groups(signals: Sequence[CantoolsSignal], j1939: bool) -> tuple[SignalGroup, ...]:
    """The signal groups of a message: those under the same selectors."""
    by_name = {signal.name: signal for signal in signals}
    groups: dict[Condition, list[Signal]] = {}
    for signal in signals:
        groups.setdefault(_condition(signal, by_name), []).append(_signal(signal, j1939))
    return tuple(SignalGroup(tuple(held), condition) for condition, held in groups.items())


def _above(signal: CantoolsSignal, by_name: dict[str, CantoolsSignal]) -> list[CantoolsSignal]:
    """The selectors that a signal stands under, the innermost first."""
    chain = [signal]
    while (above := by_name.get(chain[-1].multiplexer_signal or "")) is not None and above not in chain:
        chain.append(above)
    return chain[1:]


def _condition(signal: CantoolsSignal, by_name: dict[str, CantoolsSignal]) -> Condition:
    """The selectors that a signal stands under with their numbers, the outermost first."""
    above = _above(signal, by_name)
    below = [signal, *above]
    pairs = [
        (_signal(up, False), frozenset(down.multiplexer_ids or ())) for down, up in zip(below, above, strict=False)
    ]
    return tuple(reversed(pairs))


def _signal(signal: CantoolsSignal, j1939: bool) -> Signal:
    motorola = signal.byte_order == "big_endian"
    return Signal(
        signal.name,
        8 * (signal.start // 8) + 7 - signal.start % 8 if motorola else signal.start,
        signal.length,
        motorola,
        bool(signal.is_signed) and not signal.is_float,
        bool(signal.is_float),
        float(signal.scale),
        float(signal.offset),
        signal.unit or "",
        signal.comment or "",
        _no_value(signal, j1939),
    )


#: Bits of signals whose extreme numbers may mean that there is no value.
_CODED = range(8, 33)

#: Bits from which on words of a value table are codes among numbers, not states.
_NUMBERS = 4

#: A percentage whose highest number is this has no number left for a code.
_FULL = {"%": (100.0, 1.0), "": (1.0, 0.01), "1": (1.0, 0.01)}


def _no_value(signal: CantoolsSignal, j1939: bool) -> tuple[tuple[int, int], ...]:
    """The ranges of raw numbers that mean that there is no value.

    The highest numbers are codes in J1939, and elsewhere where they lie outside the range, as SAE J1939-71 has them.
    Others are those that the value table says to be none, and the ends of the raw numbers where no value can be one:
    with a sign the highest and the lowest, else all ones, which without a range are none unless they are 100 %.
    """
    if signal.is_multiplexer:
        return ()
    ones, first, coded = (1 << signal.length) - 1, first_code(signal.length), signal.length in _CODED
    unsigned = not (signal.is_signed or signal.is_float)
    above = coded and first is not None and _is_outside(signal, first) and _is_outside(signal, ones)
    full, slack = _FULL.get(unit_spelled(signal.unit) or "", (math.inf, 0.0))
    highest = float(signal.scale) * ones + float(signal.offset)
    none = {raw & ones for raw, text in (signal.choices or {}).items() if means_no_value(str(text))}
    none = none if signal.length >= _NUMBERS else set()
    if coded and signal.is_signed and not signal.is_float:
        none |= {raw & ones for raw in (ones >> 1, -1 - (ones >> 1)) if _is_outside(signal, raw)}
    elif coded and unsigned and (_is_outside(signal, ones) if _range(signal) else not abs(highest - full) <= slack):
        none.add(ones)
    codes = {(first, ones)} if unsigned and first is not None and (j1939 or above) else set()
    return tuple(sorted(codes | {(raw, raw) for raw in none}))


def _range(signal: CantoolsSignal) -> tuple[float, float] | None:
    """The range of a signal, if it has one."""
    low, high = signal.minimum, signal.maximum
    return None if low is None or high is None or low >= high else (float(low), float(high))


def _is_outside(signal: CantoolsSignal, raw: int) -> bool:
    """Whether a number is outside the range of its signal, if it has one."""
    span = _range(signal)
    if span is None:
        return False
    value, step = float(signal.scale) * raw + float(signal.offset), abs(float(signal.scale))
    return value > span[1] + step / 2 or value < span[0] - step / 2
