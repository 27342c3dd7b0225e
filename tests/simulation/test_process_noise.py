"""Process noise of an interval, and what it adds up to."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.model.variants import VARIANTS
from clutchid.simulation.noise import Noise, process_noise

STATES = VARIANTS["energy-balance-stribeck"]
PRESSURE = STATES.index("p_A")
SILENT = replace(Noise(), states=dict.fromkeys(STATES, 0.0))


@pytest.fixture
def still(plant, recorded_by, problem_of):
    """100 intervals of a segment, both valves as open as asked for."""

    def make(supply: float, exhaust: float):
        segment = problem_of([recorded_by(plant, 0.2)], plant, ("C_vs",)).tracks[0].segment
        inputs = segment.inputs[:101].copy()
        inputs[:, 0], inputs[:, 1] = supply, exhaust
        dt, open_std = segment.dt[:100], segment.open_std[:100]
        return replace(segment, stop=segment.start + 101, inputs=inputs, dt=dt, open_std=open_std)

    return make


def test_closed_valves_leave_what_the_states_do_by_themselves_and_it_adds_up_to_its_size_over_the_span(plant, still):
    sigma = process_noise(still(0.0, 0.0), plant, Noise())
    # 0.1 s, over which each state goes astray by so much: m, m/s, Pa, Pa, m, K, K, Pa, Pa, m
    wanted = [2e-6, 2e-3, 300.0, 200.0, 5e-6, 0.5, 0.5, 1500.0, 2000.0, 5e-6]
    assert np.sqrt(np.sum(sigma**2, axis=0)) == pytest.approx(wanted, rel=1e-9)
    # after a quarter of the intervals a random walk is half as far
    assert np.sqrt(np.sum(sigma[:25] ** 2, axis=0)) == pytest.approx([0.5 * size for size in wanted], rel=1e-9)


def test_an_open_valve_adds_its_share_of_the_air_that_comes_in_over_the_span(plant, still):
    total = np.sqrt(np.sum(process_noise(still(1.0, 0.0), plant, SILENT) ** 2, axis=0))
    # 1.185 kg/m³ * 19e-9 m³/(Pa·s) * 9 bar let 20.26 g/s in; 2 % of it for 0.1 s are 40.53 mg. At half the stroke the
    # chamber holds 148 + 123 cm² * 1.25 cm = 301.75 cm³, in which 1 mg at 293 K makes 279.65 Pa (288 J/(kg·K))
    assert total[PRESSURE] == pytest.approx(40.53 * 279.65, rel=1e-4)
    assert np.delete(total, PRESSURE) == pytest.approx(0.0)


def test_changes_of_a_duty_cycle_that_are_not_recorded_let_in_unknown_air(plant, still):
    closed = still(0.0, 0.0)
    total = process_noise(replace(closed, open_std=np.full(100, 1e-4)), plant, SILENT)
    # 20.26 g/s through the open supply valve for 0.1 ms, and 279.65 Pa/mg, as above
    assert total[:, PRESSURE] == pytest.approx(2.026 * 279.65, rel=1e-3)
    assert np.delete(total, PRESSURE, axis=1) == pytest.approx(0.0)
    opened = replace(still(1.0, 0.0), open_std=np.full(100, 1e-4))
    flow = process_noise(still(1.0, 0.0), plant, SILENT)[:, PRESSURE]
    assert process_noise(opened, plant, SILENT)[:, PRESSURE] == pytest.approx(np.hypot(flow, total[:, PRESSURE]))


def test_both_valves_open_misjudge_twice_the_air(plant, still):
    supply_alone, both = (process_noise(still(1.0, exhaust), plant, SILENT)[:, PRESSURE] for exhaust in (0.0, 1.0))
    assert both == pytest.approx(2 * supply_alone)
