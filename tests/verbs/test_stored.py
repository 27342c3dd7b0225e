"""Points of a plot: every sample where there are few, least and greatest of each pixel where there are many."""

import numpy as np
import pytest

from clutchid.measurements.stored import write_column
from clutchid.verbs.stored import TIME_INDEX, clock_column, plotted

SIZE = 400_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A long recording with a pulse of one sample, and a channel with missing samples."""
    made = tmp_path_factory.mktemp("columns")
    values = np.sin(np.arange(SIZE) / 5000)
    values[123_457] = 9.0
    holed = values.copy()
    holed[1000:2000] = np.nan
    write_column(made, 0, TIME_INDEX, np.arange(SIZE) / 1e3)
    write_column(made, 0, 1, values)
    write_column(made, 0, 2, holed)
    return made


def test_single_samples_are_as_they_were_recorded(folder):
    time, values = plotted(folder, 0, [1], 123.45, 123.46, 1000)
    assert time == pytest.approx(np.arange(123_449, 123_462) / 1e3)
    assert values[123_457 - 123_449] == 9.0


@pytest.mark.parametrize(("begin", "end"), [(0, 400), (100, 300), (120, 130), (123.4, 123.5)])
def test_a_pulse_of_one_sample_is_seen_at_any_zoom(folder, begin, end):
    time, values = plotted(folder, 0, [1], begin, end, 800)
    assert np.nanmax(values) == 9.0
    assert abs(time[np.nanargmax(values)] - 123.457) <= 2 * (end - begin) / 800 + 1e-9
    assert time.size <= 2 * 800 + 4
    assert (np.diff(time) >= 0).all()


def test_the_shape_is_that_of_all_samples(folder):
    time, values = plotted(folder, 0, [1], 0.0, 100.0, 500)
    exact = np.sin(time * 1000 / 5000)
    assert np.abs(values - exact).max() < 0.3 * 100.0 / 500 + 0.05


def test_missing_samples_stay_missing(folder):
    time, values = plotted(folder, 0, [2], 0.9, 2.1, 5000)
    assert np.isnan(values[(time >= 1.0) & (time < 2.0)]).all()
    assert np.isfinite(values[(time < 0.999) | (time > 2.001)]).all()


@pytest.mark.parametrize(("begin", "end"), [(-20.0, -10.0), (500.0, 600.0), (3.0, 2.0)])
def test_nothing_is_shown_outside_the_recording(folder, begin, end):
    assert plotted(folder, 0, [1, 2], begin, end, 100).shape[1] <= 2


def test_the_time_of_a_plot_never_decreases():
    stamps = np.array([np.nan, 1.0, 2.0, 0.5, np.inf, 3.0])
    assert clock_column(stamps).tolist() == [1.0, 1.0, 2.0, 2.0, 2.0, 3.0]
