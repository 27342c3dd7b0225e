"""LuGre friction of a rig: the free run against its closed form, recovery, honest intervals, sign of the force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, chi2

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.rig import fit_lugre
from clutchid.rig.free_run import NAMES, free_run, segments
from clutchid.rig.lugre import resolution

pytestmark = pytest.mark.slow


def test_the_deflection_is_the_closed_form_of_a_held_velocity(tribometer, block):
    (segment,) = segments(tribometer())
    F_C, K_z, D_v, D_zdot = values = [block[name] for name in NAMES]
    z, expected = 3e-5, np.empty(len(segment))
    for k, v in enumerate(segment.velocity):
        expected[k] = D_v * v + K_z * z + D_zdot * (v - K_z / F_C * abs(v) * z)
        if k < len(segment) - 1:
            u = (v + segment.velocity[k + 1]) / 2
            decay = np.exp(-K_z / F_C * abs(u) * segment.dt[k])
            z = z * decay + np.sign(u) * F_C / K_z * (1 - decay)
    # the gain is a series below an exponent of 1e-5, and loses five digits to a difference just above: 1e-11 each
    np.testing.assert_allclose(free_run(segment, values, 3e-5)[0], expected, atol=1e-10 * F_C)


def test_the_derivatives_of_the_force_are_those_of_differences(tribometer, block):
    (segment,) = segments(tribometer())
    at = np.array([*(block[name] for name in NAMES), 3e-5])
    jacobian = free_run(segment, at[:-1], at[-1])[1]
    for i, value in enumerate(at):
        step = np.zeros(5)
        step[i] = 1e-5 * value
        difference = free_run(segment, (at + step)[:-1], (at + step)[-1])[0]
        difference = (difference - free_run(segment, (at - step)[:-1], (at - step)[-1])[0]) / (2 * step[i])
        # central differences: a relative step of 1e-5 leaves 1e-10, and rounding 1e-16 / 1e-5
        scale = np.abs(jacobian[:, i]).max()
        np.testing.assert_allclose(jacobian[:, i], difference, atol=1e-8 * max(scale, block["F_C"] / value))


def test_friction_and_start_are_found_from_a_recording_without_noise(tribometer, block):
    friction = fit_lugre(tribometer(start=5e-5))
    assert friction.status == "ok"
    # the search ends where a step would gain 1e-10 of the cost, so within its square root of the scale
    assert dict(friction.values) == pytest.approx(block, rel=1e-4)
    assert friction.starts[0] == pytest.approx(5e-5, rel=1e-3)
    assert friction.fit_percent > 99.99


@settings(max_examples=10)
@given(
    friction=st.floats(0.5, 500.0),
    distance=st.floats(2e-5, 3e-4),
    viscous=st.floats(0.0, 0.5),
    damping=st.floats(0.0, 0.3),
)
def test_any_friction_that_slides_is_found_in_free_run(tribometer, friction, distance, viscous, damping):
    speed = 1e-3
    values = {"F_C": friction, "K_z": friction / distance, "force_zero": -0.2 * friction}
    values |= {"D_v": viscous * friction / speed, "D_zdot": damping * friction / speed}
    result = fit_lugre(tribometer(values))
    for name, value in values.items():
        natural = friction / speed if name.startswith("D") else abs(value)
        assert result.values[name] == pytest.approx(value, abs=1e-3 * natural)


@pytest.mark.parametrize("distance", [6e-6, 1.2e-5, 5e-4])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_the_softer_bristle_with_much_damping_is_not_taken_for_the_friction(tribometer, distance, damping):
    values = {"F_C": 2.0, "K_z": 2.0 / distance, "D_v": 600.0, "D_zdot": damping * 2e3, "force_zero": 0.1}
    log = tribometer(values)
    noise = 0.05 * np.random.default_rng(12).standard_normal(len(log))
    friction = fit_lugre(log.with_columns(force=log["force"] + noise))
    # the second minimum misses by a tenth and more; 4000 samples tell a rms to 1 / sqrt(8000), four times that
    assert friction.rms < 0.05 * (1 + 4 / np.sqrt(8000))


def test_a_recording_turned_round_has_the_same_friction_and_the_opposite_start(tribometer):
    log = tribometer(start=5e-5)
    friction = fit_lugre(log)
    other = fit_lugre(log.with_columns(position=-log["position"], force=-log["force"]))
    for name in NAMES:
        assert other.values[name] == pytest.approx(friction.values[name], rel=1e-6)
    assert other.values["force_zero"] == pytest.approx(-friction.values["force_zero"], rel=1e-6)
    assert other.starts[0] == pytest.approx(-friction.starts[0], rel=1e-6)


def test_nineteen_of_twenty_intervals_contain_the_friction_when_noise_is_coloured(tribometer, block, coloured):
    clean, generator, trials = tribometer().slice(0, 2000), np.random.default_rng(1), 40
    inside = dict.fromkeys(("F_C", "K_z", "D_v", "D_zdot"), 0)
    squares = dict.fromkeys(inside, 0.0)
    for _ in range(trials):
        noisy = clean.with_columns(
            force=clean["force"] + 0.1 * coloured(generator, len(clean), 0.8),
            position=clean["position"] + 1e-7 * generator.standard_normal(len(clean)),
        )
        friction = fit_lugre(noisy)
        for name in inside:
            estimate = friction.parameters[name]
            inside[name] += estimate.low <= block[name] <= estimate.high
            squares[name] += (1.96 * (estimate.value - block[name]) / (estimate.high - estimate.value)) ** 2
    # Bartlett's weights cut tails: a tenth of the standard error at most where scores change sign within a stroke, and
    # 1.96 * 0.9 covers 92.2 %. Between that and 95 % the count is binomial.
    low, high = binom.ppf(0.001, trials, 0.922), binom.ppf(0.999, trials, 0.95)
    assert all(low <= count <= high for count in inside.values()), inside
    # and a wide interval contains everything: the squares of standardised errors are those of so many normal numbers
    least, most = chi2.ppf([0.001, 0.999], trials) / [1.0, 0.9**2]
    assert all(least <= total <= most for total in squares.values()), squares


def test_an_interval_does_not_reach_below_what_friction_can_be(tribometer, block, coloured):
    log = tribometer({**block, "D_v": 20.0})
    noise = 0.3 * coloured(np.random.default_rng(13), len(log), 0.8)
    D_v = fit_lugre(log.with_columns(force=log["force"] + noise)).parameters["D_v"]
    assert D_v.value - 1.96 * D_v.std < 0.0
    assert D_v.low == 0.0


def test_a_hole_ends_a_piece_and_the_next_one_has_a_start_of_its_own(tribometer, block):
    log = tribometer()
    columns = {name: np.delete(values, slice(1500, 1900)) for name, values in log.columns.items()}
    friction = fit_lugre(Log(np.delete(log.time, slice(1500, 1900)), columns, "hole"))
    assert len(friction.starts) == 2
    # at the hole the velocity is one-sided over two samples: a share of 1e-3 of the samples, off by 1e-2
    assert dict(friction.values) == pytest.approx(block, rel=1e-2)


def test_missing_forces_are_left_out_and_missing_positions_end_a_piece(tribometer, block):
    log = tribometer()
    force, position = log["force"].copy(), log["position"].copy()
    force[::7] = np.nan
    position[2000:2100] = np.nan
    friction = fit_lugre(log.with_columns(force=force, position=position))
    assert len(friction.starts) == 2
    assert np.isnan(friction.force[2000:2100]).all()
    assert np.isfinite(friction.force[:2000]).all()
    assert friction.values["F_C"] == pytest.approx(block["F_C"], rel=1e-2)


def test_fixed_friction_is_a_check_whose_start_and_zero_alone_are_free(tribometer, block):
    log = tribometer(start=5e-5)
    values = {name: block[name] for name in NAMES}
    assert list(fit_lugre(log, fixed=values).parameters) == ["force_zero"]
    assert fit_lugre(log, fixed=values).fit_percent > 99.99
    wrong = fit_lugre(log, fixed={**values, "F_C": 1.0})
    assert wrong.fit_percent < 70
    assert wrong.status == "warning"
    assert f"the fit is poor, {wrong.fit_percent:.1f} % in free run" in wrong.warnings[0]


def test_damping_at_its_bound_is_reported(tribometer, block):
    log = tribometer({**block, "D_zdot": 0.0})
    # less force wherever the bristle moves: damping that is negative
    (segment,) = segments(log)
    slope = free_run(segment, [block[name] for name in NAMES], 0.0)[1][:, NAMES.index("D_zdot")]
    friction = fit_lugre(log.with_columns(force=log["force"] - 100.0 * slope))
    assert friction.values["D_zdot"] == 0.0
    assert np.isinf(friction.parameters["D_zdot"].std)
    assert friction.status == "warning"
    assert "D_zdot lies at a bound" in friction.warnings[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda log: log.with_columns(position=np.zeros(4000)), "the position does not change"),
        (lambda log: log.with_columns(force=np.ones(4000)), "the force does not change"),
        (lambda log: log.with_columns(force=np.full(4000, np.nan)), "no force with finite values"),
        (lambda log: log.with_columns(force=-log["force"]), "invert its sign"),
        (lambda log: log.without("force"), "no force.*position"),
        (lambda log: log.slice(0, 30), "30 samples"),
    ],
)
def test_a_recording_that_shows_no_friction_is_refused_in_one_sentence(tribometer, change, words):
    with pytest.raises(DataError, match=words):
        fit_lugre(change(tribometer()))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fixed": {"F_c": 1.0}}, "F_c"),
        ({"fixed": {"K_z": -1.0}}, "K_z"),
        ({"inertia": -1.0}, "inertia = -1 kg: must be a mass of at least 0 kg"),
    ],
)
def test_options_out_of_range_are_refused(tribometer, options, words):
    with pytest.raises(ParameterError, match=words):
        fit_lugre(tribometer(), **options)


def rigid(tribometer, share_of_reach):
    """A rig whose contact yields by this share of the reach before it slides, and its friction."""
    reach = float(np.ptp(tribometer()["position"]))
    values = {"F_C": 2.0, "K_z": 2.0 / (share_of_reach * reach), "D_v": 300.0, "D_zdot": 100.0, "force_zero": 0.1}
    return tribometer(values), values


@pytest.mark.parametrize("share", [1e-3, 1.3e-4])
def test_a_contact_that_hardly_yields_is_found_from_a_recording_without_noise(tribometer, share):
    log, values = rigid(tribometer, share)
    friction = fit_lugre(log)
    assert friction.warnings == ()
    assert dict(friction.values) == pytest.approx(values, rel=1e-3)


def test_intervals_contain_a_friction_whose_contact_hardly_yields(tribometer, coloured):
    log, values = rigid(tribometer, 1.3e-4)
    log, generator, trials = log.slice(0, 2000), np.random.default_rng(2), 8
    inside = dict.fromkeys(values, 0)
    for _ in range(trials):
        friction = fit_lugre(log.with_columns(force=log["force"] + 0.1 * coloured(generator, len(log), 0.8)))
        for name, value in values.items():
            inside[name] += friction.parameters[name].low <= value <= friction.parameters[name].high
    # as for a soft contact: between 92.2 and 95 % of the cases
    assert all(count >= binom.ppf(0.001, trials, 0.922) for count in inside.values()), inside


def test_a_stiffness_beyond_the_resolution_has_no_interval_and_leaves_the_others_honest(tribometer, coloured):
    log, values = rigid(tribometer, 1e-5)
    noise = 0.1 * coloured(np.random.default_rng(3), len(log), 0.8)
    friction = fit_lugre(log.with_columns(force=log["force"] + noise))
    assert friction.status == "warning"
    assert "K_z lies at a bound" in friction.warnings[0]
    assert "--fix K_z=VALUE" in friction.warnings[0]
    assert np.isinf(friction.parameters["K_z"].std)
    assert np.isinf(friction.parameters["D_zdot"].std)
    for name in ("F_C", "D_v", "force_zero"):
        assert np.isfinite(friction.parameters[name].std)
        assert friction.parameters[name].low <= values[name] <= friction.parameters[name].high


def test_a_stiffness_that_the_noise_of_the_position_hides_has_no_interval(tribometer):
    log, values = rigid(tribometer, 1.3e-4)
    generator = np.random.default_rng(4)
    position = log["position"] + 1e-6 * generator.standard_normal(len(log))
    friction = fit_lugre(
        log.with_columns(position=position, force=log["force"] + 0.1 * generator.standard_normal(4000))
    )
    assert friction.values["K_z"] < 0.5 * values["K_z"]
    assert np.isinf(friction.parameters["K_z"].std)
    assert "the noise of the position, 0.001 mm, hides the stiffness" in friction.warnings[0]
    assert friction.parameters["F_C"].low <= values["F_C"] <= friction.parameters["F_C"].high


def test_the_inertia_of_the_moving_parts_is_taken_from_the_force(tribometer, block):
    log = tribometer()
    acceleration = np.gradient(np.gradient(log["position"], log.time), log.time)
    heavy = log.with_columns(force=log["force"] + 600.0 * acceleration)
    friction = fit_lugre(heavy, inertia=600.0)
    # an acceleration averaged over 20 ms of a period of 4 s: within (2 pi 0.02 / 4)^2 of a quarter of the force
    for name in ("F_C", "K_z", "D_v"):
        assert friction.values[name] == pytest.approx(block[name], rel=1e-2)
    assert friction.fit_percent > 99.0
    assert fit_lugre(heavy).fit_percent < friction.fit_percent - 5.0


def test_a_force_that_the_law_does_not_explain_is_a_poor_fit(tribometer):
    log = tribometer()
    spring = 8e3 * log["position"]
    friction = fit_lugre(log.with_columns(force=log["force"] + spring * np.sin(log.time)))
    assert friction.fit_percent < 70.0
    assert any("the fit is poor" in warning for warning in friction.warnings)


def test_the_noise_of_a_position_is_that_of_its_quantisation_or_of_its_samples():
    t = np.arange(4000) * 5e-3
    y = 0.02 * np.sin(t)
    # third differences are whole steps: a median of one step is a noise of 0.33 steps, and 0.29 are uniform
    assert resolution(np.round(y, 4)) == pytest.approx((1e-4, 1e-4 / np.sqrt(12)), rel=0.2)
    step, noise = resolution(y + 1e-5 * np.random.default_rng(5).standard_normal(4000))
    # the median of 4000 absolute values: 1.5 / sqrt(4000) of it, four times that with the correlation of differences
    assert noise == pytest.approx(1e-5, rel=0.1)
    assert step < 1e-4
