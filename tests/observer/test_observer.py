"""An observer on recordings that the model itself made."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from clutchid import Actuator
from clutchid.errors import DataError, ParameterError
from clutchid.inference.filter.joint_filter import drifted
from clutchid.observer import observe, observer, read_state, start, write_state
from clutchid.observer.configuration import DRIFT
from clutchid.observer.inputs import taken_in
from clutchid.observer.intake import BRIDGED
from clutchid.observer.methods import METHODS
from clutchid.observer.state import FROZEN
from fixtures.changed_logs import picked, spoiled
from fixtures.observing import in_blocks

STROKE = np.linspace(2e-3, 9e-3, 30)


def apart(joint, actuator, state, worn):
    """Largest error of the load at 2 to 9 mm over the largest change."""
    truth = worn.load.force(STROKE)
    return np.abs(joint.load(state).force(STROKE) - truth).max() / np.abs(actuator.load.force(STROKE) - truth).max()


def test_the_band_of_the_load_shrinks_and_holds_the_truth(joint, worn, log):
    state, _ = observe(joint, start(joint), log)
    before, after = (joint.load_deviation(belief, STROKE) for belief in (start(joint), state))
    assert np.all(after < 0.5 * before)
    assert np.all(np.abs(joint.load(state).force(STROKE) - worn.load.force(STROKE)) < 3.0 * after)


def test_a_load_that_has_grown_is_followed(joint, plant, worn, log):
    state, samples = observe(joint, start(joint), log)
    assert apart(joint, plant, state, worn) < 0.15
    late = slice(len(log) // 2, None)
    error = samples.states[late, plant.states.index("p_A")] - log["pressure_a"][late]
    assert np.sqrt(np.mean(error**2)) < 10e3


def test_a_stroke_widens_every_standard_deviation_of_the_prior_by_the_same_share(joint):
    T = start(joint).T
    before, after = (np.linalg.norm(root, axis=1) for root in (T, drifted(joint.joint, T, np.array([len(T)]))))
    assert after == pytest.approx(np.sqrt(1.0 + DRIFT) * before, rel=1e-12)


def test_the_band_of_the_pressure_narrows_and_holds_the_truth(joint, plant, log):
    _, samples = observe(joint, start(joint), log)
    at, corrected = plant.states.index("p_A"), np.isfinite(samples.deviations[:, 0])
    off, band = np.abs(samples.states[:, at] - log["pressure_a"])[corrected], 1.96 * samples.deviations[corrected, at]
    assert np.array_equal(corrected, np.arange(1, len(log) + 1) % joint.joint.settings.every == 0)
    late = slice(off.size // 2, None)
    assert np.mean(off[late] <= band[late]) > 0.9
    assert np.median(band[late]) < 30e3


def test_a_state_of_another_calibration_or_method_is_refused(joint, plant, tmp_path):
    methods = [observer(plant, method) for method in METHODS if method != "paper"]
    others = observer(plant.replace({"F_C": 150.0})), observer(plant, supply_std=0.02)
    for first, second in (*permutations(methods, 2), *((joint, other) for other in others)):
        write_state(first, start(first), tmp_path / "state.toml")
        with pytest.raises(ParameterError, match="from another calibration or method; give the calibration and method"):
            read_state(second, tmp_path / "state.toml")


@pytest.mark.parametrize("text", ["number = 3", "[observer]\nformat = 99", "format"])
def test_a_file_that_is_no_state_is_refused_with_its_name(joint, tmp_path, text):
    (tmp_path / "state.toml").write_text(text)
    with pytest.raises(ParameterError, match=r"state\.toml: is not an? "):
        read_state(joint, tmp_path / "state.toml")


def test_a_hole_ends_a_stretch_and_what_is_known_of_the_load_stays(joint, plant, worn, log):
    state, samples = observe(joint, start(joint), spoiled(log, "duty_supply", slice(2500, 2700)))
    bridged = 2500 + round(BRIDGED * 1e-6 / joint.spacing)
    assert np.isnan(samples.states[bridged:2700]).all()
    assert np.isfinite(samples.states[:bridged]).all(), "for a short time the duty cycles are held"
    assert np.isfinite(samples.states[2700:]).all()
    assert apart(joint, plant, state, worn) < 0.3


def test_parts_of_a_correction_are_counted_in_samples_also_where_some_are_late(joint, plant, worn, log):
    """A late sample has one part of a correction, so those of the missing ones do not come at once."""
    lost = np.arange(len(log)) % 100
    late = picked(log, (lost < 40) | (lost >= 44))
    state, samples = observe(joint, start(joint), late)
    corrected = np.isfinite(samples.deviations[:, 0])
    assert np.array_equal(corrected, np.arange(1, len(late) + 1) % joint.joint.settings.every == 0)
    assert apart(joint, plant, state, worn) < 0.3
    _, undisturbed = observe(joint, start(joint), log)
    at, since = plant.states.index("p_A"), slice(200, None)
    there = np.searchsorted(log.time, late.time)
    assert np.abs(samples.states[since, at] - undisturbed.states[there[since], at]).max() < 30e3


def test_a_valve_may_have_been_open_for_a_share_of_each_sample_that_is_missing(joint, log):
    """The square of the time adds up over the missing samples, as errors that are independent."""
    state, _ = observe(joint, start(joint), log.slice(0, 100))
    torn = picked(log.slice(100, 110), np.isin(np.arange(10), [0, 1, 2, 5, 6, 8, 9]))
    assert taken_in(joint, state.inputs, state.latest, torn)[0]["unknown"].tolist() == [0, 0, 0, 2, 0, 1, 0]


def test_the_samples_of_a_frozen_sensor_are_left_out(joint, plant, worn, log):
    moving = 1000 + int(np.argmax(np.abs(np.diff(log["position"][1000::10])) > 1e-3)) * 10
    frozen = spoiled(log, "position", slice(moving, moving + 500), log["position"][moving])
    state, samples = observe(joint, start(joint), frozen)
    assert not samples.used[moving + FROZEN : moving + 500].any()
    assert samples.used[moving + 500 :].all()
    assert apart(joint, plant, state, worn) < 0.3


def test_missing_positions_are_predicted(joint, log):
    _, samples = observe(joint, start(joint), spoiled(log, "position", slice(800, 900)).slice(0, 1500))
    assert np.isfinite(samples.states).all()
    assert np.isnan(samples.innovations[800:900]).all()


@pytest.mark.parametrize("lengths", [[2500], [1, 99, 2400], [1000, 1, 1499]])
def test_a_stretch_that_begins_without_a_position_starts_with_the_first_one(joint, plant, log, lengths):
    inside = int(np.argmax(log["position"] > 5e-3))
    part = spoiled(log.slice(inside, inside + 2500), "position", slice(50))
    _, samples = in_blocks(joint, part, lengths)
    _, expected = observe(joint, start(joint), part.slice(50, 2500))
    assert np.isnan(samples.states[:50]).all()
    assert np.array_equal(samples.states[50:], expected.states)


def test_time_that_goes_back_is_refused_and_the_state_is_kept(joint, log):
    state, _ = observe(joint, start(joint), log.slice(0, 300))
    with pytest.raises(
        DataError, match=r"begins at 0\.2 s, but the observer is at 0\.299 s; give the recording that follows"
    ):
        observe(joint, state, log.slice(200, 400))
    assert observe(joint, state, log.slice(300, 400))[0].number == 400


@pytest.mark.parametrize("wrong", [-0.1, 1.5, np.inf])
def test_a_duty_cycle_outside_0_to_1_is_refused_with_its_time(joint, log, wrong):
    with pytest.raises(DataError, match=r"duty_exhaust is (-0\.1|1\.5|inf) at 0\.12 s; a duty cycle is from 0 to 1"):
        observe(joint, start(joint), spoiled(log, "duty_exhaust", 120, wrong))


def test_a_log_without_a_duty_cycle_is_refused(joint, log):
    with pytest.raises(DataError, match="no column 'duty_exhaust'"):
        observe(joint, start(joint), log.without("duty_exhaust"))


def test_an_unknown_method_names_the_nearest(plant):
    with pytest.raises(ParameterError, match="joint"):
        observer(plant, "jonit")


def test_a_stretch_may_start_in_mid_stroke(joint, plant, worn, log):
    inside = int(np.argmax(log["position"] > 5e-3))
    state, samples = observe(joint, start(joint), log.slice(inside, len(log)))
    assert np.isfinite(samples.states).all()
    assert apart(joint, plant, state, worn) < 0.3


def test_the_method_of_the_paper_adapts_three_weights_and_takes_no_other_model(plant):
    paper = observer(Actuator(), "paper")
    assert [c.base for c in paper.joint.coordinates] == ["theta_1", "theta_2", "theta_3"]
    with pytest.raises(ParameterError, match="takes the model 'isothermal' with the paper's three splines"):
        observer(replace(Actuator(), model="energy-balance"), "paper")


def test_observers_side_by_side_and_in_threads_have_the_numbers_that_they_have_alone(joint, plant, log):
    other = observer(plant.replace({"F_C": 150.0}))
    blocks = [log.slice(a, a + 7) for a in range(0, 700, 7)]

    def last(single, turns=1):
        states = [start(single)] * turns
        for block in blocks:
            states = [observe(single, state, block)[0] for state in states]
        return states[-1].theta

    alone = [last(single) for single in (joint, other)]
    states = [start(joint), start(other)]
    for block in blocks:
        states = [observe(single, state, block)[0] for single, state in zip((joint, other), states, strict=True)]
    for state, theta in zip(states, alone, strict=True):
        assert np.array_equal(state.theta, theta)
    with ThreadPoolExecutor(4) as threads:
        for theta in threads.map(last, [joint] * 4, range(1, 5)):
            assert np.array_equal(theta, alone[0])
