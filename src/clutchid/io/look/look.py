"""`look`: contents of a file, even if `read` would refuse it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from clutchid.io.checks import AMBIENT, check, check_ambient, in_si
from clutchid.io.columns import Heading
from clutchid.io.formats.opening import open_source
from clutchid.io.look.overview import ColumnLook, Look, RasterLook
from clutchid.io.look.time_look import TimeLook, updated
from clutchid.io.map.channel_map import ChannelMap
from clutchid.io.map.proposal import propose
from clutchid.io.source import BLOCK, Raster, Source, in_contract
from clutchid.io.table import SHOWN, Places, Table
from clutchid.log import FloatArray

#: Bytes of data up to which a time grid is read in one piece, so that every problem is counted once.
_WHOLE = 1 << 29


def look(path: str | PathLike[str], ambient: float = AMBIENT, dbc: Sequence[str | PathLike[str]] = ()) -> Look:
    """Contents of a recording of any format, whether or not `read` would accept it.

    Parameters
    ----------
    path
        The file.
    ambient : Pa
        Absolute pressure, above 0, that is added to gauge pressures such as ``bar(g)``.
    dbc
        DBC files that decode a bus log.

    Raises
    ------
    DataError
        If the file cannot be read; problems inside it are in ``Look.problems``.
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
    source = open_source(path, dbc)
    proposal = propose(source)
    proposal = replace(proposal, channels=replace(proposal.channels, dbc=tuple(map(Path, dbc))))
    by_contract = in_contract(source) or (source.tabular and not proposal.complete and _means_the_contract(source))
    summaries = [_Summary(len(raster.headings)) for raster in source.rasters]
    rasters = tuple(
        _raster(source, i, summaries[i], (ambient, by_contract), proposal.channels) for i in range(len(source.rasters))
    )
    problems, warnings = [*source.problems, *([source.unnamed] if source.unnamed else [])], [*source.warnings]
    for one in summaries:
        problems += one.problems
        warnings += one.warnings
    return Look(
        str(path),
        source.format,
        rasters,
        tuple(problems),
        tuple(dict.fromkeys(warnings)),
        proposal,
        not in_contract(source),
    )


def _means_the_contract(source: Source) -> bool:
    """Whether enough columns of a table have standard names to report what is wrong with the others."""
    names = [heading.name for raster in source.rasters for heading in raster.headings if heading.name is not None]
    return len(names) > 1 or not source.rasters


@dataclass(slots=True)
class _Summary:
    """Summary of the samples of a time grid so far."""

    columns: int
    low: list[float] = field(init=False)
    high: list[float] = field(init=False)
    finite: list[int] = field(init=False)
    time: TimeLook | None = None
    places: Places = field(default_factory=Places)
    samples: int = 0
    problems: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.low, self.high = [math.inf] * self.columns, [-math.inf] * self.columns
        self.finite = [0] * self.columns


def _raster(
    source: Source, index: int, summary: _Summary, reading: tuple[float, bool], proposed: ChannelMap
) -> RasterLook:
    raster, (ambient, by_contract) = source.rasters[index], reading
    clock = _clock(source, raster, proposed)
    rows = None if raster.size * len(raster.headings) * 8 < _WHOLE else BLOCK
    for table in source.tables(index, [heading.index for heading in raster.headings], rows):
        _add(summary, table, clock, ambient)
        if by_contract and not source.unnamed:
            checked = check(table, ambient)
            summary.problems += checked.problems[: SHOWN if summary.problems else None]
            summary.warnings += checked.warnings
        else:
            summary.problems += [problem for problem in table.problems if problem not in summary.problems]
    columns = tuple(_column(heading, summary, ambient) for heading in raster.headings)
    return RasterLook(raster.name, summary.samples, columns, summary.time, summary.places.word)


def _clock(source: Source, raster: Raster, proposed: ChannelMap) -> Heading | None:
    """Time stamps of a time grid: as defined by the file, else by the proposed map; in s by default."""
    time = proposed.channels.get("time")
    for heading in raster.headings:
        if heading.index == raster.clock:
            undefined = heading.unit is None and not source.tabular
            return replace(heading, name="time", unit="s") if undefined else heading
        if raster.clock is None and time is not None and heading.text == time.channel:
            return replace(heading, name="time", unit=time.unit or heading.unit)
    return None


def _add(summary: _Summary, table: Table, clock: Heading | None, ambient: float) -> None:
    """Add a block of samples to the summary."""
    summary.samples += table.size
    summary.places = table.places
    for position, heading in enumerate(table.headings):
        values = table.numbers.get(heading.index, np.empty(0))
        finite = values[np.isfinite(values)]
        if finite.size:
            summary.low[position] = min(summary.low[position], float(finite.min()))
            summary.high[position] = max(summary.high[position], float(finite.max()))
            summary.finite[position] += finite.size
    if clock is not None and clock.si is not None and clock.index in table.numbers:
        summary.time = updated(summary.time, in_si(clock, table.numbers[clock.index], ambient), table.places)


def _column(heading: Heading, summary: _Summary, ambient: float) -> ColumnLook:
    position = heading.index
    nothing = not summary.finite[position]
    low, high = (math.nan, math.nan) if nothing else (summary.low[position], summary.high[position])
    low_si, high_si = math.nan, math.nan
    if heading.si:
        ends: FloatArray = in_si(heading, np.array([low, high]), ambient)
        low_si, high_si = float(ends[0]), float(ends[1])
    missing = summary.samples - summary.finite[position]
    return ColumnLook(heading.text, heading.name, heading.unit, heading.si, low, high, low_si, high_si, missing)
