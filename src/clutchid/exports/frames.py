"""DBC of the frames in which a control unit sends the results of an exported observer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from clutchid.estimation.assess.observed import TRUSTS
from clutchid.measurements.formats.can.dbc import Signal
from clutchid.observer.flags import FLAGS
from clutchid.version import installed_version

#: Time in ms from one frame of a message to the next.
_CYCLE = 10

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


#: First bit of the flags; the bits before are free.
_FIRST_FLAG = 33

_TRUST = Signal("trust", 62, 2, comment="Trust in the load so far.")

#: All messages.
MESSAGES = (
    ResultMessage("ClutchState", 0x6E0, _words(
        ("position", 0.001, -5.0, "mm", "Position of the piston."),
        ("velocity", 0.05, -1600.0, "mm/s", "Velocity of the piston."),
        ("pressure_a", 0.02, 0.0, "kPa", "Absolute pressure in chamber A."),
        ("pressure_a_half", 0.02, 0.0, "kPa", "Half of its 95 % band."),
    )),
    ResultMessage("ClutchLoad", 0x6E1, _words(
        ("load_position", 0.001, 0.0, "mm", "Position of the point of the load curve; the points follow each other."),
        ("load", 0.2, -1000.0, "N", "Load at this position."),
        ("load_half", 0.2, 0.0, "N", "Half of its 95 % band."),
        ("stroke", 1.0, 0.0, "", "Strokes that have ended."),
    )),
    ResultMessage("ClutchHealth", 0x6E2, (
        *(Signal(name, _FIRST_FLAG + i, 1, comment=meaning) for i, (name, meaning) in enumerate(FLAGS.items())),
        _TRUST,
    )),
)  # fmt: skip


def results_dbc() -> str:
    """The DBC of all messages."""
    return "\n".join(_dbc_lines()) + "\n"


def _dbc_lines() -> Iterator[str]:
    yield from (f'VERSION "clutchid {installed_version()}"', "", "NS_ :", "", "BS_:", "", "BU_: clutchid", "")
    for message in MESSAGES:
        yield f"BO_ {message.identifier} {message.name}: {LENGTH} clutchid"
        for signal in message.signals:
            most = signal.offset + signal.scale * ((1 << signal.length) - (2 if signal.length > 1 else 1))
            place, number = f"{signal.begin}|{signal.length}@1+", f"({signal.scale:g},{signal.offset:g})"
            yield f' SG_ {signal.name} : {place} {number} [{signal.offset:g}|{most:.10g}] "{signal.unit}" Vector__XXX'
        yield ""
    for message in MESSAGES:
        for signal in message.signals:
            yield f'CM_ SG_ {message.identifier} {signal.name} "{signal.comment}";'
    yield 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;'
    yield 'BA_DEF_DEF_ "GenMsgCycleTime" 0;'
    for message in MESSAGES:
        yield f'BA_ "GenMsgCycleTime" BO_ {message.identifier} {_CYCLE};'
    levels = " ".join(f'{level} "{word}"' for level, word in enumerate(TRUSTS))
    for message in MESSAGES:
        for signal in message.signals:
            if signal.length > 1:
                words = levels if signal is _TRUST else f'{(1 << signal.length) - 1} "unknown"'
                yield f"VAL_ {message.identifier} {signal.name} {words} ;"
