"""Where a pressure from the position can be reliable: between vented rests and within the reach."""

import numpy as np

from clutchid.log import Log
from clutchid.parameters import Parameters
from clutchid.reports.fit_figures import reliable, vented_rests

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
