"""Result of `look`: channels, time grids with their holes, problems and proposed map, also as text."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import HOLE, FloatArray
from clutchid.measurements.clock import sample_intervals, usual_interval
from clutchid.measurements.map.proposal import Proposal
from clutchid.measurements.source import Places
from clutchid.messages import SHOWN, listed, sample_count, text_table
from clutchid.names import printable


@dataclass(frozen=True, slots=True)
class Hole:
    """An interval much longer than the others.

    Attributes
    ----------
    place
        The line or row before it.
    start, length : s
        Where it begins, and how long it is.
    """

    place: int
    start: float
    length: float


@dataclass(frozen=True, slots=True)
class TimeAxis:
    """The time axis of channels.

    Attributes
    ----------
    first, last : s
        First and last sample.
    shortest, usual, longest : s
        Intervals between samples.
    hole_count
        Number of intervals much longer than the usual one.
    holes
        The first of them.
    repeated
        Number of time stamps equal to the previous one.
    back
        Number of those below the previous one.
    """

    first: float
    last: float
    shortest: float
    usual: float
    longest: float
    hole_count: int
    holes: tuple[Hole, ...]
    repeated: int = 0
    back: int = 0

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return self.last - self.first

    @property
    def rate(self) -> float:
        """Samples per second, from the usual interval."""
        return 1 / self.usual


def updated(before: TimeAxis | None, time: FloatArray, places: Places) -> TimeAxis | None:
    """Update the summary `before` with a further block of time stamps in s; None if there were none so far.

    The usual interval is that of the first block.
    """
    rows = np.flatnonzero(np.isfinite(time))
    if not rows.size:
        return before
    stamps = time[rows]
    axis = before or TimeAxis(float(stamps[0]), math.nan, math.nan, usual_interval(stamps), math.nan, 0, ())
    joined = np.r_[axis.last, stamps]
    steps = sample_intervals(joined)  # NaN before the first sample
    holes = np.flatnonzero(steps > HOLE * axis.usual)
    shown = [
        Hole(places.number(rows[i - 1]) if i else places.number(rows[0]) - 1, float(joined[i]), float(steps[i]))
        for i in holes[:SHOWN].tolist()
    ]
    return replace(
        axis,
        last=float(stamps[-1]),
        shortest=float(np.fmin.reduce(steps, initial=axis.shortest)),
        longest=float(np.fmax.reduce(steps, initial=axis.longest)),
        hole_count=axis.hole_count + int(holes.size),
        holes=(*axis.holes, *shown)[:SHOWN],
        repeated=axis.repeated + int(np.count_nonzero(steps == 0)),
        back=axis.back + int(np.count_nonzero(steps < 0)),
    )


#: Longest name in the table; the listing and the map have whole names.
_WIDTH = 48

#: Number of channels without numbers that are listed.
_LISTED = 40

_TITLES = ("column", "as written", "from", "to", "in SI from", "to", "missing")


@dataclass(frozen=True, slots=True)
class ColumnOverview:
    """One channel of a file.

    Attributes
    ----------
    heading
        The text as written.
    name
        The quantity; None: the channel is ignored by `read`.
    unit
        As in the file; None if it has none.
    si
        SI unit; None if unknown.
    low, high : unit
        Range; NaN if unknown.
    low_si, high_si : si
        The same in SI.
    missing
        Number of samples without a finite value.
    """

    heading: str
    name: str | None
    unit: str | None
    si: str | None
    low: float
    high: float
    low_si: float
    high_si: float
    missing: int


@dataclass(frozen=True, slots=True)
class TimeGridOverview:
    """Channels with common time stamps.

    Attributes
    ----------
    name
        As the file has it.
    samples
        Number of samples.
    columns
        The channels that hold numbers.
    time : s
        The time axis; None: there is none.
    place
        Unit of location of a sample: a line of a text, a row of a table.
    others
        Channels that hold no numbers, and what they hold.
    """

    name: str
    samples: int
    columns: tuple[ColumnOverview, ...]
    time: TimeAxis | None
    place: str
    others: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class FileOverview:
    """Contents of a file, whether or not `read` would accept it.

    Attributes
    ----------
    source
        Path of the file.
    format
        Format as detected from the content.
    rasters
        Channels by common time stamps.
    problems
        Why `read` would refuse the file, one sentence each.
    warnings
        What `read` would warn of.
    proposal
        A channel map made from names and units.
    needs_map
        Whether the columns do not have the standard names.
    """

    source: str
    format: str
    rasters: tuple[TimeGridOverview, ...]
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
    proposal: Proposal
    needs_map: bool

    def __str__(self) -> str:
        return self.table()

    def table(self) -> str:
        """All contents as plain text for a terminal."""
        name, channels = printable(self.source), sum(len(raster.columns) for raster in self.rasters)
        if len(self.rasters) == 1:
            lines = _raster(self.rasters[0], name)
        else:
            lines = [f"{name}: {self.format}, {len(self.rasters)} time grids with {channels} channels"]
            lines += [line for raster in self.rasters for line in ("", *_raster(raster, raster.name or "(no name)"))]
        if self.needs_map and self.proposal.channels.channels:
            lines += ["", "Proposed channel map (write it with --save, use it with --map):"]
            width = max(15, *map(len, self.proposal.channels.channels))
            lines += [
                f"  {name:<{width}}  {entry.channel}" + (f" [{entry.unit}]" if entry.unit else "")
                + (f" of {entry.group}" if entry.group else "")
                for name, entry in self.proposal.channels.channels.items()
            ]  # fmt: skip
            lines += [f"  - {remark}" for remark in (*self.proposal.open, *self.proposal.notes)]
        for title, sentences in (("Problems", self.problems), ("Warnings", self.warnings)):
            if sentences:
                lines += ["", f"{title}:", *(f"  - {sentence}" for sentence in sentences)]
        return "\n".join(lines)

    def listing(self) -> str:
        """One line per channel with time grid, unit and range, as a basis for a channel map."""
        lines = ["The file has:"]
        for raster in self.rasters:
            group = f" group = {json.dumps(raster.name, ensure_ascii=False)}" if len(self.rasters) > 1 else ""
            for column in raster.columns:
                unit = f" {column.unit}" if column.unit not in (None, "1") else ""
                text = json.dumps(column.heading, ensure_ascii=False)
                held = dict(raster.others).get(column.heading)
                what = f"{_short(column.low)} to {_short(column.high)}{unit}" if held is None else f"no numbers: {held}"
                lines.append(f"channel = {text}{group}  # {what}")
            lines += [
                f"{json.dumps(name, ensure_ascii=False)}{group}  # no numbers: {held}" for name, held in _hidden(raster)
            ]
        return "\n".join(lines)


def _raster(raster: TimeGridOverview, title: str) -> list[str]:
    lines = [f"{title}: {sample_count(raster.samples)}{_time_text(raster.time)}"]
    if raster.columns:
        held = dict(raster.others)
        rows = [_row(column, held.get(column.heading)) for column in raster.columns]
        lines += ["", *text_table([_TITLES, *rows], 2)]
    hidden = [f"'{_narrow(name)}' ({what})" for name, what in _hidden(raster)]
    if hidden:
        lines += ["", f"Without numbers: {listed(hidden, _LISTED)}"]
    time = raster.time
    if time and time.hole_count:
        shown = [f"{_short(hole.length)} s after {raster.place} {hole.place}" for hole in time.holes]
        lines += ["", f"Gaps: {listed(shown, total=time.hole_count)}"]
    return lines


def _hidden(raster: TimeGridOverview) -> list[tuple[str, str]]:
    """Channels without numbers that are no columns."""
    shown = {column.heading for column in raster.columns}
    return [other for other in raster.others if other[0] not in shown]


def _row(column: ColumnOverview, held: str | None) -> tuple[str, ...]:
    """The cells of one column in the table; `held` names its content if that is no numbers."""
    si = f" {column.si}" if column.si not in (None, "1") else ""
    converted = [f"{_short(value)}{si}" if math.isfinite(value) else "-" for value in (column.low_si, column.high_si)]
    unit = f" [{column.unit}]" if column.unit and "[" not in column.heading else ""
    return (
        column.name or f"({held or 'ignored'})",
        _narrow(column.heading) + unit,
        _short(column.low),
        _short(column.high),
        *converted,
        f"{column.missing:,}",
    )


def _narrow(name: str) -> str:
    """A name without its middle if it is too long for the table: the end often has the unit."""
    if len(name) <= _WIDTH:
        return name
    half = _WIDTH // 2
    return f"{name[: half - 1]}…{name[-half:]}"


def _time_text(time: TimeAxis | None) -> str:
    if time is None:
        return ", no time axis"
    if not math.isfinite(time.usual):
        return f" at {_short(time.first)} s"
    if time.back:  # what is made of them stands in the warnings
        times = "once" if time.back == 1 else f"{time.back:,} times"
        return f" from {_short(time.first)} s at {_short(time.rate)} Hz; the stamps go back {times}"
    rate = f"{_short(time.rate)} Hz, every {_short(time.shortest)} to {_short(time.longest)} s"
    return f", {_short(time.duration)} s from {_short(time.first)} s at {rate}"


def _short(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "-"
