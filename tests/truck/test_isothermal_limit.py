"""With everything extra switched off and ever better heat transfer, the plant becomes the paper's model."""

from itertools import pairwise

import numpy as np
import pytest

import clutchid
from clutchid.truck import Truck
from clutchid.truck.assembly import at_rest
from clutchid.truck.load_table import LoadTable

pytestmark = pytest.mark.slow

B_0, N = 0.4, 250
#: A pulse of the supply, then one of the exhaust, each with a valve that opens within one tick of 0.1 ms.
PULSES = ((10, 50, 1.0, 0.0), (120, 180, 0.0, 1.0))
START = 4e-3

PAPER = clutchid.Parameters(
    P_0=1.013e5, T_0=293.15, R=287.05, B_0=B_0, B_vs=1, B_ve=1, B_in=1, B_out=1, r_lam=0.995,
    R_0vs=0, R_0ve=0, R_1vs=1, R_1ve=1,
)  # fmt: skip
LOAD = clutchid.Load((9e5, -0.3e5, 0.5e5))
CURVE = LoadTable(LOAD.breakpoints, LOAD.combined(), 0.0, 0.0)
PLAIN = Truck(
    P_0=PAPER.P_0, T_0=PAPER.T_0, R=PAPER.R, dT_w=0, V_S=1e9, G_S=0, UA_S=0, dP_G=0, r_up=1, r_down=1,
    C_s=PAPER.C_vs, C_e=PAPER.C_ve, C_r=PAPER.C_r, b_s=B_0, b_e=B_0, b_r=B_0, m_s=0.5, m_e=0.5, m_r=0.5, r_lam=0.995,
    C_AB=0, C_A0=0, F_C=PAPER.F_C, c_F=0, R_S=1, K_z=PAPER.K_z, D_z=PAPER.D_zdot, v_z=1e3, D_v=PAPER.D_v,
    F_h=1e-4, mu_h=0, K_h=1, T_pwm=1e-3, t_1s=0, t_2s=1e-4, t_3s=0, t_4s=1e-4, t_1e=0, t_2e=1e-4, t_3e=0, t_4e=1e-4,
)  # fmt: skip


def pressure_at_start() -> float:
    return PAPER.P_0 + float(LOAD.force(np.array([START]))[0]) / PAPER.A_A


@pytest.fixture(scope="module")
def plain(lab):
    """Position and both pressures of the plant with a heat transfer of h in both chambers."""

    def make(h: float) -> np.ndarray:
        truck = PLAIN.replace({"h_A": h, "h_B": h})
        start = lab.put(truck, at_rest(truck, CURVE), START, pressure_at_start())
        states = lab.states(truck, lab.forced(N, PULSES), 4, start=start, curve=CURVE)
        return np.column_stack([states[:, 0], *lab.pressures(truck, states)[:2]])

    return make


def paper(lab, steps: int) -> np.ndarray:
    """The same of the paper's model; a lift that rises over a tick is held at its mean over that tick.

    A coil without delay still lets its armature move from the next tick on.
    """
    ticks = np.repeat(lab.forced(N, PULSES), 10, axis=0)
    late = np.concatenate([ticks[:1], ticks[:-1]])
    lift = np.where(np.diff(late, axis=0, prepend=late[:1]) != 0, 0.5, late)
    lift = np.repeat(lift, steps, axis=0)
    columns = {"duty_supply": lift[:, 0], "duty_exhaust": lift[:, 1]}
    log = clutchid.Log(np.arange(len(lift)) * (1e-4 / steps), columns)
    simulated = clutchid.simulate(clutchid.Actuator(PAPER, LOAD), log, starts=[(START, pressure_at_start())]).log
    states = np.column_stack([simulated[name] for name in ("position", "pressure_a", "pressure_b")])
    return states[:: 10 * steps]


def test_growing_heat_transfer_leads_to_the_papers_model(lab, plain):
    wanted = paper(lab, 4)
    assert wanted[:, 0].max() > 9e-3
    h = (1e5, 2e5, 4e5)
    runs = [plain(value) for value in h]
    distance = [np.abs(run - wanted).max(axis=0) for run in runs]
    for near, far in zip(distance[1:], distance[:-1], strict=True):
        assert far / near == pytest.approx([2, 2, 2], abs=0.1)  # the distance goes with 1 / h
    once, twice = (2 * b - a for a, b in pairwise(runs))
    limit = (4 * twice - once) / 3
    # what is left after extrapolation is of the size of its last correction; the rest that cannot be switched off: a
    # bearing of 0.1 mN against springs of 2.5e5 N/m, lifts held at their mean for 0.1 ms (the paper's step, halved)
    step = np.abs(wanted - paper(lab, 8)).max(axis=0)
    bound = 2 * np.abs(limit - twice).max(axis=0) + step + np.array([1e-4 / 2.5e5, 1e-4 / 0.0123, 0])
    assert np.all(np.abs(twice - wanted).max(axis=0) < bound)
    assert bound[0] < 1e-7
    assert bound[1] < 10


def test_without_heat_transfer_the_plant_is_not_the_papers_model(lab, plain):
    assert np.abs(plain(60.0) - paper(lab, 4))[:, 0].max() > 0.2e-3
