"""Drawing: thinning keeps what one must see, and matplotlib's global state stays untouched."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from clutchid.documents.figures import draw, draw_over_time, label, legend, new_figure, png, thinned, thinned_band
from clutchid.documents.style import STYLE, Line

numbers = st.floats(-1e6, 1e6) | st.just(float("nan"))


@given(arrays(np.float64, st.integers(1, 400), elements=numbers), st.integers(1, 60))
def test_thinning_a_curve_or_a_band_keeps_the_extremes_and_the_order_of_time(y, bins):
    x = np.arange(y.size, dtype=np.float64)
    x_thin, y_thin = thinned(x, y, bins)
    _, low, high = thinned_band(x, y - 1.0, y + 1.0, bins)
    assert x_thin.size <= max(2 * bins, 1)
    assert low.size <= 2 * bins
    assert y.size > 2 * bins or y_thin is y
    assert np.all(np.diff(x_thin) >= 0)
    assert np.isnan(y).all() == np.isnan(y_thin).all() == np.isnan(low).all()
    if not np.isnan(y).all():
        assert (np.nanmin(y_thin), np.nanmax(y_thin)) == (np.nanmin(y), np.nanmax(y))
        assert (np.nanmin(low), np.nanmax(high)) == (np.nanmin(y - 1.0), np.nanmax(y + 1.0))


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


@pytest.mark.slow
def test_importing_reports_is_light_and_drawing_leaves_global_settings_alone():
    code = """
import sys
import clutchid.documents, clutchid.study
assert not {"matplotlib", "jinja2", "sympy"} & set(sys.modules), sorted(sys.modules)
import matplotlib
before = matplotlib.rcParams.copy()
from clutchid.documents.figures import new_figure, png
png(new_figure([1.0])[0])
import clutchid, numpy as np
log = clutchid.Log(np.arange(3.0), {"position": np.zeros(3)})
log.plot(), log._repr_html_()
assert "matplotlib.pyplot" not in sys.modules
assert before == matplotlib.rcParams.copy()
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


def test_a_line_over_time_breaks_at_a_hole():
    _, (axis,) = new_figure([1.0])
    time = np.r_[np.arange(100), 500 + np.arange(100)] * 1e-3
    draw_over_time(axis, time, np.r_[np.zeros(100), np.ones(100)], Line(STYLE.blue, ""))
    x, y = axis.lines[0].get_data()
    assert np.isnan(y[(x > time[99]) & (x < time[100])]).any()
    draw_over_time(axis, time[:100], time[:100], Line(STYLE.blue, ""))
    assert np.array_equal(axis.lines[1].get_ydata(), time[:100])
