"""What `look` found, as plain text for a terminal."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

from clutchid.io.table import and_more
from clutchid.text_table import text_table

if TYPE_CHECKING:
    from clutchid.io.look import ColumnLook, Look, RasterLook
    from clutchid.io.time_look import TimeLook

_TITLES = ("column", "as written", "from", "to", "in SI from", "to", "missing")


def look_text(seen: Look) -> str:
    """Everything that was seen of a file.

    Raises
    ------
    Nothing.
    """
    samples = max((raster.samples for raster in seen.rasters), default=0)
    lines = []
    if len(seen.rasters) < 2:
        time = seen.rasters[0].time if seen.rasters else None
        lines.append(f"{seen.source}: {_samples(samples)}{_time_text(time)}")
    else:
        channels = sum(len(raster.columns) for raster in seen.rasters)
        lines.append(f"{seen.source}: {seen.format}, {len(seen.rasters)} rasters with {channels} channels")
    for raster in seen.rasters:
        lines += _raster(raster, len(seen.rasters) > 1)
    if seen.needs_map and seen.proposal.channels.channels:
        lines += ["", "Proposed channel map (--save writes it, --map takes it):"]
        lines += [
            f"  {name:<15}  {entry.channel}" + (f" [{entry.unit}]" if entry.unit else "")
            + (f" of {entry.group}" if entry.group else "")
            for name, entry in seen.proposal.channels.channels.items()
        ]  # fmt: skip
        lines += [f"  - {remark}" for remark in seen.proposal.open]
    for title, sentences in (("Problems", seen.problems), ("Warnings", seen.warnings)):
        if sentences:
            lines += ["", f"{title}:", *(f"  - {sentence}" for sentence in sentences)]
    return "\n".join(lines)


def listing(seen: Look) -> str:
    """Every channel of a file, a line each.

    Raises
    ------
    Nothing.
    """
    lines = ["The file has:"]
    for raster in seen.rasters:
        group = f" group = {json.dumps(raster.name, ensure_ascii=False)}" if len(seen.rasters) > 1 else ""
        for column in raster.columns:
            unit = f" {column.unit}" if column.unit not in (None, "1") else ""
            text = json.dumps(column.heading, ensure_ascii=False)
            lines.append(f"channel = {text}{group}  # {_short(column.low)} to {_short(column.high)}{unit}")
    return "\n".join(lines)


def _raster(raster: RasterLook, named: bool) -> list[str]:
    lines = []
    if named:
        lines += ["", f"{raster.name or '(no name)'}: {_samples(raster.samples)}{_time_text(raster.time)}"]
    if raster.columns:
        lines += [*([] if named else [""]), *text_table([_TITLES, *map(_row, raster.columns)], 2)]
    time = raster.time
    if time and time.hole_count:
        shown = [f"{_short(hole.length)} s after {raster.place} {hole.place}" for hole in time.holes]
        lines += ["", f"Holes: {and_more(shown, time.hole_count - len(shown))}"]
    if time and (time.repeated or time.back):
        lines += ["", f"Stamps: {time.repeated:,} repeated, the clock goes back {time.back:,} times"]
    return lines


def _row(column: ColumnLook) -> tuple[str, ...]:
    """The cells of one column in the table."""
    si = f" {column.si}" if column.si not in (None, "1") else ""
    in_unit = [_short(column.low), _short(column.high)]
    converted = [f"{_short(value)}{si}" if math.isfinite(value) else "-" for value in (column.low_si, column.high_si)]
    unit = f" [{column.unit}]" if column.unit and "[" not in column.heading else ""
    return (column.name or "(ignored)", column.heading + unit, *in_unit, *converted, f"{column.missing:,}")


def _samples(count: int) -> str:
    return f"{count:,} sample{'' if count == 1 else 's'}"


def _time_text(time: TimeLook | None) -> str:
    if time is None:
        return ", no time axis"
    if not math.isfinite(time.usual):
        return f" at {_short(time.first)} s"
    rate = f"{_short(time.rate)} Hz, every {_short(time.shortest)} to {_short(time.longest)} s"
    return f", {_short(time.duration)} s from {_short(time.first)} s at {rate}"


def _short(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "-"
