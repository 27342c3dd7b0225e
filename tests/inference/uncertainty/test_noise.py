"""Softened noise trusts everything less, and by the same factor."""

import numpy as np
import pytest

from clutchid.log.states import STATES
from clutchid.model.variants import VARIANTS
from clutchid.simulation.noise import Noise


def test_softened_noise_is_larger_by_the_factor_and_keeps_the_bound_on_outliers():
    noise = Noise()
    soft = noise.inflated(8.0)
    assert soft.measured == pytest.approx({name: 8 * value for name, value in noise.measured.items()})
    assert soft.states == pytest.approx({name: 8 * value for name, value in noise.states.items()})
    assert soft.flow == pytest.approx(8 * noise.flow)
    assert soft.outlier == noise.outlier


def test_every_state_has_a_natural_size_a_noise_and_a_start():
    assert {name for names in VARIANTS.values() for name in names} == set(STATES)
    assert all(min(s.scale, s.noise, s.start, s.step, s.fast) > 0 for s in STATES.values())


def test_a_start_that_does_not_rest_is_known_less_well_than_one_that_does():
    wider = {name for name, state in STATES.items() if state.unknown_start > state.start}
    assert wider == {"y", "v", "p_A", "z", "x_vs", "x_ve"}
    assert all(state.unknown_start >= state.start for state in STATES.values())


def test_a_rate_has_the_unit_of_the_state_a_second():
    assert [STATES[name].rate_unit for name in ("y", "v", "p_A", "T_A")] == ["m/s", "m/s²", "Pa/s", "K/s"]


def test_noise_cannot_be_changed_behind_the_back_of_a_fit():
    with pytest.raises(TypeError):
        Noise().states["y"] = np.inf


def test_samples_nearer_than_the_memory_tell_as_much_as_one():
    noise = Noise(memory=0.01)
    usual = noise.measured["position"]
    assert noise.of_samples("position", 1e-3) == pytest.approx(usual * np.sqrt(10.0))
    assert noise.of_samples("position", 0.02) == usual
    assert Noise().of_samples("position", 1e-3) == usual
