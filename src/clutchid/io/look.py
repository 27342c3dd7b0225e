"""`look`: what is in a file, also where `read` would refuse it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from clutchid.io.channel_map import ChannelMap
from clutchid.io.checks import AMBIENT, check, check_ambient, in_si
from clutchid.io.columns import Heading
from clutchid.io.opening import open_source
from clutchid.io.proposal import propose
from clutchid.io.seen import ColumnLook, Look, RasterLook
from clutchid.io.source import BLOCK, Raster, Source, in_contract
from clutchid.io.table import SHOWN, Places, Table
from clutchid.io.time_look import TimeLook, ticked
from clutchid.log import FloatArray

#: Bytes of numbers up to which a raster is looked at in one piece, so that every problem is counted once.
_WHOLE = 1 << 29


def look(path: str | PathLike[str], ambient: float = AMBIENT, dbc: Sequence[str | PathLike[str]] = ()) -> Look:
    """What is in a recording of any format, whether or not `read` would accept it.

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
        If there is no file that can be read; what is wrong inside it is in ``Look.problems``.
    MissingExtra
        If its format needs a library that is not installed.
    ParameterError
        If `ambient` is not a pressure above 0.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.csv"
    ...     _ = file.write_text("time [ms],position [mm]\\n0,0\\n1,0.5\\n2,\\n")
    ...     (seen,) = look(file).rasters
    >>> seen.time.rate, seen.columns[1].high_si, seen.columns[1].missing
    (1000.0, 0.0005, 1)
    """
    check_ambient(ambient)
    source = open_source(path, dbc)
    proposal = propose(source)
    proposal = replace(proposal, channels=replace(proposal.channels, dbc=tuple(map(Path, dbc))))
    by_contract = in_contract(source) or (source.tabular and not proposal.complete and _means_the_contract(source))
    found = [_Found(len(raster.headings)) for raster in source.rasters]
    seen = tuple(
        _raster(source, i, found[i], (ambient, by_contract), proposal.channels) for i in range(len(source.rasters))
    )
    problems, warnings = [*source.problems, *([source.unnamed] if source.unnamed else [])], [*source.warnings]
    for one in found:
        problems += one.problems
        warnings += one.warnings
    return Look(
        str(path),
        source.format,
        seen,
        tuple(problems),
        tuple(dict.fromkeys(warnings)),
        proposal,
        not in_contract(source),
    )


def _means_the_contract(source: Source) -> bool:
    """Whether enough columns of a table have the names of the contract to say what is wrong with the others."""
    names = [heading.name for raster in source.rasters for heading in raster.headings if heading.name is not None]
    return len(names) > 1 or not source.rasters


@dataclass(slots=True)
class _Found:
    """What was seen of a raster so far."""

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


def _raster(source: Source, index: int, found: _Found, reading: tuple[float, bool], proposed: ChannelMap) -> RasterLook:
    raster, (ambient, by_contract) = source.rasters[index], reading
    clock = _clock(source, raster, proposed)
    rows = None if raster.size * len(raster.headings) * 8 < _WHOLE else BLOCK
    for table in source.tables(index, [heading.index for heading in raster.headings], rows):
        _take(found, table, clock, ambient)
        if by_contract and not source.unnamed:
            checked = check(table, ambient)
            found.problems += checked.problems[: SHOWN if found.problems else None]
            found.warnings += checked.warnings
        else:
            found.problems += [problem for problem in table.problems if problem not in found.problems]
    columns = tuple(_column(heading, found, ambient) for heading in raster.headings)
    return RasterLook(raster.name, found.samples, columns, found.time, found.places.word)


def _clock(source: Source, raster: Raster, proposed: ChannelMap) -> Heading | None:
    """The stamps of a raster: what the file says they are, else what the proposed map takes; in s where nobody says."""
    time = proposed.channels.get("time")
    for heading in raster.headings:
        if heading.index == raster.clock:
            unsaid = heading.unit is None and not source.tabular
            return replace(heading, name="time", unit="s") if unsaid else heading
        if raster.clock is None and time is not None and heading.text == time.channel:
            return replace(heading, name="time", unit=time.unit or heading.unit)
    return None


def _take(found: _Found, table: Table, clock: Heading | None, ambient: float) -> None:
    """Add a block of samples to what was seen."""
    found.samples += table.size
    found.places = table.places
    for position, heading in enumerate(table.headings):
        values = table.numbers.get(heading.index, np.empty(0))
        finite = values[np.isfinite(values)]
        if finite.size:
            found.low[position] = min(found.low[position], float(finite.min()))
            found.high[position] = max(found.high[position], float(finite.max()))
            found.finite[position] += finite.size
    if clock is not None and clock.si is not None and clock.index in table.numbers:
        found.time = ticked(found.time, in_si(clock, table.numbers[clock.index], ambient), table.places)


def _column(heading: Heading, found: _Found, ambient: float) -> ColumnLook:
    position = heading.index
    nothing = not found.finite[position]
    low, high = (math.nan, math.nan) if nothing else (found.low[position], found.high[position])
    low_si, high_si = math.nan, math.nan
    if heading.si:
        ends: FloatArray = in_si(heading, np.array([low, high]), ambient)
        low_si, high_si = float(ends[0]), float(ends[1])
    missing = found.samples - found.finite[position]
    return ColumnLook(heading.text, heading.name, heading.unit, heading.si, low, high, low_si, high_si, missing)
