"""Results of an observer while they arise, as JSON lines."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np

from clutchid.documents.fit_json import curve_json
from clutchid.documents.json_text import json_text
from clutchid.log import FloatArray
from clutchid.measurements import to_frame
from clutchid.observer import ObservedRecording, StrokeRow
from clutchid.observer.live import LiveRun


def observe_lines(after: LiveRun, part: ObservedRecording) -> list[str]:
    """Lines of a block: its samples, its strokes behind the sample that ends them, and its faults if there are any.

    Each is a JSON object, null for what is not finite. A sample has the columns of `ObservedRecording.estimates` under
    the same headings; a stroke has ``stroke``, ``parameters`` and ``load_curve``; faults are the seconds so far, in
    ``health``.

    Parameters
    ----------
    after
        The recording after the block.
    """
    lines = _samples(part)
    ends = np.searchsorted(part.log.time, [row.time for row in part.strokes], side="right")
    for at, row in reversed(list(zip(ends.tolist(), part.strokes, strict=True))):
        lines.insert(at, _stroke(row))
    if any(part.health.values()):
        lines.append(json.dumps({"time [s]": after.latest, "health": dict(after.health or {})}))
    return lines


def _samples(part: ObservedRecording) -> list[str]:
    frame = to_frame(part.estimates())
    columns = [_known(frame[name].to_numpy()) for name in frame.columns]
    return [json.dumps(dict(zip(frame.columns, values, strict=True))) for values in zip(*columns, strict=True)]


def _known(values: FloatArray) -> list[float | None]:
    entries: list[float | None] = values.tolist()
    for i in np.flatnonzero(~np.isfinite(values)).tolist():
        entries[i] = None
    return entries


def _stroke(row: StrokeRow) -> str:
    parameters = {name: asdict(estimate) for name, estimate in row.estimates.items()}
    return json_text({
        "time [s]": row.time, "stroke": row.number, "parameters": parameters, "load_curve": curve_json(row.curve),
    })  # fmt: skip
