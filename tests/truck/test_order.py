"""The order of the integration through valve edges and ramps: four, because every edge lies on the grid."""

import numpy as np
import pytest

from clutchid.truck import Truck, load_curve
from clutchid.truck.assembly import at_rest

STATES = Truck.parts.structure.states

#: A stretch without kinks but those of the valve: chamber B sealed, no choking, always forwards, a smooth load.
SMOOTH = Truck(
    P_S=7e5, C_r=0, b_s=0.1, load="kluever", k_k=0, R_S=1.2, t_1s=0.7e-3, t_2s=1.1e-3, t_3s=0.8e-3, t_4s=1.3e-3
)
N, DUTY, START = 80, 0.4, 3e-3
HALVINGS = (1, 2, 4, 8)


@pytest.fixture(scope="module")
def course(lab):
    def make(substeps: int) -> np.ndarray:
        curve = load_curve(SMOOTH)
        load = float(curve.force(np.array([START]))[0])
        start = lab.put(SMOOTH, at_rest(SMOOTH, curve), START, SMOOTH.P_0 + (load + 200) / SMOOTH.A_A)
        return lab.states(SMOOTH, np.tile([DUTY, 0.0], (N, 1)), substeps, start=start)

    return make


def test_the_stretch_has_edges_and_ramps_but_no_other_kinks(lab, course):
    states = course(64)
    lift = states[:, STATES.index("x_s")]
    ratio = lab.pressures(SMOOTH, states)[0] / lab.pressures(SMOOTH, states)[2]
    assert np.all(states[1:, STATES.index("v")] > 0)
    assert np.all((ratio > SMOOTH.b_s) & (ratio < SMOOTH.r_lam))
    assert np.sum(np.diff(np.sign(lift)) > 0) == 8  # one opening a period of 10 ms


@pytest.mark.parametrize("name", ["y", "v", "m_A", "U_A", "z"])
def test_halving_the_step_makes_the_error_sixteen_times_smaller(course, name):
    exact = course(64)[:, STATES.index(name)]
    errors = [np.abs(course(k)[:, STATES.index(name)] - exact).max() for k in HALVINGS]
    size = np.abs(exact).max()
    # 51,200 steps of the finest run leave sqrt(51200) eps / 2 = 2.5e-14 of rounding; errors count from 20 times that
    counted = [(k, error) for k, error in zip(HALVINGS, errors, strict=True) if error > 5e-13 * size]
    assert len(counted) >= 2
    slope = -np.polyfit(*np.log(np.array(counted)).T, 1)[0]
    # the next term of the error is h lambda of the first, 0.1 ms times 1500 / s at most: it bends the slope by 0.15;
    # an order lost or gained would be one
    assert slope == pytest.approx(4, abs=0.25)
