"""The variants beyond the paper: each goes over into the paper's model where its own numbers vanish."""

from __future__ import annotations

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.log import Log
from clutchid.log.states import STATES
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels, system
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import Partition, simulate

THETA = (9e5, -0.3e5, 0.6e5)
GAS = ["isothermal", "energy-balance"]
SCALES = (1e-3, 1e-1, 1e5, 1e5, 1e-4, 1e2, 1e2, 1e5, 1e5, 1e-4, 1.0, 1.0)
LARGEST = "energy-balance-stribeck-proportional"

#: Where both gas models have the same valves: the older quarter ellipse is the paper's psi of B = 1.
SAME_VALVES = {"B_vs": 1.0, "B_ve": 1.0, "b_vs": 0.582, "m_vs": 0.5, "b_ve": 0.582, "m_ve": 0.5}


def linearised(variant: str, x: np.ndarray, u: np.ndarray, **changes: float) -> tuple[np.ndarray, np.ndarray]:
    load, p = Load(THETA), Parameters(**changes).array()
    rates, jacobian = np.empty_like(x), np.empty((*x.shape, x.shape[1]))
    wide = np.pad(u, ((0, 0), (0, len(system(variant).inputs) - 2)))  # what else is an input is off
    kernels(variant).linearise(x, wide, p, load.breakpoints, load.combined(), rates, jacobian)
    return rates, jacobian


@pytest.fixture(scope="module")
def points() -> tuple[np.ndarray, np.ndarray]:
    """Random states of the energy balance in and just outside the stroke, and duty cycles; seed fixed."""
    generator = np.random.default_rng(32)
    low = np.array([-2e-4, -0.3, 1.15e5, 0.9e5, -2e-4, 240.0, 250.0, 7.5e5, 8e5, -2e-4, 0.0, 0.0])
    high = np.array([25.2e-3, 0.3, 7.4e5, 1.4e5, 2e-4, 380.0, 330.0, 9e5, 1e6, 2e-4, 1.0, 1.0])
    x = generator.uniform(low, high, (500, 12))
    x[:250, 1] *= 0.05  # half of them where static friction fades
    return x, generator.uniform(0, 1, (500, 2))


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_kernels_of_a_variant_have_the_states_that_are_told(variant):
    assert tuple(str(state) for state in system(variant).states) == VARIANTS[variant]
    assert system(variant).parameter_names() == Parameters.names()
    assert [jump.name for jump in system(variant).jumps] == ["p", "q", "p, pressure", "q, pressure"]


@pytest.mark.parametrize("variant", ["adiabatic", "energy_balance", "Isothermal", ""])
def test_a_variant_that_does_not_exist_is_refused_with_the_known_ones(variant):
    for make in (lambda: Actuator(model=variant), lambda: kernels(variant), lambda: system(variant)):
        with pytest.raises(ParameterError, match="Known are isothermal, isothermal-stribeck, energy-balance, "):
            make()


@pytest.mark.parametrize("gas", GAS)
def test_without_static_friction_and_pressed_seals_stribeck_is_the_plain_friction(points, gas):
    x, u = points[0][:, : len(VARIANTS[gas])].copy(), points[1]
    plain = linearised(gas, x, u, R_S=1.0, c_F=0.0)
    stribeck = linearised(f"{gas}-stribeck", x, u, R_S=1.0, c_F=0.0)
    # The same terms in another order, K_z / F first or last, and others that are 0: a dozen roundings of the largest.
    for first, other in zip(plain, stribeck, strict=True):
        assert np.all(np.abs(first - other).max(axis=0) <= 12 * 2.3e-16 * np.abs(first).max(axis=0))


