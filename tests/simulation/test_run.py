"""The start of a run: Eq. (24) or what is known of it, and its exact derivatives."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.variants import VARIANTS
from clutchid.simulation.plan import Segment, plan
from clutchid.simulation.run import (
    POSITION_START,
    PRESSURE_START,
    KernelArrays,
    columns,
    run_with_sensitivities,
    start_sensitivities,
    start_state,
)

AUTOMATIC = "energy-balance-stribeck"
LOAD = Load((9e5, -0.3e5, 0.6e5))
RATE = 2000.0


def begun(actuator: Actuator, position: float, pressure: float | None = None) -> Segment:
    """A segment that begins at a position in m, and at a measured pressure in Pa where there is one."""
    n = 20
    supplied = {"duty_supply": np.ones(n), "duty_exhaust": np.zeros(n), "position": np.full(n, position)}
    log = Log(np.arange(n) * 1e-3, supplied if pressure is None else {**supplied, "pressure_a": np.full(n, pressure)})
    (segment,) = plan(log, actuator, RATE, use_pressure=pressure is not None).segments
    return segment


def by_name(actuator: Actuator, values: np.ndarray) -> dict[str, float]:
    return dict(zip(VARIANTS[actuator.model], values.tolist(), strict=True))


def test_a_vented_actuator_starts_at_ambient_pressure_with_the_air_of_its_walls_and_a_full_reservoir():
    actuator = Actuator(load=LOAD, model=AUTOMATIC).replace({"T_w": 300.0, "P_S": 8.5e5, "P_0": 0.9e5})
    start = by_name(actuator, start_state(begun(actuator, 1e-4), actuator))
    expected = {"y": 1e-4, "p_A": 0.9e5, "p_B": 0.9e5, "T_A": 300.0, "T_B": 300.0, "p_S": 8.5e5, "p_G": 8.5e5}
    assert start == {name: expected.get(name, 0.0) for name in VARIANTS[AUTOMATIC]}


def test_a_start_under_pressure_holds_the_load_but_no_load_that_pulls():
    actuator = Actuator(load=LOAD)
    p, force = actuator.parameters, float(LOAD.force(np.array([6e-3]))[0])
    assert by_name(actuator, start_state(begun(actuator, 6e-3), actuator))["p_A"] == p.P_0 + force / p.A_A
    pulled = Actuator(load=Load((-9e5, 0.0, 0.0)))
    assert by_name(pulled, start_state(begun(pulled, 6e-3), pulled))["p_A"] == p.P_0


def test_a_measured_or_estimated_start_comes_before_a_guess():
    actuator = Actuator(load=LOAD)
    measured = begun(actuator, 6e-3, 4.2e5)
    assert by_name(actuator, start_state(measured, actuator))["p_A"] == 4.2e5
    start = by_name(actuator, start_state(measured, actuator, (7e-3, 3.9e5)))
    assert (start["y"], start["p_A"], start["p_B"]) == (7e-3, 3.9e5, actuator.parameters.P_0)


SITUATIONS = {
    "vented": (1e-4, None, None),
    "vented with a measured pressure": (1e-4, 1.2e5, None),
    "under a load": (6e-3, None, None),
    "under a load that pulls": (6e-3, None, None),
    "measured under a load": (6e-3, 4.2e5, None),
    "estimated": (6e-3, None, (7e-3, 3.9e5)),
    "estimated with a measured pressure": (6e-3, 4.2e5, (7e-3, 3.9e5)),
}


@pytest.mark.parametrize("model", [AUTOMATIC, "isothermal"])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_the_start_moves_with_each_number_as_its_derivative_says(situation, model):
    position, pressure, estimated = SITUATIONS[situation]
    load = Load((-9e5, 0.0, 0.0)) if situation.endswith("pulls") else LOAD
    actuator = Actuator(load=load, model=model)
    segment = begun(actuator, position, pressure)
    names = ("P_0", "P_S", "T_w", "A_A", "A_B", "V_0A", "C_vs", "theta_1", "theta_2", "theta_3")
    sensitivities = start_sensitivities(segment, actuator, columns(actuator, names), estimated is not None)
    for column, name in enumerate(names):
        value = actuator.value(name)
        step = 1e-4 * abs(value) or 1.0  # N/m, of a load weight
        low, high = (start_state(segment, actuator.replace({name: value + k * step}), estimated) for k in (0, 1))
        # states go with 1 / A_A at most: a step of 1e-4 of the number is wrong by as much; and rounding of 9e5 Pa
        np.testing.assert_allclose(sensitivities[:, column], (high - low) / step, rtol=2e-4, atol=9e5 * 2.3e-16 / step)


def test_the_unknown_start_is_a_number_of_its_own():
    actuator = Actuator(load=LOAD)
    which = columns(actuator, (POSITION_START, PRESSURE_START))
    S = start_sensitivities(begun(actuator, 6e-3), actuator, which, True)
    expected = np.zeros((5, 2))
    expected[VARIANTS["isothermal"].index("y"), 0] = expected[VARIANTS["isothermal"].index("p_A"), 1] = 1.0
    assert np.array_equal(S, expected)


@pytest.mark.parametrize("name", ["theta_1", "C_vs"])
def test_after_a_failure_states_and_derivatives_are_missing(name):
    actuator = Actuator(load=Load((9e5, -1e12, 0.0)))
    n = 100
    log = Log(np.arange(n) * 1e-3, {"duty_supply": np.ones(n), "duty_exhaust": np.zeros(n)})
    (segment,) = plan(log, actuator, RATE).segments
    which = columns(actuator, (name,))
    start = start_state(segment, actuator), start_sensitivities(segment, actuator, which, False)
    states, sens, _, failed = run_with_sensitivities(segment, KernelArrays.of(actuator), start, which, range(5))
    assert 0 < failed < n - 1
    assert np.isfinite(states[:failed]).all()
    assert np.isfinite(sens[:failed]).all()
    assert np.isnan(states[failed + 1 :]).all()
    assert np.isnan(sens[failed:]).all()
