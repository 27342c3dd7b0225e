"""The order of the integration on the model itself: four, for the states and for the sensitivities they carry."""

from functools import cache

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.log.states import STATES
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels, system
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import simulate

#: A smooth stretch: chamber B sealed (no change of direction in its orifice), the supply weak enough for r > B_0 (no
#: choking), a slow rise between the knots t_2 and t_3 with v > 0 throughout. The second one has everything that goes
#: beyond the paper: its static friction fades over 0.1 m/s, so that a step resolves the fading, and its reservoir is
#: small and fast, so that the error of its pressure stands above rounding; its bearing slips after some tenths of a
#: millimetre, which a step resolves, and its exhaust stays shut.
PARAMETERS = {"C_r": 0.0, "P_S": 6e5}
LOAD = Load((9e5, -0.3e5, 0.6e5))
VARIANT = {
    "isothermal": Actuator(Parameters(**PARAMETERS), LOAD),
    "energy-balance-stribeck": Actuator(
        Parameters(**PARAMETERS, v_S=0.1, V_S=3e-4, tau_S=0.02, F_h=50.0, mu_h=0.05, K_h=4e5, m_vs=0.6),
        LOAD,
        "energy-balance-stribeck",
    ),
}
START = (4e-3, 4.2e5)
NAMES = ("theta_1", "theta_2", "theta_3", "A_A", "A_B", "V_0A", "V_0B", "P_0", "R", "M", "P_S", "D_v", "K_z", "D_zdot",
         "F_C", "R_0vs", "R_1vs", "B_vs", "C_vs", "B_0", "rho_0")  # fmt: skip
BEYOND = ("gamma", "T_w", "h_A", "h_B", "V_S", "tau_S", "R_S", "v_S", "c_F", "b_vs", "m_vs", "F_h", "mu_h", "K_h",
          "n_vs")  # fmt: skip
#: Of the energy balance valve and orifice have shapes of their own; chamber B is sealed.
RICH = (*(name for name in NAMES if name not in ("B_vs", "B_0")), *BEYOND)
CASES = [("isothermal", name) for name in NAMES] + [("energy-balance-stribeck", name) for name in RICH]
HALVINGS = (4, 8, 16, 32)
SECONDS = 0.064


@cache
def run(variant: str, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """States and sensitivities at every millisecond, with `parts` integration steps a millisecond."""
    n = round(1000 * SECONDS) * parts + 1
    log = Log(np.arange(n) * (1e-3 / parts), {"duty_supply": np.full(n, 0.2), "duty_exhaust": np.zeros(n)})
    names = NAMES if variant == "isothermal" else RICH
    simulation = simulate(VARIANT[variant], log, starts=[START], sensitivities=names)
    states = np.column_stack([simulation.log[STATES[name].column][::parts] for name in VARIANTS[variant]])
    return states, np.stack([simulation.sensitivities[name][::parts] for name in names], axis=2)


def order(errors: list[float]) -> float:
    """Slope of the logarithm of the error over the logarithm of the step."""
    return -float(np.polyfit(np.log(HALVINGS), np.log(errors), 1)[0])


@pytest.mark.parametrize("variant", VARIANT)
def test_the_stretch_is_smooth(variant):
    states, _ = run(variant, 256)
    y, v, p_A, p_B = (states[:, i] for i in range(4))
    assert np.all(v[1:] > 0)
    assert y.min() > 2e-3
    assert y.max() < 8.5e-3
    supply = states[:, 7] if states.shape[1] > 5 else 6e5
    assert np.all((p_A / supply > 0.582) & (p_A / supply < 0.999))
    assert np.all(p_A > p_B)
    assert np.ptp(y) > 0.5e-3
    if states.shape[1] > 5:
        p = VARIANT[variant].parameters
        assert np.all(p_A / supply > p.b_vs)
        assert 0.3 < np.abs(states[-1, 9]) * p.K_h / (p.F_h + p.mu_h * LOAD.force(y[-1:])[0]) < 1  # it slips


@pytest.mark.parametrize(
    ("variant", "state"), [(name, state) for name in VARIANT for state in VARIANTS[name] if state != "p_G"]
)
def test_halving_the_step_makes_the_error_of_a_state_sixteen_times_smaller(variant, state):
    number = VARIANTS[variant].index(state)
    exact, _ = run(variant, 256)
    errors = [np.abs(run(variant, parts)[0][:, number] - exact[:, number]).max() for parts in HALVINGS]
    # steps of 0.25 to 0.03 ms against rates of up to 2 / ms: the next term of the error, h lambda of the first, bends
    # the slope by 0.5 to 0.06, a quarter over all; an order lost or gained would be one
    assert order(errors) == pytest.approx(4, abs=0.25)


def test_a_governor_that_starts_off_its_mean_forgets_it_and_the_supply_follows_with_order_four():
    # a simulation starts at the mean, so the kernel is called itself; vented and at rest, all else stays
    variant, p = "energy-balance-stribeck", Parameters(tau_S=0.02, tau_G=0.03)
    load = Actuator(p, LOAD, variant).load
    start = {"p_A": p.P_0, "p_B": p.P_0, "T_A": p.T_w, "T_B": p.T_w, "p_S": p.P_S, "p_G": p.P_S + 3e4}
    x = np.array([start.get(name, 0.0) for name in VARIANTS[variant]])
    t = 1e-3 * np.arange(65)
    governor = p.P_S + 3e4 * np.exp(-t / p.tau_G)
    share = p.tau_G / (p.tau_G - p.tau_S)
    supply = p.P_S + 3e4 * share * (np.exp(-t / p.tau_G) - np.exp(-t / p.tau_S))
    errors = []
    for parts in (1, 2, 4, 8):
        u, out = np.zeros((t.size, len(system(variant).inputs))), np.empty((t.size, x.size))
        steps, never, nothing = np.full(64, parts, np.int32), np.zeros(t.size, np.uint8), np.zeros((t.size, 2))
        dt, table = np.full(64, 1e-3), (load.breakpoints, load.combined())
        assert kernels(variant).run(x.copy(), u, p.array(), dt, steps, never, nothing, *table, out) == -1
        errors.append([np.abs(out[:, 7] - supply).max(), np.abs(out[:, 8] - governor).max()])
        assert np.array_equal(out[:, :7], np.tile(x[:7], (65, 1)))
    for column in np.transpose(errors):
        assert -np.polyfit(np.log([1, 2, 4, 8]), np.log(column), 1)[0] == pytest.approx(4, abs=0.25)


@pytest.mark.parametrize(("variant", "name"), CASES)
def test_halving_the_step_makes_the_error_of_a_sensitivity_sixteen_times_smaller(variant, name):
    column = (NAMES if variant == "isothermal" else RICH).index(name)
    exact = run(variant, 256)[1][:, :, column]
    if not np.abs(exact).any():
        pytest.fail(f"the stretch does not depend on {name}")
    size = np.abs(exact).max(axis=0)
    used = size > 0
    errors = [
        (np.abs(run(variant, parts)[1][:, used, column] - exact[:, used]).max(axis=0) / size[used]).max()
        for parts in HALVINGS
    ]
    assert order(errors) == pytest.approx(4, abs=0.25)
