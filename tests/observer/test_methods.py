"""The reference methods without a filter of the states: the adaptive observer, and least squares on the balance."""

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.observer.following import observe
from clutchid.observer.observer import observer, start
from clutchid.observer.recording import observe_recording
from clutchid.observer.state_file import read_state, write_state
from clutchid.reports.observe_page import samples_figure

STROKE = np.linspace(2e-3, 9e-3, 30)


@pytest.fixture(scope="module", params=["adaptive", "rls"])
def one(request, plant):
    return observer(plant, request.param)


def equal(state, other):
    arrays = [*zip(state.filter, other.filter, strict=True), *zip(state.tail, other.tail, strict=True)]
    counted = (state.number, state.strokes) == (other.number, other.strokes)
    return counted and all(np.array_equal(a, b, equal_nan=True) for a, b in arrays)


def test_only_the_load_adapts(one, plant):
    assert {c.base for c in one.joint.coordinates} == set(plant.load.names)


def test_a_load_that_has_grown_is_followed(one, plant, worn, log):
    state, found = observe(one, start(one), log)
    off = np.abs(one.load(state).force(STROKE) - worn.load.force(STROKE))
    assert off.max() < 0.4 * np.abs(plant.load.force(STROKE) - worn.load.force(STROKE)).max()
    late = slice(len(log) // 2, None)
    pressure = found.states[late, plant.states.index("p_A")]
    assert np.sqrt(np.mean((pressure - log["pressure_a"][late]) ** 2)) < 15e3


@pytest.mark.parametrize("lengths", [[1] * 40 + [700, 3, 757], [1499, 1], [305, 695, 500]])
def test_blocks_of_any_length_give_the_same_numbers(one, log, lengths):
    part = log.slice(0, 1500)
    state, whole = observe(one, start(one), part)
    now, found, at = start(one), [], 0
    for length in lengths:
        now, some = observe(one, now, part.slice(at, at + length))
        found.append(some)
        at += length
    for name in ("states", "deviations", "innovations", "used"):
        together = np.concatenate([getattr(some, name) for some in found])
        assert np.array_equal(together, getattr(whole, name), equal_nan=True)
    assert equal(now, state)


@pytest.mark.parametrize("cut", [1, 330, 1234])
def test_a_run_that_is_resumed_from_its_file_gives_the_same_numbers(one, log, tmp_path, cut):
    first, _ = observe(one, start(one), log.slice(0, cut))
    write_state(one, first, tmp_path / "state.toml")
    again = read_state(one, tmp_path / "state.toml")
    assert equal(again, first)
    rest = log.slice(cut, 2500)
    (state, found), (other, resumed) = observe(one, first, rest), observe(one, again, rest)
    assert np.array_equal(found.states, resumed.states)
    assert np.array_equal(found.innovations, resumed.innovations, equal_nan=True)
    assert equal(state, other)


def test_a_state_of_one_rule_is_not_that_of_another(plant, log, tmp_path):
    made = {name: observer(plant, name) for name in ("adaptive", "rls")}
    write_state(made["rls"], observe(made["rls"], start(made["rls"]), log.slice(0, 500))[0], tmp_path / "state.toml")
    with pytest.raises(ParameterError, match="of another calibration or method"):
        read_state(made["adaptive"], tmp_path / "state.toml")


def test_spikes_gaps_and_a_frozen_sensor_are_survived(one, plant, worn, log):
    position = log["position"].copy()
    position[500::400] += 5e-3
    position[1500:1700] = np.nan
    position[2600:2900] = position[2600]
    state, found = observe(one, start(one), log.with_columns(position=position))
    assert np.isfinite(found.states).all()
    off = np.abs(one.load(state).force(STROKE) - worn.load.force(STROKE))
    assert off.max() < 0.6 * np.abs(plant.load.force(STROKE) - worn.load.force(STROKE)).max()


def test_figure_and_table_name_what_an_innovation_compares(one, log):
    run = observe_recording(one, log.slice(0, 2000))
    names = {"adaptive": ("innovation", "innovation std"), "rls": ("innovation_force [N]", "innovation_force_std [N]")}
    found, deviation = (run.estimates()[name] for name in names[one.method])
    assert np.array_equal(found, run.samples.innovations[:, 0], equal_nan=True)
    assert deviation**2 == pytest.approx(run.samples.innovations[:, 1], rel=1e-12, nan_ok=True)
    figure = samples_figure(run)
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert {"adaptive": "innovation\n[µm]", "rls": "innovation\n[N]"}[one.method] in labels
