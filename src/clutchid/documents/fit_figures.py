"""Figures of a fit: load curve with its band, and each recording with its simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.figures import (
    BINS,
    draw,
    draw_duties,
    draw_over_time,
    fill,
    fill_over_time,
    label,
    legend,
    mark_span,
    new_figure,
)
from clutchid.documents.style import BAR, MM, STYLE, Line
from clutchid.estimation import Fit, Recording
from clutchid.estimation.assess.comparison import ENGAGING, half_load_band
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.verdict import noise_only
from clutchid.log import BoolArray, FloatArray, Log
from clutchid.parameters import Parameters
from clutchid.strokes.excitation import vented_rests

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def reliable(measured: Log, p: Parameters, reach: float) -> BoolArray:
    """Samples between the first and the last vented rest and within `reach` in m, where the load is known.

    At a vented rest the pressure is known without a sensor. Before the first and after the last one the pressure is
    constrained from one side only, and beyond the reach the load is not estimated from data.
    """
    rests = vented_rests(measured, p)
    number = np.arange(len(measured))
    if not rests:
        return np.zeros(len(measured), dtype=bool)
    position = measured["position"]
    within = ~(position > reach)
    return (number >= rests[0][0]) & (number < rests[-1][1]) & within


def load_figure(fit: Fit) -> Figure:
    """Load over position with its 95 % band where finite, half its peak, and the reach of the recordings."""
    curve, furthest = fit.load_curve, reach(fit)
    figure, (axis,) = new_figure([3.7])
    x, force = curve.position / MM, curve.force
    mark_span(axis, ENGAGING[0] / MM, ENGAGING[1] / MM, "engagement, 5 to 8 mm")
    banded = np.isfinite(curve.low) & np.isfinite(curve.high)
    band = "95 % band, noise only" if noise_only(fit) else "95 % band"
    fill(axis, x, curve.low, curve.high, Line(STYLE.blue, band, opacity=0.2, layer=1))
    inside = curve.position <= furthest
    draw(axis, x[inside], force[inside], Line(STYLE.blue, "load", 2.0))
    outside = curve.position >= (curve.position[inside][-1] if inside.any() else 0.0)
    if not inside.all():
        draw(axis, x[outside], force[outside], Line(STYLE.blue, "beyond the reach", 1.4, (0, (4, 3))))
    _mark_half(axis, fit, furthest)
    words = f"reach, {furthest / MM:.1f} mm"
    axis.axvline(furthest / MM, color=STYLE.ink, linewidth=1.0, linestyle=":", label=words)
    axis.set_xlim(0, x[-1])
    limiting = banded & inside if np.any(banded & inside) else banded
    band_edges = np.concatenate([curve.low[limiting], curve.high[limiting]])
    axis.set_ylim(*_limits(np.append(force[inside] if inside.any() else force, 0.0), band_edges))
    label(axis, "position [mm]", "load [N]")
    legend(axis, 3)
    return figure


def _mark_half(axis: Axes, fit: Fit, furthest: float) -> None:
    """Mark the position at which the load reaches half its peak, with its interval."""
    at = half_load_band(fit.load_curve, furthest)
    if not np.isfinite(at.position):
        return
    force = float(np.interp(at.position, fit.load_curve.position, fit.load_curve.force))
    ends = np.clip([at.position - at.low, at.high - at.position], 0.0, None) / MM
    error = ends[:, None] if np.isfinite(ends).all() else None
    axis.errorbar(
        [at.position / MM], [force], xerr=error, fmt="o", markersize=3.2, color=STYLE.red, capsize=3.5, linewidth=1.2,
        label=f"half of the peak, {at.position / MM:.2f} mm", zorder=4,
    )  # fmt: skip


def _limits(force: FloatArray, band: FloatArray) -> tuple[float, float]:
    """Axis limits for the curve, and for the band unless it is much wider than the curve."""
    low, high = float(np.nanmin(force)), float(np.nanmax(force))
    high = max(high, low + 1e-3)
    room = high - low
    if band.size:
        low, high = max(low - room, min(low, float(band.min()))), min(high + room, max(high, float(band.max())))
    return low - 0.05 * (high - low), high + 0.08 * (high - low)


def recording_figure(recording: Recording, reliable: BoolArray | None = None) -> Figure:
    """Measured and simulated position and pressure, their differences, and the duty cycles, over time.

    `reliable` is given if the pressure was not used in the fit: a grey background marks where it is unreliable.
    """
    measured, simulated = recording.measured, recording.simulated
    with_pressure = "pressure_a" in measured
    figure, axes = new_figure([2.0, 1.15, 1.8, *([1.15] if with_pressure else []), 1.05])
    position, error, pressure, duty = axes[0], axes[1], axes[2], axes[-1]
    t = measured.time
    draw_over_time(position, t, measured["position"] / MM, Line(STYLE.measured, "measured", 2.2))
    draw_over_time(position, t, simulated["position"] / MM, Line(STYLE.blue, "simulated"))
    _difference(error, t, (measured["position"] - simulated["position"]) / MM)
    _pressure(pressure, measured, simulated, reliable)
    if with_pressure:
        _difference(axes[3], t, (measured["pressure_a"] - simulated["pressure_a"]) / 1e3)
        label(axes[3], y="measured −\nsimulated [kPa]")
    draw_duties(duty, measured)
    label(position, y="position [mm]")
    label(error, y="measured −\nsimulated [mm]")
    label(pressure, y="pressure A,\nabsolute [bar]")
    for axis in (position, pressure, duty):
        legend(axis, 4)
    return figure


def _difference(axis: Axes, t: FloatArray, residual: FloatArray) -> None:
    draw_over_time(axis, t, residual, Line(STYLE.red, "", 0.8))
    axis.axhline(0.0, color=STYLE.ink, linewidth=0.7)


def _pressure(axis: Axes, measured: Log, simulated: Log, reliable: BoolArray | None) -> None:
    """Simulated pressure with its band, measured pressure, and a grey background where it is unreliable."""
    t, name = measured.time, "simulated" if reliable is None else "from the position"
    if reliable is not None and not reliable.all():
        starts = np.arange(0, t.size, max(1, -(-t.size // BINS)))
        unreliable = np.logical_or.reduceat(~reliable, starts)
        axis.fill_between(
            t[starts], 0.0, 1.0, where=unreliable.tolist(), transform=axis.get_xaxis_transform(), color=STYLE.grid,
            linewidth=0, label="unreliable: no vented rest, or beyond the reach", zorder=0,
        )  # fmt: skip
    if "pressure_a" in measured:
        draw_over_time(axis, t, measured["pressure_a"] / BAR, Line(STYLE.measured, "measured", 2.2))
    if "pressure_a low" in simulated:
        low, high = simulated["pressure_a low"] / BAR, simulated["pressure_a high"] / BAR
        fill_over_time(axis, t, low, high, Line(STYLE.blue, "95 % band", opacity=0.3))
    draw_over_time(axis, t, simulated["pressure_a"] / BAR, Line(STYLE.blue, name))
