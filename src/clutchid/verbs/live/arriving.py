"""`observe` while a recording arrives: from standard input or a bus, block by block."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import DataError
from clutchid.measurements.live.bus_name import bus_name
from clutchid.names import printable

# imported on use: every command starts with this file
if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.measurements.live.arrival import LiveBlock
    from clutchid.verbs.reading import Reading

#: Name of standard input.
STANDARD_INPUT = "-"


def is_live(log: Path) -> bool:
    """Whether a recording arrives while it is observed."""
    return str(log) == STANDARD_INPUT or bus_name(str(log)) is not None


def arriving(
    reading: Reading, content: ParameterFile, resume: Path | None, stopped: Callable[[], bool]
) -> Generator[LiveBlock]:
    """Blocks of a recording as they arrive, with a duty cycle for both valves of the model, until `stopped`.

    Parameters
    ----------
    reading
        Of `-` or ``can:CHANNEL``.
    resume
        State to go on from.

    Raises
    ------
    DataError
        If the recording cannot be followed.
    """
    from clutchid.measurements import AMBIENT
    from clutchid.measurements.live.bus import bus_blocks, from_bus
    from clutchid.measurements.live.feed import from_descriptor
    from clutchid.measurements.live.text import text_blocks
    from clutchid.measurements.map.channel_map import read_map
    from clutchid.observer.state_file import saved_origin
    from clutchid.parameters import known_ambient

    (log,) = reading.files
    channels = read_map(reading.channels) if isinstance(reading.channels, Path) else None
    ambient = reading.ambient or known_ambient(content.actuator.parameters.P_0) or AMBIENT
    equipment = content.actuator.equipment
    required = ("time", "position", *equipment.recorded)
    origin = None if resume is None else saved_origin(resume)
    if (bus := bus_name(str(log))) is not None:
        frames = from_bus(bus, stopped)
        name = printable(bus.channel)
        blocks = bus_blocks(frames, name, tuple(map(Path, reading.dbc)), channels, ambient, required, origin)
    else:
        if sys.stdin is None:
            raise DataError(
                "standard input: is closed; name a file, or send samples, as in: cat LOG | clutchid observe -"
            )
        pieces = from_descriptor(sys.stdin.fileno(), stopped)
        blocks = text_blocks(pieces, "stdin", channels, ambient, required, origin=origin)
    for block in blocks:
        yield replace(block, log=equipment.driven(block.log))
