"""Drawing: thinning keeps what one must see, and matplotlib's global state stays untouched."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from clutchid.report.figures import draw, label, legend, new_figure, png, thinned
from clutchid.report.fit_figures import load_figure, recording_figure
from clutchid.report.style import STYLE, Line

numbers = st.floats(-1e6, 1e6) | st.just(float("nan"))


@given(arrays(np.float64, st.integers(1, 400), elements=numbers), st.integers(1, 60))
def test_thinning_keeps_the_extremes_and_the_order_of_time(y, bins):
    x = np.arange(y.size, dtype=np.float64)
    x_thin, y_thin = thinned(x, y, bins)
    assert x_thin.size <= max(2 * bins, 1)
    assert np.all(np.diff(x_thin) >= 0)
    assert np.isnan(y).all() == np.isnan(y_thin).all()
    if not np.isnan(y).all():
        assert np.nanmin(y_thin) == np.nanmin(y)
        assert np.nanmax(y_thin) == np.nanmax(y)


def test_a_short_curve_is_drawn_as_it_is():
    x = np.arange(10.0)
    assert thinned(x, x, 5)[0] is x


def _picture() -> bytes:
    figure, (axis,) = new_figure([1.0])
    draw(axis, np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0]), Line(STYLE.blue, "curve"))
    label(axis, "time [s]", "position [mm]", "title")
    legend(axis, "above")
    return png(figure)


def test_the_same_figure_has_the_same_bytes():
    assert _picture() == _picture()
    assert _picture().startswith(b"\x89PNG\r\n\x1a\n")


def test_a_panel_without_labels_has_no_legend():
    figure, (axis,) = new_figure([1.0])
    legend(axis)
    assert axis.get_legend() is None
    assert figure.axes == [axis]


def test_the_band_of_a_load_is_drawn_only_where_it_is_finite(fitted):
    whole = load_figure(fitted).axes[0].collections[0].get_paths()[0].vertices
    curve = fitted.load_curve
    beyond = curve.position > 10e-3
    cut = type(curve)(
        curve.position, curve.force, np.where(beyond, -np.inf, curve.low), np.where(beyond, np.inf, curve.high)
    )
    part = load_figure(replace(fitted, load_curve=cut)).axes[0].collections[0].get_paths()[0].vertices
    assert whole[:, 0].max() == 25.0
    assert part[:, 0].max() == 10.0
    assert np.isfinite(part).all()


def test_panels_of_a_recording_show_millimetres_and_bar(fitted):
    recording = fitted.recordings["first"]
    position, error, pressure, duty = recording_figure(recording).axes
    measured, simulated = recording.measured, recording.simulated
    assert position.lines[0].get_ydata().max() == measured["position"].max() / 1e-3
    assert np.abs(error.lines[0].get_ydata()).max() == np.abs(simulated["position"] - measured["position"]).max() / 1e-3
    assert pressure.lines[1].get_ydata().max() == simulated["pressure_a"].max() / 1e5
    assert "[mm]" in position.get_ylabel()
    assert "[mm]" in error.get_ylabel()
    assert "[bar]" in pressure.get_ylabel()
    assert duty.lines[1].get_ydata().min() == -measured["duty_exhaust"].max()


def test_the_load_figure_shows_kilonewtons_over_millimetres(fitted):
    (axis,) = load_figure(fitted).axes
    assert axis.lines[0].get_ydata().max() == fitted.load_curve.force.max() / 1e3
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("position [mm]", "load [kN]")
    assert axis.get_xlim()[1] == 25.0


def test_importing_reports_is_light_and_drawing_leaves_global_settings_alone():
    code = """
import sys
import clutchid.report, clutchid.study
assert not {"matplotlib", "jinja2", "sympy"} & set(sys.modules), sorted(sys.modules)
import matplotlib
before = matplotlib.rcParams.copy()
from clutchid.report.figures import new_figure, png
png(new_figure([1.0])[0])
assert "matplotlib.pyplot" not in sys.modules
assert before == matplotlib.rcParams.copy()
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
