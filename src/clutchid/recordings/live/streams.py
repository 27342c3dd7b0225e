"""Channels with common stamps while they arrive: which ones the map picks, and their samples in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray
from clutchid.recordings.checks import in_si
from clutchid.recordings.columns import heading_problems
from clutchid.recordings.map.channel_map import COUNTED, Channel, ChannelMap, Pick
from clutchid.recordings.map.picking import pick
from clutchid.recordings.recording import scaled
from clutchid.recordings.source import Raster, Source, in_contract
from clutchid.recordings.table import Rows, Table

#: A duty cycle may be as far outside 0 to 1.
_SLACK = 1e-9

_ADVICE = (
    "Name the channels as in `time [s],position [m],duty_supply [1],duty_exhaust [1]`, or give a channel map with "
    "--map, as `clutchid look FILE --save MAP.toml` writes it for a recording of the same source."
)


class Arrived(NamedTuple):
    """Samples of a stream in the order in which they came.

    `place` (n,) is the place of each among all that came together, `time` (n,) in s, `columns` (n,) each in SI;
    `invalid` counts the values that were infinite, or duty cycles outside 0 to 1, and are NaN now. Samples without a
    time are left out.
    """

    stream: int
    place: Rows
    time: FloatArray
    columns: Mapping[str, FloatArray]
    invalid: int = 0


def picked_streams(
    name: str, rasters: Sequence[Raster], channels: ChannelMap | None, required: Sequence[str]
) -> tuple[Pick, ...]:
    """The channels of each time grid that the map picks, that of the position first.

    Without a map these are the channels with standard names.

    Raises
    ------
    DataError
        If the map does not fit, or a required quantity has no channel; the text lists all problems.
    """
    source = Source(Path(name), "CSV" if len(rasters) == 1 else "CAN", tuple(rasters), lambda *_: iter(()))
    problems: list[str] = []
    if channels is None:
        if len(rasters) == 1 and not in_contract(source):
            raise DataError.of(name, [*heading_problems(rasters[0].headings, required), _ADVICE])
        channels = _by_names(rasters)
    picks, found = pick(source, channels, required)
    problems += found
    missing = [wanted for wanted in required if wanted not in channels.channels and wanted != "time"]
    problems += [f"no channel is assigned to {', '.join(missing)}."] if missing else []
    if problems:
        raise DataError.of(name, [*problems, _ADVICE])
    return tuple(sorted(picks, key=lambda chosen: "position" not in chosen.columns))


def _by_names(rasters: Sequence[Raster]) -> ChannelMap:
    """A map of the channels with standard names, but for the stamps; the first of several counts."""
    found: dict[str, Channel] = {}
    for raster in rasters:
        for heading in raster.headings:
            if heading.name not in (None, "time"):
                found.setdefault(str(heading.name), Channel(heading.text, raster.name or None))
    return ChannelMap(found)


def indices(chosen: Pick) -> list[int]:
    """The channels of a time grid that are read, by their index in it."""
    return [heading.index for heading, _ in chosen.columns.values() if heading.index != COUNTED]


def arrived(stream: int, chosen: Pick, table: Table, ambient: float, place: Rows, done: int = 0) -> Arrived:
    """The picked channels of a table in SI, in the order in which they came.

    Parameters
    ----------
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    place
        The place of each row among all that came together, increasing.
    done
        Number of rows before, for a time that is counted.
    """
    columns, invalid = {}, 0
    for name, (heading, entry) in chosen.columns.items():
        if heading.index == COUNTED:
            values = (done + np.arange(table.size)) / float(chosen.rate or 1.0)
        else:
            values = in_si(heading, scaled(table.numbers[heading.index], entry), ambient)
        wrong = np.isinf(values)
        if name in INPUTS:
            wrong |= (values < -_SLACK) | (values > 1.0 + _SLACK)
        if wrong.any():
            invalid += int(wrong.sum())
            values = np.where(wrong, np.nan, values)
        columns[name] = values
    time = columns.pop("time")
    known = np.isfinite(time)
    if not known.all():
        place, time = place[known], time[known]
        columns = {name: values[known] for name, values in columns.items()}
    return Arrived(stream, place, time, columns, invalid)
