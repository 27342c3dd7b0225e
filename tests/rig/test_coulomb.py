"""Coulomb friction over pressure: recovery, intervals and levels that hold, signs, and messages."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.rig import conclusions, coulomb_friction, implied

pytestmark = pytest.mark.slow

PRESSURES = (1e5, 3e5, 5e5, 7e5)


@settings(max_examples=30)
@given(
    friction=st.floats(1.0, 300.0),
    rise=st.floats(-0.1, 2.0),
    area=st.floats(1e-4, 2e-2),
    zero=st.floats(-50.0, 50.0),
)
def test_friction_area_and_rise_are_found_whatever_the_pressure_adds(cylinder, friction, rise, area, zero):
    c_F = rise * friction / 1e6
    result = coulomb_friction([cylinder(p, friction + c_F * p, area, zero) for p in PRESSURES])
    # forces of area * 7e5 Pa with 16 digits, their differences of a thousandth: 1e-9 of the largest
    rounding = 1e-9 * (area * 7e5 + friction + 50.0)
    assert result.area.value == pytest.approx(area, abs=rounding / 6e5)
    for level, p in zip(result.levels, PRESSURES, strict=True):
        assert level.pressure == pytest.approx(p, rel=1e-9)
        assert level.friction.value == pytest.approx(friction + c_F * p, abs=rounding)
    assert result.slope.value == pytest.approx(c_F, abs=10 * rounding / 6e5)
    assert result.intercept.value == pytest.approx(friction, abs=10 * rounding)


def test_a_rig_turned_round_has_the_same_friction_and_the_opposite_area(cylinder):
    logs = [cylinder(p, 4.0 + p / 1e5) for p in PRESSURES]
    turned = [log.with_columns(position=-log["position"], force=-log["force"]) for log in logs]
    friction, other = coulomb_friction(logs), coulomb_friction(turned)
    assert other.area.value == pytest.approx(-friction.area.value, rel=1e-9)
    for a, b in zip(friction.levels, other.levels, strict=True):
        assert b.friction.value == pytest.approx(a.friction.value, rel=1e-9)


def test_a_force_with_the_wrong_sign_is_refused_for_every_recording_at_once(cylinder):
    logs = [cylinder(p, 4.0) for p in PRESSURES[:2]]
    with pytest.raises(DataError, match="invert its sign") as refused:
        coulomb_friction([log.with_columns(force=-log["force"]) for log in logs])
    assert str(refused.value).count("invert its sign") == 2


def test_intervals_cover_and_a_constant_friction_is_rejected_as_often_as_its_level_says(cylinder):
    generator, trials, rejected = np.random.default_rng(6), 60, 0
    sigma = (0.05, 0.2, 0.1, 0.3)
    inside, slopes = np.zeros(4), 0
    for _ in range(trials):
        logs = [cylinder(p, 5.0 + s * generator.standard_normal(10)) for p, s in zip(PRESSURES, sigma, strict=True)]
        friction = coulomb_friction(logs)
        inside += [level.friction.low <= 5.0 <= level.friction.high for level in friction.levels]
        slopes += friction.slope.low <= 0.0 <= friction.slope.high
        rejected += friction.test.p_value < 0.05
    # one of twenty levels looks as if it drifted, and then its interval is wider than asked for: 95 to 95.3 %
    low, high = binom.ppf(0.001, 4 * trials, 0.95), binom.ppf(0.999, 4 * trials, 0.953)
    assert low <= inside.sum() <= high, inside
    assert rejected <= binom.ppf(0.999, trials, 0.05)
    # a scatter about the line above 1 widens the slope's interval: never fewer than 19 of 20
    assert slopes >= binom.ppf(0.001, trials, 0.95)


def test_friction_that_grows_with_pressure_is_reported_with_the_variant_and_its_parameter(cylinder):
    generator = np.random.default_rng(7)
    logs = [cylinder(p, 3.0 + 1e-5 * p + 0.1 * generator.standard_normal(10)) for p in PRESSURES]
    friction = coulomb_friction(logs)
    (sentence,) = conclusions(friction)
    assert sentence.startswith("a constant F_C is inadequate")
    assert "energy-balance-stribeck" in sentence
    assert f"c_F = {friction.slope.value:.3g} m²" in sentence
    assert friction.slope.low < 1e-5 < friction.slope.high


def test_a_constant_friction_is_reported_as_adequate(cylinder):
    generator = np.random.default_rng(8)
    friction = coulomb_friction([cylinder(p, 5.0 + 0.1 * generator.standard_normal(10)) for p in PRESSURES])
    sentence = conclusions(friction)[0]
    assert sentence.startswith(f"one constant F_C = {friction.constant.value:.3g} N")
    assert friction.constant.low <= 5.0 <= friction.constant.high


def test_friction_that_differs_without_growing_is_not_sold_as_pressed_seals(cylinder):
    generator = np.random.default_rng(9)
    frictions = (7.0, 5.0, 8.0, 5.5)
    logs = [cylinder(p, f + 0.1 * generator.standard_normal(10)) for p, f in zip(PRESSURES, frictions, strict=True)]
    (sentence,) = conclusions(coulomb_friction(logs))
    assert "inadequate" in sentence
    assert "energy-balance" not in sentence


def test_cycles_that_drift_count_as_one_and_are_reported(cylinder):
    drifting = cylinder(1e5, np.linspace(4.0, 5.0, 10))
    friction = coulomb_friction([drifting, cylinder(3e5, 6.0)])
    level = friction.levels[0]
    assert level.drifts
    # one cycle: the standard deviation of ten values from 4 to 5
    assert level.friction.std == pytest.approx(np.std(np.linspace(4, 5, 10), ddof=1), rel=1e-6)
    assert any("drifts between 4.00 and 5.00 N over its 10 cycles" in sentence for sentence in conclusions(friction))


def test_one_recording_with_two_held_pressures_has_two_levels(cylinder):
    first, other = cylinder(1e5, 4.0), cylinder(3e5, 6.0)
    columns = {name: np.concatenate([first[name], other[name]]) for name in first.columns}
    friction = coulomb_friction([Log(np.concatenate([first.time, first.time + 60.0]), columns, "both")], ambient=1e5)
    assert [round(level.friction.value, 6) for level in friction.levels] == [4.0, 6.0]


def test_one_level_tells_its_friction_and_that_the_area_is_needed(cylinder):
    log = cylinder(1e5, 4.0)
    friction = coulomb_friction([log])
    assert friction.test is None
    # 4 kPa on 5 cm² are still in it
    assert friction.levels[0].friction.value == pytest.approx(6.0, rel=1e-9)
    assert any("give `area`" in sentence for sentence in conclusions(friction))
    with_area = coulomb_friction([log], area=5e-4)
    assert with_area.levels[0].friction.value == pytest.approx(4.0, rel=1e-9)
    assert not any("give `area`" in sentence for sentence in conclusions(with_area))


def test_an_area_that_is_not_certain_widens_the_friction(cylinder):
    generator = np.random.default_rng(11)
    wander = [0.5 * generator.standard_normal(10) for _ in range(2)]
    friction = coulomb_friction([cylinder(p, 4.0, zero=z) for p, z in zip(PRESSURES[:2], wander, strict=True)])
    # the zero wanders from cycle to cycle, which both strokes of a cycle share: friction scatters by nothing of its own
    for level in friction.levels:
        assert np.ptp(level.cycles) < 1e-9
        assert level.friction.std == pytest.approx(friction.area.std * 4e3, rel=1e-6)
        assert level.friction.degrees_of_freedom == pytest.approx(friction.area.degrees_of_freedom, rel=1e-6)
        assert level.friction.low <= 4.0 <= level.friction.high


def test_single_cycles_have_no_interval_and_no_test(cylinder):
    logs = [cylinder(p, 4.0).slice(0, 120) for p in PRESSURES[:3]]
    friction = coulomb_friction(logs)
    assert [level.cycles.size for level in friction.levels] == [1, 1, 1]
    assert [level.friction.value for level in friction.levels] == pytest.approx([4.0] * 3, rel=1e-9)
    assert all(np.isinf(level.friction.std) for level in friction.levels)
    assert friction.test is None
    assert implied(friction) == {}
    assert "no interval" in conclusions(friction)[0]


def test_without_a_pressure_there_is_one_level_and_no_area(cylinder):
    log = cylinder(1e5, 4.0)
    bare = Log(log.time, {name: log[name] for name in ("position", "force")}, "bare")
    friction = coulomb_friction([bare])
    assert np.isnan(friction.levels[0].pressure)
    assert friction.area is None
    assert conclusions(friction)[0].startswith("F_C = 6 N")
    with pytest.raises(ParameterError, match="area"):
        coulomb_friction([bare], area=5e-4)
    with pytest.raises(DataError, match="fit them separately"):
        coulomb_friction([bare, log])


def test_what_cannot_be_used_is_reported_with_every_recording(cylinder):
    t = np.arange(0.0, 4.0, 0.01)
    still = Log(t, {"position": np.zeros(t.size), "force": np.ones(t.size)}, "still")
    mute = Log(t, {"position": 0.01 * t}, "mute")
    with pytest.raises(DataError) as refused:
        coulomb_friction([still, mute])
    assert "still: no cycle" in str(refused.value)
    assert "mute: no force" in str(refused.value)
    with pytest.raises(DataError, match="at least one"):
        coulomb_friction([])
