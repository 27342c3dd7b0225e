"""Figures of a fit, and where a pressure from the position can be reliable: between vented rests, within the reach."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.figures import thinned
from clutchid.documents.fit_figures import load_figure, recording_figure, reliable
from clutchid.log import Log
from clutchid.parameters import Parameters
from clutchid.strokes.excitation import vented_rests

T = np.arange(0.0, 4.0, 1e-3)


def stroke(*knots):
    """A recording through (time in s, position in mm)."""
    at, mm = zip(*knots, strict=True)
    return Log(T, {"position": 1e-3 * np.interp(T, at, mm), "duty_supply": np.zeros(T.size)})


HELD = stroke((0, 10), (0.5, 10), (0.8, 0), (1.5, 0), (2, 12), (2.5, 12), (3, 0), (3.5, 0), (3.8, 10), (4, 10))


def test_rests_are_found_at_the_engaged_end_only():
    rests = [(T[a], T[b - 1]) for a, b in vented_rests(HELD, Parameters())]
    # a rest is detected by the mean speed over 50 ms on both sides
    np.testing.assert_allclose(rests, [(0.8, 1.5), (3.0, 3.5)], atol=0.05)


def test_the_pressure_is_believed_between_the_first_and_the_last_rest():
    span = reliable(HELD, Parameters(), 0.025)
    assert not span[T < 0.75].any()
    assert span[(T > 0.85) & (T < 3.45)].all()
    assert not span[T > 3.55].any()


def test_it_is_not_believed_beyond_the_reach_of_the_fitted_recordings():
    span = reliable(HELD, Parameters(), 0.011)
    beyond = HELD["position"] > 0.011
    assert beyond.any()
    assert not span[beyond].any()
    assert span[(T > 0.85) & (T < 3.45) & ~beyond].all()


def test_a_rest_with_the_supply_valve_open_is_not_vented():
    filling = HELD.with_columns(duty_supply=np.full(T.size, 0.5))
    assert vented_rests(filling, Parameters()) == []
    assert not reliable(filling, Parameters(), 0.025).any()


def test_a_recording_without_a_position_has_no_rest():
    blank = HELD.with_columns(position=np.full(T.size, np.nan))
    assert vented_rests(blank, Parameters()) == []


def test_the_band_of_a_load_is_drawn_only_where_it_is_finite(fitted):
    whole = load_figure(fitted).axes[0].collections[0].get_paths()[0].vertices
    curve = fitted.load_curve
    beyond = curve.position > 10e-3
    band = np.where(beyond, -np.inf, curve.low), np.where(beyond, np.inf, curve.high)
    cut = type(curve)(curve.position, curve.force, *band)
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
    for axis, unit in ((position, "[mm]"), (error, "[mm]"), (pressure, "[bar]"), (missed, "[kPa]")):
        assert unit in axis.get_ylabel()
    assert duty.lines[1].get_ydata().min() == -measured["duty_exhaust"].max()


@pytest.mark.slow
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
