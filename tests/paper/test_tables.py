"""Table 1, and what can be computed from it and from two rows of Table 2 by hand; the page: `test_printed_tables`."""

import numpy as np
import pytest

from clutchid.estimation.request import bounds_of
from clutchid.estimation.result import errors_over
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.static import static_pressure
from clutchid.parameters import Parameters
from clutchid.study.tables import TABLE_1

Y = np.linspace(0, 25e-3, 2501)


def test_the_first_weight_is_worth_4927_newton_4_bar_on_the_piston():
    theta_1 = TABLE_1[None][0]
    height = Load().phi(np.array([8.5e-3]))[0, 0]
    assert theta_1 * height == pytest.approx(4927, abs=0.5)
    assert theta_1 * height / Parameters().A_A == pytest.approx(4.0e5, abs=0.05e5)


@pytest.mark.parametrize("method", TABLE_1)
def test_the_loads_of_table_1_are_forces_that_the_supply_can_hold(method):
    for slope in (1.0, 0.001):
        force = Load(TABLE_1[method], phi2_slope=slope).force(Y[Y <= 15e-3])
        assert 4000 < force.max() < 5500
        held = static_pressure(force.max(), 1.095e5, 12.3e-3)
        assert 4e5 < held < 9e5


def test_the_peak_lies_before_8_5_mm_with_the_stated_conditions():
    # theta_1 phi_1' + theta_2 phi_2' = 0 at t_3 - 6.5 mm * k / (1 + k) with k = -theta_2 / theta_1
    for name in (2, 4, 16, 32):  # theta_3 of the others lifts the load beyond
        theta_1, theta_2, _ = TABLE_1[name]
        k, peak = -theta_2 / theta_1, Y[np.argmax(Load((theta_1, theta_2, 0.0)).force(Y))]
        assert 8.0e-3 < peak == pytest.approx(8.5e-3 - 6.5e-3 * k / (1 + k), abs=1.1e-5)


def test_table_1_lies_in_the_default_bounds_of_a_fit_and_three_rows_of_it_on_the_bound_of_theta_3():
    bounds = bounds_of(Load().names, Actuator(), {})
    for theta in TABLE_1.values():
        assert all(low <= value <= high for value, (low, high) in zip(theta, bounds.values(), strict=True))
    low, high = bounds["theta_3"]
    assert [name for name, theta in TABLE_1.items() if theta[2] in (low, high)] == [4, 16, 32]
    # every row has a theta_2 below 0, which is no bound: a worn clutch turns its sign
    assert bounds["theta_2"] == (-np.inf, np.inf)


@pytest.mark.parametrize(
    ("position", "pressure", "rms_position", "rms_pressure"),
    [(0.2678e-4, 2.7602e12, 0.094e-3, 0.30e5), (4.1361e-3, 1.020e12, 1.17e-3, 0.18e5)],
    ids=["ballistic", "N=32"],
)
def test_what_figures_3_and_4_can_show_over_some_3000_samples_has_our_sums_of_squares_in_table_2(
    position, pressure, rms_position, rms_pressure
):
    n, sign = 3000, (-1.0) ** np.arange(3000)
    still = Log(np.arange(n) * 1e-3, {"position": np.zeros(n), "pressure_a": np.zeros(n)})
    off = still.with_columns(position=rms_position * sign, pressure_a=rms_pressure * sign)
    errors = errors_over([(still, off)])
    assert (errors.position_rms, errors.pressure_a_rms) == pytest.approx((rms_position, rms_pressure), rel=1e-12)
    # the errors are read to 0.5 um or 5 um, and to 500 Pa; a square doubles that share
    assert errors.position_sse == pytest.approx(position, rel=2 * 0.006)
    assert errors.pressure_a_sse == pytest.approx(pressure, rel=2 * 0.028)
