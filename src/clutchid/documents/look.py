"""A look at a file as a document: its contents and the checks on it."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from clutchid.documents.document import Document, LabelRow
from clutchid.documents.results import Looked

if TYPE_CHECKING:
    from clutchid.measurements.look import TimeAxis, TimeGridOverview
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.preparation.inspection import Check


def look_document(looked: Looked, command: str = "") -> Document:
    """Document of a look at a file."""
    rows = (LabelRow(None, looked.contents.table(), fixed=True), LabelRow(None, f"\n{looked.checks}", fixed=True))
    return Document("Look at a file", rows=rows, data=lambda: look_json(looked), command=command)


def look_json(looked: Looked) -> dict[str, Any]:
    """The JSON object of ``clutchid look``, docs/formats.md."""
    contents, inspection, unchecked = looked.contents, looked.inspection, looked.unchecked
    checks = inspection.checks if inspection else ()
    poor = any(check.grade in ("bad", "suspect") for check in checks) or bool(contents.warnings) or bool(unchecked)
    return {
        "status": "bad_input" if contents.problems else "warning" if poor else "ok",
        "message": "\n".join(contents.problems) or unchecked,
        "format": contents.format,
        "grids": [_grid_json(grid) for grid in contents.rasters],
        "channels": [
            {"group": grid.name, "samples": grid.samples, **asdict(column)}
            for grid in contents.rasters
            for column in grid.columns
        ],
        "checks": [_check_json(check) for check in checks],
        "notes": [*(inspection.notes if inspection else ())],
        "problems": [*contents.problems],
        "warnings": [*contents.warnings],
        "map": map_json(contents.proposal.channels),
        "remarks": [*contents.proposal.open, *contents.proposal.notes],
        "needs_map": contents.needs_map,
        "complete": contents.proposal.complete,
    }


def _check_json(check: Check) -> dict[str, Any]:
    """A check, with the place where it fails in s, if it has one."""
    entries = asdict(check)
    return {**entries, "begin_s": entries.pop("begin"), "end_s": entries.pop("end")}


def _grid_json(grid: TimeGridOverview) -> dict[str, Any]:
    """A time grid: name, samples, time axis in s, and the channels without numbers."""
    return {
        "name": grid.name,
        "samples": grid.samples,
        "time": None if grid.time is None else _time_json(grid.time),
        "without_numbers": [{"channel": name, "holds": what} for name, what in grid.others],
    }


def _time_json(time: TimeAxis) -> dict[str, Any]:
    return {
        "first_s": time.first,
        "last_s": time.last,
        "usual_interval_s": time.usual,
        "shortest_interval_s": time.shortest,
        "longest_interval_s": time.longest,
        "holes": [{"start_s": hole.start, "length_s": hole.length} for hole in time.holes],
        "hole_count": time.hole_count,
        "repeated": time.repeated,
        "decreasing": time.back,
    }


def map_json(channels: ChannelMap) -> dict[str, Any]:
    """A channel map as a JSON object: the entries of the TOML file by quantity."""
    return {name: asdict(entry) for name, entry in channels.channels.items()}
