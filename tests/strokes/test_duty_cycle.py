"""Time grid of the duty cycles, and on/off units."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.strokes.duty_cycle import MIN_CHANGES, duty_grid, grid_phase, on_off, resolves_carrier
from fixtures.duty_cycles import commanded


def test_duty_cycles_that_change_once_a_period_tell_it_and_its_phase():
    t = np.arange(4000) * 1e-3
    duty = np.repeat(np.random.default_rng(1).random(200), 20)
    log = Log(t, {"duty_supply": np.roll(duty, 7), "duty_exhaust": np.zeros(t.size)})
    period, phase = duty_grid(log)
    assert period == pytest.approx(0.02)
    assert phase == pytest.approx(0.35)
    assert grid_phase(log, 0.02) == pytest.approx(0.35)
    assert grid_phase(log, 0.01) == pytest.approx(0.7), "two periods of the carrier in one of the grid"
    assert grid_phase(log, 0.012) is None


def test_duty_cycles_that_change_at_any_time_have_no_grid():
    t = np.arange(4000) * 1e-3
    log = Log(t, {"duty_supply": np.random.default_rng(1).random(4000), "duty_exhaust": np.zeros(t.size)})
    assert duty_grid(log) == (0.0, 0.0)
    assert duty_grid(log.slice(0, 40)) == (0.0, 0.0), "too few changes"
    assert grid_phase(log, 0.01) is None


def test_an_on_off_unit_is_distinguished_from_a_proportional_one(drive_log):
    bang = commanded(4000, 2)
    assert on_off(bang)
    assert not on_off(drive_log)
    for name in ("duty_supply", "duty_exhaust"):
        between = bang[name].copy()
        between[10 : 10 + MIN_CHANGES - 1] = 0.5
        assert on_off(bang.with_columns(**{name: between})), "a few samples between may be edges"
        between[10 + MIN_CHANGES - 1] = 0.5
        assert not on_off(bang.with_columns(**{name: between}))


def test_missing_duty_cycles_are_not_taken_for_a_part():
    bang = commanded(4000, 2)
    holed = bang["duty_supply"].copy()
    holed[::7] = np.nan
    assert on_off(bang.with_columns(duty_supply=holed))


def test_edges_of_an_on_off_unit_show_from_two_samples_and_a_phase_from_two_and_a_half(drive_log):
    bang = commanded(4000, 2)
    assert [resolves_carrier(bang, period) for period in (1e-3, 1.9e-3, 2e-3, 2.5e-3)] == [False, False, True, True]
    part = [resolves_carrier(drive_log, period) for period in (2e-3, 2.4e-3, 2.5e-3, 0.01)]
    assert part == [False, False, True, True]
    slow = commanded(4000, 2, step=1e-2)
    assert [resolves_carrier(slow, period) for period in (0.01, 0.02)] == [False, True]


@pytest.mark.parametrize(("every", "shift", "phase"), [(2, 0, 0.0), (2, 1, 0.5), (5, 2, 0.4)])
def test_the_grid_of_an_on_off_unit_is_looked_for_from_two_samples(every, shift, phase):
    period, offset = duty_grid(commanded(4000, every, shift=shift))
    assert period == pytest.approx(every * 1e-3)
    assert (offset - phase + 0.5) % 1.0 == pytest.approx(0.5, abs=1e-6)


def test_a_unit_that_opens_in_part_has_no_grid_of_two_samples():
    bang = commanded(4000, 2)
    part = bang.with_columns(duty_supply=0.5 * bang["duty_supply"])
    assert not on_off(part)
    assert duty_grid(part) == (0.0, 0.0)