def test_air_at_the_temperature_of_the_walls_and_full_of_heat_has_the_rates_of_the_isothermal_model(points):
    # With gamma towards 1 the heat of compression vanishes: p_dot = R T_0 w / V - p V_dot / V, Eq. (4), at T = T_0.
    x, u = points[0][:, :10].copy(), points[1]
    x[:, [5, 6]], x[:, 7], x[:, 9] = 293.0, 9e5, 0.0
    gamma = 1 + 1e-9
    rich, _ = linearised("energy-balance", x, u, gamma=gamma, **SAME_VALVES)
    plain, _ = linearised("isothermal", x[:, :5].copy(), u, gamma=gamma, **SAME_VALVES)
    # of first order in gamma - 1, times temperature and heat terms of some ten times a rate; c_p loses nine digits
    assert np.all(np.abs(rich[:, :5] - plain) <= 1e-5 * np.abs(plain).max(axis=0))


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_vented_actuator_at_rest_stays_at_rest_in_every_variant(variant):
    x = np.array([[0.0, 0.0, 1.095e5, 1.095e5, 0.0, 293.0, 293.0, 9e5, 9e5, 0.0, 0.0, 0.0]])
    x = x[:, : len(VARIANTS[variant])].copy()
    rates, _ = linearised(variant, x, np.zeros((1, 2)))
    # areas times pressures of 1.3 kN cancel to rounding; over 10 kg
    assert np.abs(rates).max() <= 10 * 2.3e-16 * 1.35e3 / 10


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_jacobian_of_every_variant_is_the_derivative_of_its_rates(points, variant):
    states = VARIANTS[variant]
    x, u = points[0][:, : len(states)].copy(), points[1]
    rates, jacobian = linearised(variant, x, u)
    scales = dict(zip(VARIANTS[LARGEST], SCALES, strict=True))
    for column, state in enumerate(states):
        errors = []
        for step in (1e-5, 1e-6, 1e-7):
            h = np.zeros(len(states))
            h[column] = step * scales[state]
            slope = (linearised(variant, x + h, u)[0] - linearised(variant, x - h, u)[0]) / (2 * h[column])
            errors.append(np.abs(slope - jacobian[:, :, column]))
        # rounding of the rates over the step, and the curvature over it, at the better of the steps, point by point;
        # a kink between the two sides (knot, stop, |v|, r_lam) may spoil one point in a hundred
        size, rate = np.abs(jacobian[:, :, column]).max(axis=0), np.abs(rates).max(axis=0)
        good = (np.min(errors, axis=0) <= 1e-5 * size + 1e-14 * rate / (1e-6 * scales[state])).all(axis=1)
        assert good.mean() > 0.99, state


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("carry", ["p", "q"])
def test_a_jump_keeps_what_it_does_not_take_in_every_variant(variant, carry):
    # one reset to 6 mm in the middle of a held stroke: temperatures, supply and bearing go on
    n = 41
    position = np.full(n, np.nan)
    position[20] = 6e-3
    duty = {"duty_supply": np.zeros(n), "duty_exhaust": np.zeros(n)}
    log = Log(np.arange(n) * 1e-3, {"position": position, **duty})
    actuator = Actuator(Parameters(T_w=310.0), Load(THETA), variant)
    starts = [(8e-3, 4e5)]
    never = Partition(every=n, carry=carry)  # the same integration steps, shorter with q
    plain = simulate(actuator, log, starts=starts, partition=never).log
    reset = simulate(actuator, log, starts=starts, partition=Partition(parts=2, carry=carry)).log
    # A sample is stored before its jump, so the one after it has felt one millisecond of the new position.
    assert np.array_equal(reset["position"][:20], plain["position"][:20])
    assert abs(reset["position"][21] - 6e-3) < 0.3 * 1e-3
    squeezed = 1.0 if carry == "p" else (0.148e-3 + 12.3e-3 * plain["position"][20]) / (0.148e-3 + 12.3e-3 * 6e-3)
    # within that millisecond the piston moves 0.1 mm, 5 % of the air column and 1.4 times that in pressure
    assert reset["pressure_a"][21] == pytest.approx(squeezed * plain["pressure_a"][20], rel=0.05)
    if "T_A" in VARIANTS[variant]:
        assert reset["temperature_a"][21] == pytest.approx(plain["temperature_a"][20], rel=0.03)
        assert reset["pressure_supply"][-1] == reset["pressure_governor"][-1] == 9e5
        # the position jumps by 2 mm, the bearing follows the motion of that millisecond only
        assert abs(reset["deflection_bearing"][21] - plain["deflection_bearing"][20]) < 0.3 * 1e-3


def test_the_paper_has_no_temperature_and_the_energy_balance_has_the_column(drive):
    log = drive.slice(0, 500)
    assert "temperature_a" not in simulate(Actuator(load=Load(THETA)), log).log
    simulated = simulate(Actuator(load=Load(THETA), model="energy-balance"), log).log
    assert list(simulated.columns) == [
        "position",
        "duty_supply",
        "duty_exhaust",
        *[STATES[name].column for name in VARIANTS["energy-balance"]][1:],
    ]
