"""Figures 6 to 8: all states on the verification recording, and the pressure from the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.log import FloatArray, Log
from clutchid.reports.figures import draw, label, legend, new_figure
from clutchid.reports.style import BAR, MM, STYLE, Line
from clutchid.study.paper.fits import Case
from clutchid.study.paper.pressure import Pressures, measured_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Length in s of the detail around the fastest stroke.
CLOSE = 1.6


def states_figure(case: Case) -> Figure:
    """The five states of the ballistic run on the second recording, with the measurements."""
    measured, simulated = case.verified.measured, case.verified.simulated
    figure, axes = new_figure([1.7, 1.2, 1.7, 1.2, 1.2])
    rows = (
        ("position", MM, "position\n[mm]"), ("velocity", MM, "velocity\n[mm/s]"),
        ("pressure_a", BAR, "pressure A,\nabsolute [bar]"), ("pressure_b", BAR, "pressure B,\nabsolute [bar]"),
        ("deflection", MM, "seal\ndeflection [mm]"),
    )  # fmt: skip
    t = measured.time
    for axis, (name, unit, words) in zip(axes, rows, strict=True):
        if name in ("position", "pressure_a") and name in measured:
            draw(axis, t, measured[name] / unit, Line(STYLE.measured, "measured", 2.4, opacity=0.8))
        draw(axis, t, simulated[name] / unit, Line(STYLE.blue, "simulated"))
        label(axis, y=words)
    label(axes[-1], "time [s]")
    axes[-1].set_xlim(float(t[0]), float(t[-1]))
    legend(axes[0], 2)
    figure.align_ylabels()
    return figure


def figure_8(cases: Sequence[Case], found: Sequence[Pressures]) -> Figure:
    """Pressure from Eq. (26) and from the full balance on the second recording, and close to its fastest stroke."""
    log = cases[0].verified.measured
    near = _fastest(log)
    panels = [
        (f"{number}, simulated motion", p, p.static_simulated, p.balanced_simulated)
        for number, p in zip(_titles(cases), found, strict=True)
    ]
    one = found[0]
    panels.append((f"{_titles(cases)[0]}, measured motion", one, one.static_measured, one.balanced_measured))
    figure, axes = new_figure([2.1] * len(panels), 2)
    for row, (title, p, static, balanced) in enumerate(panels):
        for axis, at in zip(axes[2 * row : 2 * row + 2], (slice(None), near), strict=True):
            if p.measured is not None:
                draw(axis, log.time[at], p.measured[at] / BAR, Line(STYLE.measured, "measured", 2.6, opacity=0.8))
            draw(axis, log.time[at], static[at] / BAR, Line(STYLE.orange, "Eq. (26)"))
            draw(axis, log.time[at], balanced[at] / BAR, Line(STYLE.blue, "full balance"))
            axis.set_xlim(float(log.time[at][0]), float(log.time[at][-1]))
        label(axes[2 * row], y="pressure A,\nabsolute [bar]", title=f"({'abc'[row]}) {title}")
    for axis in axes[-2:]:
        label(axis, "time [s]")
    legend(axes[1], 3)
    return figure


def _titles(cases: Sequence[Case]) -> list[str]:
    return [f"θ from {case.method.label}" + (" fit" if case.method.partition is None else "") for case in cases]


def _fastest(log: Log) -> slice:
    """Samples around the fastest stroke of a recording."""
    speed: FloatArray = np.abs(measured_motion(log)[1])
    centre = log.time[int(np.nanargmax(speed))]
    start, stop = np.searchsorted(log.time, [centre - CLOSE / 2, centre + CLOSE / 2])
    return slice(int(start), max(int(stop), int(start) + 2))
