"""Half-load position and the table of the load."""

import numpy as np
import pytest

from clutchid.documents.tables import load_table
from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.comparison import half_load, half_load_band

Y = np.linspace(0.0, 25e-3, 101)
#: 500 N/mm up to 10 mm, then 100 N/mm down.
FORCE = np.where(Y <= 10e-3, 5e5 * Y, 5e3 - 1e5 * (Y - 10e-3))


def curve(half=100.0):
    return LoadCurve(Y, FORCE, FORCE - half, FORCE + half)


def test_half_of_the_peak_is_passed_where_the_line_says():
    # 2500 N at 5 mm; 100 N are 0.2 mm of it
    assert half_load_band(curve(), 20e-3) == pytest.approx((5e-3, 4.8e-3, 5.2e-3), rel=1e-9)


def test_only_what_was_recorded_counts_as_the_peak():
    assert half_load_band(curve(), 6e-3).position == pytest.approx(3e-3, rel=1e-9)


def test_a_band_that_never_passes_half_the_peak_has_no_end():
    band = half_load_band(curve(3e3), 20e-3)
    assert band.position == pytest.approx(5e-3)
    assert np.isnan(band.low)  # the upper end lies above it from the start
    assert np.isnan(band.high)  # the lower end never comes up to it


def test_the_half_of_a_plain_curve_is_that_of_its_band():
    assert half_load(Y, FORCE) == half_load_band(curve(), 25e-3).position == pytest.approx(5e-3)


def test_an_unknown_load_has_no_half():
    nothing = np.full(101, np.nan)
    assert np.isnan(half_load(Y, nothing))
    assert np.isnan(half_load_band(LoadCurve(Y, nothing, nothing, nothing), 20e-3)).all()
    assert np.isnan(half_load_band(curve(), float("nan"))).all()


def test_the_table_has_a_row_a_millimetre_up_to_the_reach():
    table = load_table(curve(), 6.4e-3)
    assert table.column("position") == pytest.approx(1e-3 * np.arange(7))
    assert table.column("force") == pytest.approx(5e2 * np.arange(7))
    assert table.column("high")[3] - table.column("low")[3] == pytest.approx(200.0)
