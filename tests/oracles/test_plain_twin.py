"""The compiled kernels against the plain twin: the same rates, and the same motion as Radau at 1e-10."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.log.states import STATES
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels, system
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import simulate

pytestmark = pytest.mark.slow

THETA = (9e5, -0.3e5, 0.6e5)


def held(pattern: list[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Time and duty cycles at 1 kHz from (seconds, supply, exhaust)."""
    counts = [round(1000 * seconds) for seconds, _, _ in pattern]
    duties = np.repeat([[supply, exhaust] for _, supply, exhaust in pattern], counts, axis=0)
    return np.arange(sum(counts)) * 1e-3, duties


def states_of(time: np.ndarray, duties: np.ndarray, model: str = "isothermal") -> np.ndarray:
    """States of a simulation from rest."""
    log = Log(time, {"duty_supply": duties[:, 0], "duty_exhaust": duties[:, 1]})
    simulated = simulate(Actuator(load=Load(THETA), model=model), log).log
    return np.column_stack([simulated[STATES[name].column] for name in VARIANTS[model]])


#: Seconds, supply and exhaust: there and back with partial openings.
STROKES = [
    (0.02, 0, 0), (0.06, 0.8, 0), (0.10, 0, 0), (0.03, 0, 0.5), (0.10, 0, 0), (0.08, 0.15, 0), (0.08, 0, 0),
    (0.05, 0.8, 0), (0.08, 0, 0), (0.05, 0, 1.0), (0.10, 0, 0), (0.04, 0.5, 0.2), (0.05, 0, 0.12), (0.06, 0, 0),
]  # fmt: skip


def test_the_twin_and_the_package_hold_the_same_appendix(twin):
    parameters = Parameters()
    numbers = {name: getattr(parameters, name) for name in Parameters.names()}
    of_twin = twin.appendix | twin.beyond
    assert {name: numbers[name] for name in of_twin} == of_twin
    # what the twin does not know is off
    assert not any(numbers[name] for name in numbers.keys() - of_twin.keys())


