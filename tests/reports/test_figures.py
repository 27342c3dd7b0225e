"""Drawing: thinning keeps what one must see, and matplotlib's global state stays untouched."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from clutchid.reports.figures import draw, label, legend, new_figure, png, thinned, thinned_band
from clutchid.reports.fit_figures import load_figure, recording_figure
from clutchid.reports.style import STYLE, Line

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


@given(arrays(np.float64, st.integers(1, 400), elements=numbers), st.integers(1, 60))
def test_a_thinned_band_keeps_its_lowest_and_its_highest(y, bins):
    x = np.arange(y.size, dtype=np.float64)
    _, low, high = thinned_band(x, y - 1.0, y + 1.0, bins)
    assert low.size <= 2 * bins
    assert np.isnan(y).all() == np.isnan(low).all()
    if not np.isnan(y).all():
        assert np.nanmin(low) == np.nanmin(y - 1.0)
        assert np.nanmax(high) == np.nanmax(y + 1.0)


def test_a_short_curve_is_drawn_as_it_is():
    x = np.arange(10.0)
    assert thinned(x, x, 5)[0] is x


def _picture() -> bytes:
    figure, (axis,) = new_figure([1.0])
    draw(axis, np.arange(5.0), np.array([0.0, 1.0, np.nan, 1.0, 0.0]), Line(STYLE.blue, "curve"))
    label(axis, "time [s]", "position [mm]", "title")
    legend(axis)
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
    position, error, pressure, missed, duty = recording_figure(recording).axes
    measured, simulated = recording.measured, recording.simulated
    assert position.lines[0].get_ydata().max() == measured["position"].max() / 1e-3
    assert np.abs(error.lines[0].get_ydata()).max() == np.abs(simulated["position"] - measured["position"]).max() / 1e-3
    assert pressure.lines[1].get_ydata().max() == simulated["pressure_a"].max() / 1e5
    difference = measured["pressure_a"] - simulated["pressure_a"]
    np.testing.assert_array_equal(missed.lines[0].get_ydata(), thinned(measured.time, difference / 1e3)[1])
    assert "[kPa]" in missed.get_ylabel()
    assert "[mm]" in position.get_ylabel()
    assert "[mm]" in error.get_ylabel()
    assert "[bar]" in pressure.get_ylabel()
    assert duty.lines[1].get_ydata().min() == -measured["duty_exhaust"].max()


def test_a_recording_without_pressure_has_no_panel_for_its_error(fitted):
    assert len(recording_figure(fitted.verification["checked"]).axes) == 4


def test_the_ground_is_grey_where_the_pressure_is_not_believed(fitted):
    recording = fitted.recordings["first"]
    t = recording.measured.time
    (ground,) = recording_figure(recording, t > 1.0).axes[2].collections
    across = ground.get_paths()[0].vertices[:, 0]
    assert across.min() == 0.0
    assert abs(across.max() - 1.0) < 3e-3  # 4000 samples in 1500 bins at most: three samples of a millisecond each
    assert list(recording_figure(recording, t >= 0.0).axes[2].collections) == []


def test_the_band_of_the_pressure_is_drawn_where_there_is_one(fitted):
    recording = fitted.recordings["first"]
    pressure = recording.simulated["pressure_a"]
    band = {"pressure_a low": pressure - 1e4, "pressure_a high": pressure + 1e4}
    banded = replace(recording, simulated=recording.simulated.with_columns(**band))
    (drawn,) = recording_figure(banded).axes[2].collections
    edges = drawn.get_paths()[0].vertices[:, 1]
    assert edges.max() == (pressure.max() + 1e4) / 1e5
    assert edges.min() == (pressure.min() - 1e4) / 1e5


def test_the_load_figure_shows_newtons_over_millimetres(fitted):
    (axis,) = load_figure(fitted).axes
    assert axis.lines[0].get_ydata().max() == fitted.load_curve.force.max()
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("position [mm]", "load [N]")
    assert axis.get_xlim()[1] == 25.0


def test_importing_reports_is_light_and_drawing_leaves_global_settings_alone():
    code = """
import sys
import clutchid.reports, clutchid.study
assert not {"matplotlib", "jinja2", "sympy"} & set(sys.modules), sorted(sys.modules)
import matplotlib
before = matplotlib.rcParams.copy()
from clutchid.reports.figures import new_figure, png
png(new_figure([1.0])[0])
assert "matplotlib.pyplot" not in sys.modules
assert before == matplotlib.rcParams.copy()
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
