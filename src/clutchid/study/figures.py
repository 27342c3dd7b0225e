"""Figures 2 to 8: basis functions, simulated states, pressures, and the load."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.figures import draw, label, legend, mark_span, new_figure, shared_legend
from clutchid.documents.style import BAR, MM, STYLE, Line
from clutchid.log import FloatArray, Log
from clutchid.model.weighted_load import Load
from clutchid.study.bundled import TrueLoad
from clutchid.study.pressure import measured_motion, pressures, static_estimate
from clutchid.study.results import BALLISTIC, PARTS_32, Case, StudyResults, chosen
from clutchid.study.tables import PRINTED_SLOPE, TABLE_1

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Below this speed in m/s the static estimate (25) is drawn.
SLOW_SPEED = 0.01

_BALLISTIC = Line(STYLE.ink, "ballistic", 1.4, layer=2.5)
_NUMBER = dict(zip((2, 4, 8, 16, 32), STYLE.ordered, strict=True))


def figure_2() -> Figure:
    """The basis functions, with both slopes of phi_2."""
    figure, (axis,) = new_figure([3.3])
    y = np.linspace(0.0, 0.025, 501)
    stated, published = Load().phi(y) / MM, Load(phi2_slope=PRINTED_SLOPE).phi(y) / MM
    draw(axis, y / MM, stated[:, 0], Line(STYLE.blue, "φ₁", 2.0))
    draw(axis, y / MM, stated[:, 1], Line(STYLE.green, "φ₂, slope 1 at t₃ (stated)", 2.0))
    draw(axis, y / MM, published[:, 1], Line(STYLE.green, "φ₂, slope 0.001 at t₃ (as published)", 1.6, (0, (5, 2))))
    draw(axis, y / MM, stated[:, 2], Line(STYLE.red, "φ₃", 2.0))
    for number, knot in enumerate([*Load().knots, 0.021]):
        axis.axvline(knot / MM, color=STYLE.measured, linewidth=0.8, linestyle=":")
        top, words = axis.get_xaxis_transform(), f"t{'₁₂₃₄₅'[number]}"
        axis.text(knot / MM, 1.0, words, transform=top, ha="center", va="bottom", fontsize=STYLE.font_size)
    label(axis, "position [mm]", "basis function [mm]")
    axis.set_xlim(-0.3, 25)
    shared_legend(axis, 2)
    return figure


def simulated_figure(cases: Sequence[Case], name: str, words: str, unit: tuple[str, float]) -> Figure:
    """A simulated column on the fitted recording, N parts, and where it was measured its errors."""
    symbol, factor = unit
    measured = cases[0].fitted.measured
    t = measured.time
    figure, (simulated, *errors) = new_figure([2.4, 1.9, 1.9] if name in measured else [3.0])
    if name in measured:
        draw(simulated, t, measured[name] / factor, Line(STYLE.measured, "measured", 3.0, opacity=0.6))
    for case in chosen(cases, "ballistic", "parts"):
        draw(simulated, t, case.fitted.simulated[name] / factor, line_of(case.method.number))
        for axis, run in zip(errors, (case.fitted, case.ballistic), strict=False):
            draw(axis, t, (run.simulated[name] - measured[name]) / factor, line_of(case.method.number))
    label(simulated, y=f"{words} [{symbol}]")
    for axis, what in zip(errors, ("fitted simulation", "ballistic run"), strict=False):
        axis.axhline(0.0, color=STYLE.measured, linewidth=0.7)
        label(axis, y=f"{what}\n− measured [{symbol}]")
    label(figure.axes[-1], "time [s]")
    simulated.set_xlim(float(t[0]), float(t[-1]))
    legend(simulated, 7)
    return figure


def line_of(number: int | None) -> Line:
    """Line style of a method by its N: ballistic thick and black, N from dark to light."""
    return _BALLISTIC if number is None else Line(_NUMBER[number], f"N = {number}", 1.1)


def figure_5(cases: Sequence[Case], log: Log, truth: TrueLoad | None) -> Figure:
    """All estimated loads, the printed ones in their basis, and the static estimate (25)."""
    figure, axes = new_figure([2.6] * 4)
    actuator = cases[0].fit.actuator
    static = static_estimate(log, actuator, SLOW_SPEED)
    y = np.linspace(0.0, actuator.parameters.y_max, 401)
    printed = [
        (replace(line_of(n), width=1.2, dash=(0, (5, 2))), Load(theta, phi2_slope=PRINTED_SLOPE))
        for n, theta in TABLE_1.items()
    ]
    panels = [
        ("(a) N equal parts, p carried", _loads(chosen(cases, "ballistic", "parts"))),
        ("(b) every N samples, p carried", _loads(chosen(cases, "ballistic", "every"))),
        ("(c) every N samples, q carried", _loads(chosen(cases, "ballistic", "every", carry="q"))),
        ("(d) printed Table 1, slope 0.001", printed),
    ]
    for axis, (title, curves) in zip(axes, panels, strict=True):
        mark_span(axis, 5, 8)
        if axis is not axes[-1]:  # the printed loads are of another truck
            _load_background(axis, static, truth)
        for line, load in curves:
            draw(axis, y / MM, load.force(y), line)
        label(axis, y="load [N]", title=title)
    label(axes[-1], "position [mm]")
    axes[-1].set_xlim(0, float(y[-1]) / MM)
    shared_legend(axes[0])
    everything = np.concatenate([load.force(y) for _, curves in panels for _, load in curves])
    for axis in axes:
        axis.set_ylim(min(0.0, 1.1 * float(everything.min())), 1.08 * float(everything.max()))
    return figure


def _loads(cases: Sequence[Case]) -> list[tuple[Line, Load]]:
    return [(line_of(case.method.number), case.fit.actuator.load) for case in cases]


def _load_background(axis: Axes, static: tuple[FloatArray, FloatArray], truth: TrueLoad | None) -> None:
    """References for the estimated loads: the static estimate of the recording, and the true load."""
    position, force = static
    if truth is not None:
        draw(axis, truth.position / MM, truth.force, Line(STYLE.orange, "true load", 3.4, layer=1.6))
    if position.size:
        step = max(1, position.size // 3000)
        axis.plot(
            position[::step] / MM, force[::step], "o", markersize=1.7, color=STYLE.measured, alpha=0.5,
            markeredgewidth=0, label="Eq. (25), slow", zorder=1.7,
        )  # fmt: skip


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
    return figure


def figure_8(cases: Sequence[Case]) -> Figure:
    """Pressure from Eq. (26) and from the full balance on the second recording, and close to its fastest stroke."""
    log = cases[0].verified.measured
    near, measured = _fastest(log), Line(STYLE.measured, "measured", 2.6, opacity=0.8)
    titles = [f"θ from {case.method.label}" + (" fit" if case.method.partition is None else "") for case in cases]
    every = [pressures(case.fit.actuator, case.verified) for case in cases]
    panels = [
        (f"{title}, simulated motion", samples.static_simulated, samples.balanced_simulated)
        for title, samples in zip(titles, every, strict=True)
    ]
    panels.append((f"{titles[0]}, measured motion", every[0].static_measured, every[0].balanced_measured))
    figure, axes = new_figure([2.1] * len(panels), 2)
    for row, (title, static, balanced) in enumerate(panels):
        for axis, at in zip(axes[2 * row : 2 * row + 2], (slice(None), near), strict=True):
            if "pressure_a" in log:
                draw(axis, log.time[at], log["pressure_a"][at] / BAR, measured)
            draw(axis, log.time[at], static[at] / BAR, Line(STYLE.orange, "Eq. (26)"))
            draw(axis, log.time[at], balanced[at] / BAR, Line(STYLE.blue, "full balance"))
            axis.set_xlim(float(log.time[at][0]), float(log.time[at][-1]))
        label(axes[2 * row], y="pressure A,\nabsolute [bar]", title=f"({'abc'[row]}) {title}")
    for axis in axes[-2:]:
        label(axis, "time [s]")
    shared_legend(axes[0], 3)
    return figure


def _fastest(log: Log) -> slice:
    """Samples around the fastest stroke of a recording."""
    speed: FloatArray = np.abs(measured_motion(log)[1])
    centre = log.time[int(np.nanargmax(speed))]
    start, stop = np.searchsorted(log.time, [centre - CLOSE / 2, centre + CLOSE / 2])
    return slice(int(start), max(int(stop), int(start) + 2))


#: Figures by the paper's number.
FIGURES: Mapping[int, Callable[[StudyResults], Figure]] = {
    2: lambda _: figure_2(),
    3: lambda study: simulated_figure(study.cases, "position", "position", ("mm", MM)),
    4: lambda study: simulated_figure(study.cases, "pressure_a", "pressure A, absolute", ("bar", BAR)),
    5: lambda study: figure_5(study.cases, study.fit_log, study.truth),
    6: lambda study: states_figure(study.case(BALLISTIC)),
    7: lambda study: states_figure(study.case(PARTS_32)),
    8: lambda study: figure_8([study.case(BALLISTIC), study.case(PARTS_32)]),
}
