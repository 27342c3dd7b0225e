"""`observe` while a recording arrives: from standard input or a bus, block by block."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import DataError
from clutchid.measurements.live.bus_name import bus_name
from clutchid.names import printable
from clutchid.verbs.options import ReadingText, pressure_option

# imported on use: every command starts with this file
if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.measurements.live.arrival import LiveBlock
    from clutchid.strokes.vented_rest import Zero

#: Name of standard input.
STANDARD_INPUT = "-"


def is_live(log: Path) -> bool:
    """Whether a recording arrives while it is observed."""
    return str(log) == STANDARD_INPUT or bus_name(str(log)) is not None


@dataclass(frozen=True, slots=True)
class LiveReading:
    """A recording that arrives, and how it is observed.

    Attributes
    ----------
    log
        `-` or ``can:CHANNEL``.
    files
        Options of reading.
    method, zero
        As of `clutchid.observe`.
    resume
        State to go on from.
    supply_std
        As of `clutchid.observe`.
    """

    log: Path
    files: ReadingText
    method: str
    zero: Zero
    resume: Path | None
    supply_std: float | None


def arriving(reading: LiveReading, content: ParameterFile, stopped: Callable[[], bool]) -> Generator[LiveBlock]:
    """Blocks of a recording as they arrive, with a duty cycle for both valves of the model, until `stopped`.

    Raises
    ------
    DataError
        If the recording cannot be followed.
    """
    from clutchid.measurements.checks import AMBIENT
    from clutchid.measurements.live.bus import bus_blocks, from_bus
    from clutchid.measurements.live.feed import from_descriptor
    from clutchid.measurements.live.text import text_blocks
    from clutchid.measurements.map.channel_map import read_map
    from clutchid.observer.state_file import saved_origin
    from clutchid.parameters import known_ambient

    log, files = reading.log, reading.files
    channels = None if files.map is None else read_map(files.map)
    ambient = pressure_option(files.ambient) or known_ambient(content.actuator.parameters.P_0) or AMBIENT
    equipment = content.actuator.equipment
    required = ("time", "position", *equipment.recorded)
    origin = None if reading.resume is None else saved_origin(reading.resume)
    if (bus := bus_name(str(log))) is not None:
        frames = from_bus(bus, stopped)
        name = printable(bus.channel)
        blocks = bus_blocks(frames, name, tuple(files.dbc or ()), channels, ambient, required, origin)
    else:
        if sys.stdin is None:
            raise DataError(
                "standard input: is closed; name a file, or send samples, as in: cat LOG | clutchid observe -"
            )
        pieces = from_descriptor(sys.stdin.fileno(), stopped)
        blocks = text_blocks(pieces, "stdin", channels, ambient, required, origin=origin)
    for block in blocks:
        yield replace(block, log=equipment.driven(block.log))
