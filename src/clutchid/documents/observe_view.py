"""Present estimates of an observer, as a few lines of plain text: load curve, pressure, health."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.observe_rows import flags_words
from clutchid.documents.style import MM
from clutchid.estimation import LoadCurve
from clutchid.numerics.interval import QUANTILE
from clutchid.observer import ObservedRecording, curve, start

if TYPE_CHECKING:
    from clutchid.observer.live import LiveRun

#: Lines of the load curve, characters of the labels left of it, and characters of its width at most.
_ROWS, _LABELS, _WIDEST = 12, 8, 100

#: Pressure in Pa at the end of its bar.
_FULL = 10e5

#: Characters of the load, of its band, and of the load as calibrated.
_LOAD, _WITHIN, _CALIBRATED = "*", ".", "o"


def observe_view(run: LiveRun, part: ObservedRecording, width: int) -> str:
    """Lines of at most `width` characters about a recording after the block `part`, in ASCII."""
    inner = max(20, min(width, _WIDEST) - _LABELS - 2)
    lines = [_now(run, part), _pressure(run, part, inner), *_load(run, inner), flags_words(run.health or {})]
    return "\n".join(line[:width] for line in lines)


def _now(run: LiveRun, part: ObservedRecording) -> str:
    position = part.log["position"][-1] / MM if len(part.log) else np.nan
    strokes = run.after.strokes.ended - run.before.strokes.ended
    return f"{part.log.name}  {run.latest:.2f} s  position {position:.2f} mm  strokes {strokes}"


def _pressure(run: LiveRun, part: ObservedRecording, inner: int) -> str:
    """The pressure in chamber A as a bar and a number with its band."""
    at = run.observer.actuator.states.index("p_A")
    value = float(part.samples.states[-1, at]) if len(part.log) else np.nan
    half = QUANTILE * float(run.after.deviations[at])
    if not np.isfinite(value):
        return f"{'pressure':>{_LABELS}} unknown"
    text = f" {value / 1e3:.0f} kPa" + (f" +-{half / 1e3:.0f}" if np.isfinite(half) else "")
    size = max(1, inner - len(text) - 2)
    full = round(size * min(max(value / _FULL, 0.0), 1.0))
    return f"{'pressure':>{_LABELS}} [{'#' * full}{' ' * (size - full)}]{text}"


def _load(run: LiveRun, inner: int) -> list[str]:
    """The load over the position with its band, and as calibrated."""
    stroke = run.observer.actuator.parameters.y_max
    position = np.linspace(0.0, stroke, inner)
    now, before = curve(run.observer, run.after, position), curve(run.observer, start(run.observer), position)
    top = 1000.0 * np.ceil(max(now.high.max(), before.force.max(), 1.0) / 1000.0)
    picture = _picture(now, before, top)
    labels = {0: f"{top:.0f} N", _ROWS - 1: "0"}
    rows = [f"{labels.get(i, ''):>{_LABELS}} |{''.join(row).rstrip()}" for i, row in enumerate(picture)]
    end = f"{stroke / MM:.0f} mm"
    return [
        *rows,
        f"{'':>{_LABELS}} +{'-' * inner}",
        f"{'':>{_LABELS}}  0{end:>{inner - 1}}",
        _half(run),
    ]


def _half(run: LiveRun) -> str:
    """Legend of the characters, and the load at half stroke."""
    half = [0.5 * run.observer.actuator.parameters.y_max]
    now, before = curve(run.observer, run.after, half), curve(run.observer, start(run.observer), half)
    return (
        f"{_LOAD} load ({_WITHIN} 95 % band)  {_CALIBRATED} as calibrated; at {half[0] / MM:.1f} mm "
        f"{now.force[0]:.0f} N, as calibrated {before.force[0]:.0f} N"
    )


def _picture(now: LoadCurve, before: LoadCurve, top: float) -> list[list[str]]:
    """Characters by row, from the top, and column; the load covers what else is there."""
    picture = [[" "] * now.position.size for _ in range(_ROWS)]

    def row(force: float) -> int:
        return _ROWS - 1 - round((_ROWS - 1) * min(max(force / top, 0.0), 1.0))

    for i in range(now.position.size):
        for at in range(row(now.high[i]), row(now.low[i]) + 1):
            picture[at][i] = _WITHIN
        picture[row(before.force[i])][i] = _CALIBRATED
        picture[row(now.force[i])][i] = _LOAD
    return picture
