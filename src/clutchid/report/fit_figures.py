"""Figures of a fit: the load with its band, and each recording beside its simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.estimate import Fit
from clutchid.estimate.result import Recording
from clutchid.log import FloatArray
from clutchid.report.figures import draw, label, legend, mark_span, new_figure
from clutchid.report.style import BAR, KN, MM, STYLE, Line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Where the clutch engages and the load must be known best, in m, Section 3.1.
ENGAGING = (5e-3, 8e-3)


def reach(fit: Fit) -> float:
    """Furthest position in m that was measured in the fitted recordings; NaN without one."""
    tops = [np.nanmax(r.measured["position"]) for r in fit.recordings.values()]
    return float(max(tops)) if tops else float("nan")


def load_figure(fit: Fit) -> Figure:
    """The load over the position with its 95 % band where that is finite, and how far the recordings reach."""
    curve, furthest = fit.load_curve, reach(fit)
    figure, (axis,) = new_figure([3.7])
    x, force = curve.position / MM, curve.force / KN
    mark_span(axis, ENGAGING[0] / MM, ENGAGING[1] / MM, "where the clutch engages, 5 to 8 mm")
    banded = np.isfinite(curve.low) & np.isfinite(curve.high)
    band = {"where": banded.tolist(), "color": STYLE.blue, "alpha": 0.2, "linewidth": 0}
    axis.fill_between(x, curve.low / KN, curve.high / KN, label="95 % band", **band)
    inside = curve.position <= furthest
    draw(axis, x[inside], force[inside], Line(STYLE.blue, "load", 2.0))
    outside = curve.position >= (curve.position[inside][-1] if inside.any() else 0.0)
    if not inside.all():
        draw(axis, x[outside], force[outside], Line(STYLE.blue, "load where nothing was recorded", 1.4, (0, (4, 3))))
    words = f"reach of the recordings, {furthest / MM:.1f} mm"
    axis.axvline(furthest / MM, color=STYLE.ink, linewidth=1.0, linestyle=":", label=words)
    axis.set_xlim(0, x[-1])
    band_edges = np.concatenate([curve.low[banded], curve.high[banded]]) / KN
    axis.set_ylim(*_limits(np.append(force, 0.0), band_edges))
    label(axis, "position [mm]", "load [kN]")
    legend(axis, "lower center")
    return figure


def _limits(force: FloatArray, band: FloatArray) -> tuple[float, float]:
    """Limits that show the curve, and the band unless it is far wider than the curve."""
    low, high = float(np.nanmin(force)), float(np.nanmax(force))
    room = max(high - low, 1e-3)
    if band.size:
        low, high = max(low - room, min(low, float(band.min()))), min(high + room, max(high, float(band.max())))
    return low - 0.05 * (high - low), high + 0.08 * (high - low)


def recording_figure(recording: Recording) -> Figure:
    """Measured and simulated position, their difference, pressure and duty cycles over time."""
    measured, simulated = recording.measured, recording.simulated
    figure, (position, error, pressure, duty) = new_figure([2.0, 1.25, 1.7, 1.05])
    t = measured.time
    draw(position, t, measured["position"] / MM, Line(STYLE.measured, "measured", 2.2))
    draw(position, t, simulated["position"] / MM, Line(STYLE.blue, "simulated"))
    draw(error, t, (simulated["position"] - measured["position"]) / MM, Line(STYLE.red, "", 0.8))
    error.axhline(0.0, color=STYLE.ink, linewidth=0.7)
    if "pressure_a" in measured:
        draw(pressure, t, measured["pressure_a"] / BAR, Line(STYLE.measured, "measured", 2.2))
    draw(pressure, t, simulated["pressure_a"] / BAR, Line(STYLE.blue, "simulated"))
    draw(duty, t, measured["duty_supply"], Line(STYLE.green, "supply", 0.9))
    draw(duty, t, -measured["duty_exhaust"], Line(STYLE.purple, "exhaust, drawn downwards", 0.9))
    label(position, y="position [mm]")
    label(error, y="simulated −\nmeasured [mm]")
    label(pressure, y="pressure A,\nabsolute [bar]")
    label(duty, "time [s]", "duty cycle [1]")
    duty.set_xlim(float(t[0]), float(t[-1]))
    for axis in (position, pressure, duty):
        legend(axis, "above", 2)
    figure.align_ylabels()
    return figure
