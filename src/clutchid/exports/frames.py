"""Results of an observer while they arise, as frames on a CAN bus with their DBC."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.documents.style import MM
from clutchid.estimation.assess.observed import TRUSTS, indicators, observed_verdict
from clutchid.log import FloatArray
from clutchid.measurements.formats.can.dbc import Signal
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.by_stroke import curve, curve_positions
from clutchid.observer.health import FLAGS, LIVE_FLAGS
from clutchid.observer.live import LiveRun, due
from clutchid.observer.recording import ObservedRecording
from clutchid.version import installed_version

#: Time in s from one published sample to the next, if nothing else is wanted.
PERIOD = 0.01

#: Payload bytes of every frame.
LENGTH = 8


class ResultMessage(NamedTuple):
    """A message with results: unsigned signals in the order of Intel, whose highest number means that it is unknown."""

    name: str
    identifier: int
    signals: tuple[Signal, ...]


def _words(*rows: tuple[str, float, float, str, str]) -> tuple[Signal, ...]:
    """Signals of 16 bits: name, scale, offset, unit, comment."""
    return tuple(
        Signal(name, 16 * i, 16, scale=scale, offset=offset, unit=unit, comment=comment)
        for i, (name, scale, offset, unit, comment) in enumerate(rows)
    )


_BITS = {"used": "The position of the sample was usable.", **FLAGS, **LIVE_FLAGS}

TRUST_FRAME = Signal("trust", 62, 2, comment="Trust in the load so far.")

#: All messages.
_STATE = ResultMessage("ClutchState", 0x6E0, _words(
    ("position", 0.001, -5.0, "mm", "Position of the piston."),
    ("velocity", 0.05, -1600.0, "mm/s", "Velocity of the piston."),
    ("pressure_a", 0.02, 0.0, "kPa", "Absolute pressure in chamber A."),
    ("pressure_a_half", 0.02, 0.0, "kPa", "Half of its 95 % band."),
))  # fmt: skip
LOAD = ResultMessage("ClutchLoad", 0x6E1, _words(
    ("load_position", 0.001, 0.0, "mm", "Position of the point of the load curve; the points follow each other."),
    ("load", 0.2, -1000.0, "N", "Load at this position."),
    ("load_half", 0.2, 0.0, "N", "Half of its 95 % band."),
    ("stroke", 1.0, 0.0, "", "Strokes that have ended."),
))  # fmt: skip
_HEALTH = ResultMessage("ClutchHealth", 0x6E2, (
    Signal("sample_time", 0, 32, scale=0.001, unit="s", comment="Time of the sample of these three frames."),
    *(Signal(name, 32 + i, 1, comment=meaning) for i, (name, meaning) in enumerate(_BITS.items())),
    TRUST_FRAME,
))  # fmt: skip
MESSAGES = (_STATE, LOAD, _HEALTH)

#: Identifier and payload of a frame.
_Frame = tuple[int, bytes]


def observe_frames(before: LiveRun, after: LiveRun, part: ObservedRecording, every: float, sent: int) -> list[_Frame]:
    """Frames of a block: for each published sample its state, a point of the load curve, and the flags of the block.

    Parameters
    ----------
    before, after
        The recording before and after the block.
    every : s
        Time from one published sample to the next; 0 publishes all.
    sent
        Number of samples that were published before, which says which point of the load curve comes next.
    """
    rows = np.flatnonzero(due(part.log.time, before.latest, every))
    states = {
        row.column: part.samples.states[rows, i] for i, row in enumerate(after.observer.actuator.state_rows.values())
    }
    half = QUANTILE * part.deviation("p_A")[rows]
    state = [states["position"] / MM, states["velocity"] / MM, states["pressure_a"] / 1e3, half / 1e3]
    grid = curve_positions(after.observer)
    load = curve(after.observer, after.after, grid[(sent + np.arange(rows.size)) % grid.size])
    strokes = np.full(rows.size, float(after.after.strokes.ended % 0xFFFF))
    points = [load.position / MM, load.force, load.high - load.force, strokes]
    flags = [np.full(rows.size, float(part.health[name] > 0.0)) for name in (*FLAGS, *LIVE_FLAGS)]
    trust = TRUSTS.index(observed_verdict(indicators(after)).trust) if rows.size else 0
    health = [part.log.time[rows], part.samples.used[rows].astype(np.float64), *flags, np.full(rows.size, float(trust))]
    payloads = [
        packed(message.signals, values) for message, values in zip(MESSAGES, (state, points, health), strict=True)
    ]
    pairs = list(zip(MESSAGES, payloads, strict=True))
    return [(message.identifier, payload[i]) for i in range(rows.size) for message, payload in pairs]


def packed(signals: Sequence[Signal], values: Sequence[FloatArray]) -> list[bytes]:
    """Payloads of 8 bytes with the values of unsigned signals of Intel, in their units.

    What is not finite becomes the highest number of a signal; what is out of its range the next one inside.

    Examples
    --------
    >>> packed([Signal("speed", 0, 16, scale=0.5), Signal("on", 16, 1)], [np.array([300.0, np.nan]), np.ones(2)])
    [b'X\\x02\\x01\\x00\\x00\\x00\\x00\\x00', b'\\xff\\xff\\x01\\x00\\x00\\x00\\x00\\x00']
    """
    words: NDArray[np.uint64] = np.zeros(np.shape(values[0]), dtype=np.uint64)
    for signal, value in zip(signals, values, strict=True):
        unknown = (1 << signal.length) - 1
        most = unknown - 1 if signal.length > 1 else 1
        raw = np.clip(np.rint((np.nan_to_num(value) - signal.offset) / signal.scale), 0.0, float(most))
        raw = np.where(np.isfinite(value), raw, float(unknown))
        words |= raw.astype(np.uint64) << np.uint64(signal.begin)
    return [row.tobytes() for row in words.astype("<u8")]


def results_dbc(every: float = PERIOD, *, of_c: bool = False) -> str:
    """The DBC of all messages.

    Parameters
    ----------
    every : s
        Time from one published sample to the next, which is the cycle time of each message; 0 for each sample.
    of_c
        Whether an exported observer sends them: it knows neither time nor what a computer drops, so that the signals
        of these are left out.
    """
    left_out = {"sample_time", "used", *LIVE_FLAGS} if of_c else set()
    messages = [
        message._replace(signals=tuple(signal for signal in message.signals if signal.name not in left_out))
        for message in MESSAGES
    ]
    return "\n".join(_dbc_lines(messages, round(every * 1e3))) + "\n"


def _dbc_lines(messages: Sequence[ResultMessage], cycle: int) -> Iterator[str]:
    yield from (f'VERSION "clutchid {installed_version()}"', "", "NS_ :", "", "BS_:", "", "BU_: clutchid", "")
    for message in messages:
        yield f"BO_ {message.identifier} {message.name}: {LENGTH} clutchid"
        for signal in message.signals:
            most = signal.offset + signal.scale * ((1 << signal.length) - (2 if signal.length > 1 else 1))
            place, number = f"{signal.begin}|{signal.length}@1+", f"({signal.scale:g},{signal.offset:g})"
            yield f' SG_ {signal.name} : {place} {number} [{signal.offset:g}|{most:.10g}] "{signal.unit}" Vector__XXX'
        yield ""
    for message in messages:
        for signal in message.signals:
            yield f'CM_ SG_ {message.identifier} {signal.name} "{signal.comment}";'
    yield 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;'
    yield 'BA_DEF_DEF_ "GenMsgCycleTime" 0;'
    for message in messages:
        yield f'BA_ "GenMsgCycleTime" BO_ {message.identifier} {cycle};'
    for message in messages:
        for signal in message.signals:
            if signal.length > 1:
                unknown = f'{(1 << signal.length) - 1} "unknown"'
                words = (
                    " ".join(f'{level} "{word}"' for level, word in enumerate(TRUSTS))
                    if signal is TRUST_FRAME
                    else unknown
                )
                yield f"VAL_ {message.identifier} {signal.name} {words} ;"
