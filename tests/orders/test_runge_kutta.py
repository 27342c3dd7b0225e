"""The order of the integration on the model itself: four, for the states and for the sensitivities they carry."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.simulation import STATE_COLUMNS

#: A smooth stretch: chamber B sealed (no change of direction in its orifice), the supply weak enough for r > B_0 (no
#: choking), a slow rise between the knots t_2 and t_3 with v > 0 throughout.
SMOOTH = Actuator(Parameters(C_r=0.0, P_S=6e5), Load((9e5, -0.3e5, 0.6e5)))
START = (4e-3, 4.2e5)
NAMES = ("theta_1", "theta_2", "theta_3", "A_A", "A_B", "V_0A", "V_0B", "P_0", "R", "M", "P_S", "D_v", "K_z", "D_zdot",
         "F_C", "R_0vs", "R_1vs", "B_vs", "C_vs", "B_0", "rho_0")  # fmt: skip
HALVINGS = (4, 8, 16, 32)
SECONDS = 0.064


def run(parts: int) -> tuple[np.ndarray, np.ndarray]:
    """States and sensitivities at every millisecond, with `parts` integration steps a millisecond."""
    n = round(1000 * SECONDS) * parts + 1
    log = Log(np.arange(n) * (1e-3 / parts), {"duty_supply": np.full(n, 0.2), "duty_exhaust": np.zeros(n)})
    done = simulate(SMOOTH, log, starts=[START], sensitivities=NAMES)
    states = np.column_stack([done.log[name][::parts] for name in STATE_COLUMNS])
    return states, np.stack([done.sensitivities[name][::parts] for name in NAMES], axis=2)


@pytest.fixture(scope="module")
def exact():
    return run(256)


@pytest.fixture(scope="module")
def rough():
    return [run(parts) for parts in HALVINGS]


def order(errors: list[float]) -> float:
    """Slope of the logarithm of the error over the logarithm of the step."""
    return -float(np.polyfit(np.log(HALVINGS), np.log(errors), 1)[0])


def test_the_stretch_is_smooth(exact):
    states, _ = exact
    y, v, p_A = states[:, 0], states[:, 1], states[:, 2]
    assert np.all(v[1:] > 0)
    assert y.min() > 2e-3
    assert y.max() < 8.5e-3
    assert np.all((p_A / 6e5 > 0.582) & (p_A / 6e5 < 0.999))
    assert np.ptp(y) > 0.5e-3


@pytest.mark.parametrize("state", range(5), ids=STATE_COLUMNS)
def test_halving_the_step_makes_the_error_of_a_state_sixteen_times_smaller(exact, rough, state):
    errors = [np.abs(states[:, state] - exact[0][:, state]).max() for states, _ in rough]
    # steps of 0.25 to 0.03 ms against rates of up to 2 / ms: the next term of the error, h lambda of the first, bends
    # the slope by 0.5 to 0.06, a quarter over all; an order lost or gained would be one
    assert order(errors) == pytest.approx(4, abs=0.25)


@pytest.mark.parametrize("name", NAMES)
def test_halving_the_step_makes_the_error_of_a_sensitivity_sixteen_times_smaller(exact, rough, name):
    column = NAMES.index(name)
    if not np.abs(exact[1][:, :, column]).any():
        pytest.fail(f"the stretch does not depend on {name}")
    size = np.abs(exact[1][:, :, column]).max(axis=0)
    used = size > 0
    errors = [
        (np.abs(sens[:, used, column] - exact[1][:, used, column]).max(axis=0) / size[used]).max() for _, sens in rough
    ]
    assert order(errors) == pytest.approx(4, abs=0.25)
