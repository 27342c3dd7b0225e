"""Passes at constant speed, and their cycles."""

import numpy as np

from clutchid.log import Log
from clutchid.rig.coulomb import cycles, passes


def test_ten_cycles_are_twenty_passes_with_the_speeds_and_forces_of_the_rig(cylinder):
    passed = passes(cylinder(2e5, 5.0))
    assert len(passed) == 20
    for way in passed:
        out = way.speed > 0
        assert np.isclose(way.speed, 0.01 if out else -0.02, rtol=1e-9)
        assert np.isclose(way.pressure, 3e5 + (4e3 if out else -4e3), rtol=1e-12)
        assert np.isclose(way.force, 0.3 + 5e-4 * 2e5 + (1 if out else -1) * (5.0 + 2.0), rtol=1e-12)
    assert len(cycles(passed)) == 10


def test_a_pass_with_a_hole_is_left_out_and_its_neighbour_waits_for_the_next(cylinder):
    log = cylinder(2e5, 5.0)
    gone = (log.time > 13.9) & (log.time < 14.5)  # inside the third pass out
    whole = Log(log.time[~gone], {name: values[~gone] for name, values in log.columns.items()})
    passed = passes(whole)
    assert len(passed) == 19
    # without it two passes back follow each other: one of them is alone
    assert len(cycles(passed)) == 9


def test_missing_forces_are_left_out_of_a_mean_and_a_pass_without_most_of_them_is_dropped(cylinder):
    log = cylinder(2e5, 5.0)
    force = log["force"].copy()
    force[::3] = np.nan
    some = [way.force for way in passes(log.with_columns(force=force))]
    np.testing.assert_allclose(some, [way.force for way in passes(log)], rtol=1e-12)
    force[log.time < 4.0] = np.nan
    assert len(passes(log.with_columns(force=force))) == 19


def test_a_pass_whose_speed_changes_is_no_pass_at_constant_speed():
    t = np.arange(0.0, 8.0, 0.01)
    y = 0.04 * np.abs((t / 4 + 1) % 2 - 1) ** 4  # from 40 to 85 % of the top speed within the band
    assert passes(Log(t, {"position": y, "force": np.sign(np.sin(np.pi * t / 4))})) == []


def test_a_recording_that_rests_has_no_pass():
    t = np.arange(0.0, 2.0, 0.01)
    assert passes(Log(t, {"position": np.zeros(t.size), "force": t})) == []
    assert passes(Log(t, {"position": np.full(t.size, np.nan), "force": t})) == []
