"""The level of the vented rest, and how far it has moved between two recordings."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.strokes.rest_shift import FURTHEST
from clutchid.strokes.travel import Travel, travel_change
from clutchid.strokes.vented_rest import VentedRest, from_rest, merged_levels, rest_shift, vented_rest
from clutchid.truck import drive, truck


def strokes(levels, *, start=0.0, seconds=2.0, zero=0.0, noise=0.0, vents=True, top=0.02) -> Log:
    """A rest at `start`, then strokes that return to the `levels` with the exhaust valve open; sensor at `zero`."""
    at, y = [0.0, 0.5], [start, start]
    for level in levels:
        t0 = at[-1]
        at += [t0 + 0.1, t0 + 0.5, t0 + 0.8, t0 + seconds]
        y += [top, top, level, level]
    t = np.arange(0.0, at[-1], 1e-3)
    position = np.interp(t, at, y) + zero + noise * np.random.default_rng(1).standard_normal(t.size)
    phase = (t - 0.5) % seconds
    opened = (t > 0.5) & (phase > 0.5) & (phase < 1.1) & vents
    return Log(
        t, {"position": position, "duty_supply": 1.0 * ((t > 0.5) & (phase < 0.1)), "duty_exhaust": 1.0 * opened}
    )


def test_the_rest_at_the_stop_and_those_that_friction_holds_are_apart():
    level = vented_rest(strokes([3e-4] * 3, zero=1e-3))
    assert level.lowest == pytest.approx(1e-3, abs=1e-9)
    assert level.returned == pytest.approx(1.3e-3, abs=1e-9)
    assert level.at_stop


def test_a_hold_with_closed_valves_is_no_vented_rest():
    held = strokes([3e-4] * 3, vents=False).slice(600, 6000)
    assert vented_rest(held) is None
    assert vented_rest(Log(np.arange(3.0), {"duty_supply": np.zeros(3)})) is None
    assert vented_rest(Log(np.arange(3.0), {"position": np.full(3, np.nan)})) is None


def test_a_shift_of_the_sensor_is_found_whatever_the_friction():
    before = vented_rest(strokes([3e-4] * 3, noise=2e-5))
    for friction in (1.0, 1.4):
        shift = rest_shift(before, vented_rest(strokes([3e-4 * friction] * 3, zero=2e-4, noise=2e-5)))
        assert shift.moved
        assert shift.low <= 2e-4 <= shift.high
        assert shift.high - shift.low < 1e-4


def test_more_friction_alone_moves_no_rest():
    before = vented_rest(strokes([3e-4] * 3))
    with_stop = rest_shift(before, vented_rest(strokes([4.2e-4] * 3)))
    assert not with_stop.moved
    without = rest_shift(before, vented_rest(strokes([4.2e-4] * 3, start=4.2e-4)))
    assert not without.moved, "the recording never touches its stop, so that friction may explain it"
    assert without.high - without.low > with_stop.high - with_stop.low


def test_a_hold_at_the_beginning_is_no_vented_rest():
    t = np.arange(0, 4, 1e-3)
    held = {"position": np.interp(t, [1.0, 1.2], [5e-3, 2e-2]), "duty_supply": 1.0 * ((t > 1) & (t < 1.2))}
    before = vented_rest(strokes([3e-4] * 3))
    assert rest_shift(before, vented_rest(Log(t, {**held, "duty_exhaust": np.zeros(t.size)}))) is None


def test_a_vented_rest_without_strokes_may_be_at_the_stop_or_above():
    before = vented_rest(strokes([3e-4] * 3))
    still = {"position": np.full(1000, 3e-4), "duty_supply": np.zeros(1000)}
    shift = rest_shift(before, vented_rest(Log(np.arange(0, 1, 1e-3), still)))
    assert shift.low <= 0.0 <= shift.high


def test_without_any_rest_at_the_stop_the_friction_is_a_guess():
    before, now = VentedRest(3e-4, 3.1e-4, 1e-5), VentedRest(6e-4, 6.1e-4, 1e-5)
    shift = rest_shift(before, now)
    assert shift.moved
    assert shift.low < 2e-4 < 4e-4 < shift.high


def test_what_lies_further_than_a_sensor_can_move_is_not_compared():
    assert rest_shift(VentedRest(0.0, 3e-4, 0.0), VentedRest(2 * FURTHEST, 2 * FURTHEST + 3e-4, 0.0)) is None


def test_several_recordings_have_one_rest():
    assert merged_levels([None, None]) is None
    level = merged_levels([VentedRest(0.0, 1e-4, 1e-5), None, VentedRest(2e-5, np.nan, 2e-5)])
    assert level == pytest.approx((1e-5, 1e-4, 2e-5))


def test_the_position_counts_from_the_rest_only_where_that_has_moved():
    log = strokes([3e-4] * 3)
    rest = vented_rest(log)
    same = from_rest(log, rest)
    assert same.log is log
    assert same.subtracted == 0.0
    moved = log.with_columns(position=log["position"] + 3e-4)
    zeroed = from_rest(moved, rest)
    assert zeroed.log["position"] == pytest.approx(log["position"], abs=1e-5)
    assert zeroed.subtracted == zeroed.shift.value == pytest.approx(3e-4, abs=1e-5)
    unzeroed = from_rest(moved, rest, "keep")
    assert unzeroed.log is moved
    assert unzeroed.shift.moved
    assert from_rest(moved, None).shift is None


@pytest.mark.slow
@pytest.mark.parametrize("family", ["A", "B"])
@pytest.mark.parametrize("number", [0, 3])
def test_on_virtual_trucks_the_interval_contains_the_truth(family, number):
    kind = truck(number, family)
    before = vented_rest(drive(kind, seconds=20, seed=1).log)
    for options in (
        {"change": "seals"}, {"change": "cold"}, {"wear": 2e-3, "cycles": 6e5},
        {"offset": 3e-4}, {"offset": -3e-4, "change": "seals"}, {"sensor_zero": "kept", "wear": 2e-3},
    ):  # fmt: skip
        driven = drive(kind, seconds=20, seed=2, pressure=False, **options)
        for begin in (0, 1000):  # with and without the rest at the stop
            shift = rest_shift(before, vented_rest(driven.log.slice(begin, len(driven.log))))
            assert shift.low <= driven.truth.shift <= shift.high
            assert shift.moved <= (driven.truth.shift != 0.0)
            assert begin or shift.moved == (driven.truth.shift != 0.0)


def test_a_far_stop_that_is_where_it_was_counts_from_the_rest_that_was_subtracted():
    """A rest that has moved by 0.5 mm moves the far stop in the recording, not the gain of its position."""
    change = travel_change(Travel(0.023, 0.025), Travel(0.023, 0.0245), subtracted=0.5e-3)
    assert change.ratio == pytest.approx(1.0)
    assert not change.suspect