@pytest.mark.parametrize("numbers", ["Appendix", "all different"])
def test_the_rates_of_all_states_are_those_of_the_twin_at_random_points(twin, numbers):
    generator = np.random.default_rng(1)
    n = 2000
    low = np.array([-1e-3, -0.3, 0.8e5, 0.8e5, -2e-4])
    high = np.array([26e-3, 0.3, 10e5, 2e5, 2e-4])
    x, u = generator.uniform(low, high, (n, 5)), generator.uniform(0, 1, (n, 2))
    x[: n // 4, 3] = 1.095e5 * generator.uniform(0.998, 1.002, n // 4)  # both sides of the laminar line
    load, p = Load(THETA), dict(twin.appendix)
    if numbers == "all different":  # no two valves, chambers or orifices are alike, so none can be taken for another
        p = {name: value * generator.uniform(0.85, 1.0) for name, value in p.items()}
        p |= {"A_A": 13e-3, "r_lam": 0.9985}
    parameters = Parameters().replace(p)
    computed, jacobian = np.empty((n, 5)), np.empty((n, 5, 5))
    kernels("isothermal").linearise(x, u, parameters.array(), load.breakpoints, load.combined(), computed, jacobian)
    expected = np.array([twin.rates(x[i], u[i], THETA, p) for i in range(n)])
    # a dozen forces of up to 40 kN (an end stop) over 10 kg, and flows of up to 1e3 bar/s near r = 1, where psi loses
    # three of sixteen digits: 1e-12 of the largest rate of the state
    assert np.all(np.abs(computed - expected).max(axis=0) <= 1e-12 * np.abs(expected).max(axis=0))


@pytest.mark.parametrize("slope", [1.0, 0.001])
def test_the_load_is_that_of_the_twin_from_below_zero_to_beyond_the_stroke(twin, slope):
    y = np.linspace(-2e-3, 27e-3, 1161)
    computed = Load(THETA, phi2_slope=slope).force(y)
    expected = [twin.load(value, THETA, slope) for value in y]
    # sums of a few terms of at most 1e4 N, each from cubics in y: some hundred roundings
    np.testing.assert_allclose(computed, expected, rtol=0, atol=1e4 * 1e-13)


def assert_within_a_micrometre(difference: np.ndarray) -> None:
    """Largest differences of the states are what a micrometre of position is worth in them."""
    assert difference[0] < 1e-6
    # 1 ms of motion, what 5 bar change when 12 mm of air shrink, and the same part of 300 K
    assert difference[1] < 1e-6 / 1e-3
    assert difference[2] < 5e5 / 12e-3 * 1e-6
    assert difference[4] < 1e-6  # the deflection rides on the position
    assert np.all(difference[5:6] < 300 / 12e-3 * 1e-6)


def test_inside_the_stroke_the_position_is_within_a_micrometre_of_radau(twin):
    time, duties = held(STROKES)
    reference = twin.radau(time, duties, [0, 0, 1.095e5, 1.095e5, 0], THETA)
    assert reference[:, 0].min() > -1e-12  # never in a stop, but for rounding
    assert 0.01 < reference[:, 0].max() < 0.024
    assert_within_a_micrometre(np.abs(states_of(time, duties) - reference).max(axis=0))


def test_through_an_impact_on_the_end_stop_the_position_is_within_thirty_micrometres_of_radau(twin):
    time, duties = held([(0.01, 0, 0), (0.35, 1.0, 0), (0.05, 0, 0), (0.6, 0, 1.0)])
    reference = twin.radau(time, duties, [0, 0, 1.095e5, 1.095e5, 0], THETA)
    assert reference[:, 0].max() > 25e-3  # it is in the stop
    assert np.abs(states_of(time, duties)[:, 0] - reference[:, 0]).max() < 30e-6


RICH = "energy-balance-stribeck"


@pytest.mark.parametrize("numbers", ["Appendix", "all different"])
def test_the_rates_of_the_energy_balance_are_those_of_mass_and_energy_in_the_twin(twin, numbers):
    generator = np.random.default_rng(2)
    n = 2000
    low = np.array([-1e-3, -0.3, 0.8e5, 0.8e5, -2e-4, 240.0, 240.0, 5e5, 8e5, -4e-4])
    high = np.array([26e-3, 0.3, 10e5, 2e5, 2e-4, 380.0, 380.0, 9e5, 1e6, 4e-4])
    x, u = generator.uniform(low, high, (n, 10)), generator.uniform(0, 1, (n, 2))
    x[: n // 4, 1] *= 0.05  # static friction fades within 10 mm/s
    x[: n // 4, 3] = 1.095e5 * generator.uniform(0.998, 1.002, n // 4)  # both sides of the laminar line
    x[n // 4 : n // 2, 2] = x[n // 4 : n // 2, 7] * generator.uniform(0.998, 1.002, n // 4)  # of the supply valve too
    x[n // 2 : 3 * n // 4, 2] = 1.095e5 * generator.uniform(0.998, 1.002, n // 4)  # and of the exhaust valve
    load, p = Load(THETA), twin.appendix | twin.beyond
    if numbers == "all different":
        p = {name: value * generator.uniform(0.85, 1.0) for name, value in p.items()}
        p |= {"A_A": 13e-3, "r_lam": 0.9985, "gamma": 1.32, "R_S": 1.2, "mu_h": 0.05, "n_vs": 1.3, "n_ve": 0.7}
        p |= {"b_vs": 0.45, "m_vs": 0.6, "b_ve": 0.2, "m_ve": 0.75, "C_A0": 4e-11}
    computed, jacobian = np.empty((n, 10)), np.empty((n, 10, 10))
    values = Parameters().replace(p).array()
    wide = np.pad(u, ((0, 0), (0, len(system(RICH).inputs) - 2)))
    kernels(RICH).linearise(x, wide, values, load.breakpoints, load.combined(), computed, jacobian)
    for i in range(n):
        c = twin.content(x[i], p)
        rate = np.array(twin.rich_rates(c, u[i], THETA, p))
        y, v, m_A, m_B, _, U_A, U_B, m_S, *_ = c
        pressures, temperatures = x[i, [2, 3, 7]], x[i, [5, 6]]
        V_dot = np.array([p["A_A"] * v, -p["A_B"] * v])
        V = np.array([p["V_0A"] + p["A_A"] * y, p["V_0B"] + p["A_B"] * (p["y_max"] - y)])
        grown = rate[[5, 6]] / [U_A, U_B]  # p ~ U / V, T ~ U / m, p_S ~ m_S
        expected = [
            *rate[:2],
            *pressures[:2] * (grown - V_dot / V),
            rate[4],
            *temperatures * (grown - rate[[2, 3]] / [m_A, m_B]),
            pressures[2] * rate[7] / m_S,
            *rate[8:],
        ]
        # as for the isothermal rates, a dozen terms that may cancel: 1e-12 of the largest rate over all the points
        assert np.all(np.abs(computed[i] - expected) <= 1e-12 * np.abs(computed).max(axis=0))


def test_the_energy_balance_moves_as_radau_on_mass_and_energy_to_a_micrometre(twin):
    time, duties = held(STROKES)
    reference = twin.rich_radau(time, duties, [0, 0, 1.095e5, 1.095e5, 0, 293, 293, 9e5, 9e5, 0], THETA)
    assert reference[:, 0].min() > -1e-12
    assert 0.01 < reference[:, 0].max() < 0.024
    assert np.ptp(reference[:, 5]) > 30  # the air heats up and cools by tens of kelvin
    assert np.ptp(reference[:, 7]) > 1e4  # and the supply sags
    assert_within_a_micrometre(np.abs(states_of(time, duties, RICH) - reference).max(axis=0))
