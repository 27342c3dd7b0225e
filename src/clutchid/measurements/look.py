"""`look`: contents of a file, even if `read` would refuse it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from clutchid.arguments import checked
from clutchid.log import INPUTS, FloatArray
from clutchid.measurements.checks import AMBIENT, check_ambient, in_si
from clutchid.measurements.columns import REQUIRED, Heading
from clutchid.measurements.conversion import by_names, findings, picked, scaled
from clutchid.measurements.map.channel_map import Channel, ChannelMap, PickedChannels
from clutchid.measurements.map.picking import own_clock
from clutchid.measurements.map.proposal import Proposal, means_the_contract, propose
from clutchid.measurements.opening import open_source, with_dbc
from clutchid.measurements.overview import ColumnOverview, FileOverview, TimeAxis, TimeGridOverview, updated
from clutchid.measurements.source import BLOCK, Places, Raster, Source, Table, in_contract
from clutchid.measurements.stored import WHOLE

__all__ = ["FileOverview", "TimeAxis", "TimeGridOverview", "look", "overview_of"]

#: What a recording of a test rig needs, whose map assigns a force and no duty cycle.
_RIG = ("time", "position", "force")


@checked
def look(
    path: str | PathLike[str],
    ambient: float | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    channels: ChannelMap | None = None,
) -> FileOverview:
    """Contents of a recording of any format, whether or not `read` would accept it.

    Parameters
    ----------
    path
        The file.
    ambient : Pa, optional
        Absolute pressure, above 0, that is added to gauge pressures such as ``bar(g)``; by default 101,300 Pa.
    dbc
        DBC files that decode a bus log, besides those of the map.
    channels
        A channel map: quantities, time axis, problems and warnings are then those of `read` with this map.

    Returns
    -------
    overview : FileOverview
        Channels with units and ranges, holes, what `read` would say, and a proposed channel map.

    Raises
    ------
    DataError
        If the file cannot be read; problems inside it are in ``FileOverview.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    ParameterError
        If `ambient` is not a pressure above 0.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("time [ms],position [mm]\\n0,0\\n1,0.5\\n2,\\n")
    ...     (grid,) = look(file).rasters
    >>> grid.time.rate, grid.columns[1].high_si, grid.columns[1].missing
    (1000.0, 0.0005, 1)
    """
    check_ambient(ambient)
    files = tuple(dict.fromkeys((*(channels.dbc if channels else ()), *map(Path, dbc))))
    source = with_dbc(open_source(path, files), dbc)
    return replace(overview_of(source, ambient, files, channels), source=str(path))


def overview_of(
    source: Source, ambient: float | None, files: tuple[Path, ...], channels: ChannelMap | None
) -> FileOverview:
    """Contents of an opened file, see `look`; `files` are the DBC files that decode it."""
    ambient = AMBIENT if ambient is None else ambient
    proposal = propose(source)
    proposal = replace(proposal, channels=replace(channels or proposal.channels, dbc=files))
    picks, mismatches = _picks(source, proposal, channels)
    file = "" if source.rasters else f"{source.path.name}: "  # the sentence on a file that cannot be read names it
    problems, warnings = [*(f"{file}{text}" for text in source.problems), *mismatches], [*source.warnings]
    wrong, remarks, summaries = list[str](), list[str](), list[_Summary]()
    for index, raster in enumerate(source.rasters):
        chosen = [pick for pick in picks if pick.raster == index]
        columns = {heading.index: (heading, entry) for pick in chosen for heading, entry in pick.columns.values()}
        time, warning = _clock(raster, proposal.channels) if channels is None else (own_clock(raster)[0], "")
        time = next((pick.columns["time"][0] for pick in chosen if "time" in pick.columns), time)
        warnings += [warning] if warning else []
        summaries.append(_Summary(time, columns, ambient, chosen[0].rate if chosen else None))
        tables = _summed(source, index, summaries[-1])
        if chosen and len(picks) == 1:
            wrong, remarks = findings(source, picks, ambient, None, tables)
        for table in tables:
            wrong += table.problems if not picks else ()
            remarks += table.warnings if not picks else ()
    if len(picks) > 1 or (picks and any(summary.spoiled for summary in summaries)):  # without the other columns
        size = max((raster.size * len(raster.headings) for raster in source.rasters), default=0)
        wrong, remarks = findings(source, picks, ambient, None if size * 8 < WHOLE else BLOCK)
    return FileOverview(
        str(source.path),
        source.format,
        tuple(map(_overview, source.rasters, summaries)),
        tuple(dict.fromkeys((*problems, *wrong))),
        tuple(dict.fromkeys((*warnings, *remarks))),
        proposal,
        needs_map=channels is None and not in_contract(source),
    )


def _picks(
    source: Source, proposal: Proposal, channels: ChannelMap | None
) -> tuple[Sequence[PickedChannels], Sequence[str]]:
    """The channels that `read` takes, none where it needs a map, and the problems of the map or of the headings."""
    if channels is not None:
        rig = "force" in channels.channels and not any(name in channels.channels for name in INPUTS)
        return picked(source, channels, _RIG if rig else REQUIRED)
    if source.unnamed:
        return (), (source.unnamed,)
    if in_contract(source) or (source.tabular and not proposal.complete and means_the_contract(source)):
        return by_names(source, REQUIRED)
    return (), ()


@dataclass(slots=True)
class _Summary:
    """Summary of the samples of a time grid so far, and what is known of it before.

    `time` is its time channel, `rate` its rate in Hz where it has none, `columns` the mapped ones by index, `ambient`
    the ambient pressure in Pa. `ranges` are the lowest and highest value, and the number of finite ones, of each column
    that has any. It is `spoiled` where a table has something to say, maybe of a column that is not read.
    """

    time: Heading | None
    columns: Mapping[int, tuple[Heading, Channel]]
    ambient: float
    rate: float | None
    ranges: dict[int, tuple[float, float, int]] = field(default_factory=dict)
    axis: TimeAxis | None = None
    places: Places = field(default_factory=Places)
    samples: int = 0
    spoiled: bool = False

    def stamps(self, table: Table) -> FloatArray | None:
        """Time stamps of the next table in s; None if there are none."""
        if self.rate is not None:
            return (self.samples + np.arange(table.size)) / self.rate
        if self.time is None or self.time.si is None or self.time.index not in table.numbers:
            return None
        return in_si(self.time, self.written(self.time.index, table.numbers[self.time.index]), self.ambient)

    def written(self, index: int, values: FloatArray) -> FloatArray:
        """Samples of a column in its unit, with the sign, factor and offset of the map."""
        return scaled(values, self.columns[index][1]) if index in self.columns else values


def _summed(source: Source, index: int, summary: _Summary) -> Iterator[Table]:
    """The tables of a time grid, each added to the summary as it is read."""
    raster = source.rasters[index]
    rows = None if raster.size * len(raster.headings) * 8 < WHOLE else BLOCK
    for table in source.tables(index, [heading.index for heading in raster.headings], rows):
        _add(summary, table)
        yield table


def _overview(raster: Raster, summary: _Summary) -> TimeGridOverview:
    columns = tuple(_column(heading, summary) for heading in raster.headings)
    return TimeGridOverview(raster.name, summary.samples, columns, summary.axis, summary.places.word, raster.others)


def _clock(raster: Raster, proposed: ChannelMap) -> tuple[Heading | None, str]:
    """Time stamps of a time grid, as defined by the proposed map or by the file, and a warning if they are a guess."""
    time = proposed.channels.get("time")
    for heading in raster.headings:
        if time is not None and heading.text == time.channel and (time.unit or heading.index != raster.clock):
            return replace(heading, name="time", unit=time.unit or heading.unit), ""
    return own_clock(raster)


def _add(summary: _Summary, table: Table) -> None:
    """Add a block of samples to the summary."""
    stamps = summary.stamps(table)
    if stamps is not None:
        summary.axis = updated(summary.axis, stamps, table.places)
    summary.samples += table.size
    summary.spoiled |= bool(table.problems or table.warnings)
    summary.places = table.places
    for index, values in table.numbers.items():
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high, count = summary.ranges.get(index, (math.inf, -math.inf, 0))
            summary.ranges[index] = min(low, float(finite.min())), max(high, float(finite.max())), count + finite.size


def _column(heading: Heading, summary: _Summary) -> ColumnOverview:
    low, high, count = summary.ranges.get(heading.index, (math.nan, math.nan, 0))
    shown = summary.columns[heading.index][0] if heading.index in summary.columns else heading
    low_si, high_si = math.nan, math.nan
    if shown.si:
        ends: FloatArray = in_si(shown, summary.written(heading.index, np.array([low, high])), summary.ambient)
        low_si, high_si = sorted(ends.tolist())
    missing = summary.samples - count
    return ColumnOverview(heading.text, shown.name, shown.unit, shown.si, low, high, low_si, high_si, missing)
