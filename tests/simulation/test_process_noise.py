"""Process noise of an interval, and what it adds up to."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.model.compiled import VARIANTS
from clutchid.simulation.process_noise import process_noise
from clutchid.states import NOISE_SPAN
from clutchid.uncertainty.noise import Noise

PRESSURE = VARIANTS["energy-balance-stribeck"].index("p_A")


@pytest.fixture
def still(plant, recorded_by, problem_of):
    """100 intervals of a segment, both valves as open as asked for."""

    def make(supply: float, exhaust: float):
        segment = problem_of([recorded_by(plant, 0.2)], plant, ("C_vs",)).tracks[0].segment
        inputs = segment.inputs[:101].copy()
        inputs[:, 0], inputs[:, 1] = supply, exhaust
        return replace(segment, stop=segment.start + 101, inputs=inputs, dt=segment.dt[:100])

    return make


def test_closed_valves_leave_what_the_states_do_by_themselves_and_it_adds_up_to_its_size_over_the_span(plant, still):
    noise = Noise()
    segment = still(0.0, 0.0)
    total = np.sqrt(np.sum(process_noise(segment, plant, noise) ** 2, axis=0))
    wanted = [noise.states[name] * np.sqrt(segment.dt.sum() / NOISE_SPAN) for name in VARIANTS[plant.model]]
    assert total == pytest.approx(wanted, rel=1e-9)


def test_an_open_valve_adds_its_share_of_the_air_that_comes_in_over_the_span(plant, still):
    silent = replace(Noise(), states=dict.fromkeys(VARIANTS[plant.model], 0.0))
    p, segment = plant.parameters, still(1.0, 0.0)
    total = np.sqrt(np.sum(process_noise(segment, plant, silent) ** 2, axis=0))
    rise = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / (p.V_0A + 0.5 * p.A_A * p.y_max) * NOISE_SPAN
    assert total[PRESSURE] == pytest.approx(silent.flow * rise, rel=1e-6)
    assert np.delete(total, PRESSURE) == pytest.approx(0.0)


def test_both_valves_open_misjudge_twice_the_air(plant, still):
    silent = replace(Noise(), states=dict.fromkeys(VARIANTS[plant.model], 0.0))
    one, both = (process_noise(still(1.0, exhaust), plant, silent)[:, PRESSURE] for exhaust in (0.0, 1.0))
    assert both == pytest.approx(2 * one)
