"""Figures of the residuals of a recording: autocorrelation, correlation with the valves, and error by region."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.estimation.assess.diagnostics import ColumnDiagnosis, Diagnosis
from clutchid.log import FloatArray
from clutchid.reports.figures import label, new_figure, shared_legend
from clutchid.reports.style import MM, STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Name, display unit in SI, and its symbol, for the residual of a column.
SHOWN = {"position": ("position", MM, "mm"), "pressure_a": ("pressure A", 1e3, "kPa")}

_WAYS = (("opening", STYLE.blue), ("closing", STYLE.orange), ("hold", STYLE.measured))


def colour_figure(diagnosis: Diagnosis) -> Figure:
    """Autocorrelation of the residuals and their correlation with both valves, three panels a measured column."""
    columns = list(diagnosis.columns.items())
    figure, axes = new_figure([1.6] * 3 * len(columns), share_x=False)
    for row, (name, column) in enumerate(columns):
        own, supply, exhaust = axes[3 * row : 3 * row + 3]
        fast = column.fast
        _stems(own, fast.lag[1:], fast.autocorrelation[1:], fast.bound[1:])
        label(own, y="correlation [1]", title=f"{SHOWN[name][0]}: autocorrelation")
        for axis, key in ((supply, "duty_supply"), (exhaust, "duty_exhaust")):
            found = fast.inputs.get(key)
            if found is not None:
                _stems(axis, found.lag, found.correlation, found.bound)
            else:
                axis.text(0.5, 0.5, "constant", ha="center", va="center", transform=axis.transAxes)
            label(axis, y="correlation [1]", title=f"{SHOWN[name][0]}: with the {key.removeprefix('duty_')} valve")
    label(axes[-1], "lag [ms]")
    figure.align_ylabels()
    return figure


def _stems(axis: Axes, lag: FloatArray, values: FloatArray, bound: FloatArray) -> None:
    """Correlations over the lag with their 99 % bounds; NaN is not drawn."""
    ms = lag * 1e3
    axis.fill_between(ms, -bound, bound, color=STYLE.measured, alpha=0.3, linewidth=0)
    axis.vlines(ms, 0.0, values, color=STYLE.blue, linewidth=1.3)
    axis.axhline(0.0, color=STYLE.ink, linewidth=0.7)
    largest = float(np.nanmax(np.abs(np.concatenate([values, bound])), initial=0.0))
    axis.set_ylim(-1.15 * max(largest, 0.1), 1.15 * max(largest, 0.1))


def region_figure(diagnosis: Diagnosis) -> Figure:
    """Rms error by stroke region and direction, one panel per measured column."""
    columns = list(diagnosis.columns.items())
    figure, axes = new_figure([2.4] * len(columns), share_x=False)
    for axis, (name, column) in zip(axes, columns, strict=True):
        _bars(axis, column, SHOWN[name][1])
        label(axis, "measured position [mm]", f"rms [{SHOWN[name][2]}]", f"error of {SHOWN[name][0]}")
    shared_legend(axes[0])
    return figure


def _bars(axis: Axes, column: ColumnDiagnosis, unit: float) -> None:
    lows = sorted({region.low for region in column.regions})
    names = {region.low: _span(region.low, region.high) for region in column.regions}
    for k, (way, colour) in enumerate(_WAYS):
        found = {region.low: region.rms / unit for region in column.regions if region.direction == way}
        x = [lows.index(low) + 0.27 * (k - 1) for low in found]
        axis.bar(x, list(found.values()), 0.25, color=colour, label="during holds" if way == "hold" else way)
    axis.axhline(column.rms / unit, color=STYLE.ink, linewidth=0.9, linestyle=":", label="overall")
    axis.set_xticks(range(len(lows)), [names[low] for low in lows])


def _span(low: float, high: float) -> str:
    return f"{low / MM:.0f}–{high / MM:.0f}" if np.isfinite(high) else f"{low / MM:.0f}+"
