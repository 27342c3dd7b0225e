"""`Reading`: the recordings of a verb, read, checked and ready to be fitted or observed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from clutchid.errors import DataError, ParameterError
from clutchid.log import INPUTS, Log
from clutchid.measurements import NoFramesError
from clutchid.measurements.suffixes import by_suffix, split_name
from clutchid.parameters import known_ambient
from clutchid.strokes.vented_rest import VentedRest, Zero, from_rest

# imported on use: a command that only reads files starts faster
if TYPE_CHECKING:
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.model.actuator import Actuator
    from clutchid.preparation.inspection import Inspection

__all__ = [
    "REFUSED",
    "LogOrPath",
    "Reading",
    "by_suffix",
    "inspected",
    "reading_of",
    "split_name",
]

#: Last line of the refusal of a recording for a bad check.
REFUSED = "Correct the recording or its channel map, or go on with --force (in Python force=True)."


#: A recording: read, or the path of its file.
LogOrPath = Log | str | PathLike[str]


@dataclass(frozen=True, slots=True)
class Reading:
    """Recordings, and how they are read and checked.

    Attributes
    ----------
    logs, verify
        Recordings that a verb works on, and those that its result is simulated on: logs or paths.
    ambient : Pa
        Ambient pressure, if stated: gauge pressures count from it, and a calibration takes it for that of the vented
        chamber. By default gauge pressures count from a measured P_0 of the actuator, else from 101,300 Pa.
    channels, dbc
        Channel map or its file, and DBC files of bus logs, of which there must be one among the recordings.
    maps
        Channel maps of single recordings in place of `channels`, by path.
    force
        Whether to go on with a recording although a check of it is bad.
    zero : 'subtract' or 'keep'
        Whether a vented rest that has moved since the calibration is subtracted from the position; in a fit its request
        says so.
    """

    logs: tuple[LogOrPath, ...] = ()
    verify: tuple[LogOrPath, ...] = ()
    ambient: float | None = None
    channels: ChannelMap | str | PathLike[str] | None = None
    dbc: tuple[str | PathLike[str], ...] = ()
    force: bool = False
    zero: Zero = "subtract"
    maps: Mapping[Path, Path | None] = field(default_factory=dict)

    @property
    def files(self) -> tuple[str | PathLike[str], ...]:
        """The files among the recordings."""
        return tuple(log for log in (*self.logs, *self.verify) if not isinstance(log, Log))

    def read(
        self, actuator: Actuator | None = None, measured: Sequence[str] = (), required: Sequence[str] | None = None
    ) -> list[Log]:
        """The recordings `logs`, and behind them those to `verify` with, in SI.

        Parameters
        ----------
        actuator : Actuator, optional
            Its valves say which duty cycles a recording has, and a measured P_0 is what gauge pressures count from.
        measured
            Columns that are compared: a file with a channel map must have those, unless it is only to verify with.
        required
            Columns that a file must have; by default time, position, and the duty cycles of the valves.

        Raises
        ------
        DataError
            The text lists the problems of all files.
        """
        from clutchid.measurements import read_each

        needed = tuple(required or ("time", "position", *(actuator.equipment.recorded if actuator else INPUTS)))
        added = known_ambient(actuator.parameters.P_0) if actuator else None

        tables: list[NoFramesError] = []

        def read_one(item: tuple[LogOrPath, Sequence[str]]) -> Log:
            source, compared = item
            if isinstance(source, Log):
                log = source
            else:
                try:
                    log = self._read(source, needed, compared, added)
                except NoFramesError as error:
                    tables.append(error)
                    if len(tables) == len(self.files):
                        raise
                    log = replace(self, dbc=())._read(source, needed, compared, added)
            return log if actuator is None or required else actuator.equipment.driven(log)

        return read_each([*((log, measured) for log in self.logs), *((log, ()) for log in self.verify)], read_one)

    def _read(
        self, file: str | PathLike[str], needed: Sequence[str], measured: Sequence[str], added: float | None
    ) -> Log:
        from clutchid.measurements import read

        channels = self.maps.get(Path(file), self.channels)
        if channels is not None:
            from clutchid.measurements.map.picking import OPTIONAL

            needed = (*needed, *(name for name in measured if name in OPTIONAL))
        return read(file, ambient=self.ambient, added=added, channels=channels, dbc=self.dbc, required=needed)

    def checked(self, actuator: Actuator, measured: Sequence[str] = (), rest: VentedRest | None = None) -> list[Log]:
        """The recordings as `read` gives them, with what the checks before a fit find among their warnings.

        What is checked is what will be fitted: with `zero` "subtract" the travel from the vented `rest` of a
        calibration.

        Raises
        ------
        DataError
            If a recording cannot be read, or a check is bad, unless with `force`; the text has the sentences of
            `clutchid look`.
        """
        return inspected(self.read(actuator, measured), actuator, rest, self.zero, force=self.force)


def reading_of(
    logs: LogOrPath | Iterable[LogOrPath],
    verify: LogOrPath | Iterable[LogOrPath] = (),
    *,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Iterable[str | PathLike[str]] = (),
    force: bool = False,
    zero: Zero = "subtract",
) -> Reading:
    """A `Reading` of one recording or several.

    Raises
    ------
    ParameterError
        If an option of reading has no effect, because no file is read.
    """
    reading = Reading(_several(logs), _several(verify), ambient, channels, tuple(dbc), force, zero)
    for name, value in {"ambient": ambient, "channels": channels, "dbc": reading.dbc or None}.items():
        if value is not None and not reading.files:
            raise ParameterError(
                f"{name} = {value!r}: is an option for reading files, but these recordings have already been read; "
                "give it to clutchid.read, or leave it out."
            )
    return reading


def _several(logs: LogOrPath | Iterable[LogOrPath]) -> tuple[LogOrPath, ...]:
    return (logs,) if isinstance(logs, Log | str | PathLike) else tuple(logs)


def inspected(
    logs: Sequence[Log], actuator: Actuator, rest: VentedRest | None, zero: Zero, *, force: bool = False
) -> list[Log]:
    """Recordings with what the checks before a fit find among their warnings, see `Reading.checked`."""
    from clutchid.strokes.values import values_of

    values = [values_of(log, actuator) for log in logs]
    inspections = [_inspection(checked.log, actuator, rest, zero) for checked in values]
    bad = [str(DataError.of(inspection.name, list(inspection.bad))) for inspection in inspections if inspection.bad]
    if bad and not force:
        raise DataError("\n".join([*bad, REFUSED]))
    together = [
        tuple(dict.fromkeys((*checked.warned.warnings, *inspection.warnings)))
        for checked, inspection in zip(values, inspections, strict=True)
    ]
    return [
        log
        if log.warnings == warnings
        else replace(log, warnings=warnings)  # what was computed from a log stays with it
        for log, warnings in zip(logs, together, strict=True)
    ]


#: Inspections of logs that are still in use: fits of one recording with other options check it once.
_INSPECTED: WeakKeyDictionary[Log, tuple[Actuator, Inspection]] = WeakKeyDictionary()


def _inspection(log: Log, actuator: Actuator, rest: VentedRest | None, zero: Zero) -> Inspection:
    from clutchid.preparation.inspection import inspect

    travel = from_rest(log, rest, zero).log
    last = _INSPECTED.get(travel)
    if last is None or last[0] != actuator:
        last = _INSPECTED[travel] = actuator, inspect(travel, actuator)
    return last[1]
