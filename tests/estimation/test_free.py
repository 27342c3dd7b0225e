"""Within which bounds a number is searched that the user gives none."""

import numpy as np
import pytest

from clutchid.estimation.request import bounds_of
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        # a magnitude: within a factor of three of the Appendix's 19e-9 and 9 bar
        ("C_vs", 19e-9 / 3, 57e-9),
        ("P_S", 3e5, 27e5),
        # both ends are admissible, 0.07 or not
        ("R_0vs", 0.0, 1.0),
        ("B_vs", -1.0, 1.0),
        # 0 itself is not admissible: a third of 0.93 and of 0.582
        ("R_1vs", 0.31, 2.0),
        ("B_0", 0.194, 0.99),
        # a value of 0 has no factor
        ("tau_y", 0.0, 0.05),
        ("T_pwm", 0.0, 1.0),
        # 0.5 and 1 themselves are not admissible: a third of the way of 0.999 and of 1.4 is left
        ("r_lam", 0.5 + 0.499 / 3, 0.99999),
        ("gamma", 1.0 + 0.4 / 3, 2.0),
    ],
)
def test_a_number_without_bounds_stays_admissible_and_within_a_factor_of_three(name, low, high):
    assert bounds_of((name,), Actuator(), {})[name] == pytest.approx((low, high))


def test_the_start_value_is_what_a_factor_of_three_is_taken_of():
    assert bounds_of(("R_1ve",), Actuator().replace({"R_1ve": 0.6}), {})["R_1ve"] == pytest.approx((0.2, 2.0))


def test_bounds_by_default_are_admissible_themselves():
    names = Parameters.names()
    bounds = bounds_of(names, Actuator(), {})
    assert [name for name in names for end in bounds[name] if not Parameters.row(name).admits(end)] == []


@pytest.mark.parametrize(("edge", "low", "high"), [(1e-5, 1e-5, 3e-5), (1e5, 1e5 / 3, 1e5)])
def test_bounds_by_default_end_where_the_admissible_range_does(edge, low, high):
    assert bounds_of(("M",), Actuator().replace(M=edge), {})["M"] == pytest.approx((low, high))


def test_a_weight_of_the_load_has_a_sign_where_its_spline_has_one():
    names = ("theta_1", "theta_2", "theta_3")
    assert bounds_of(names, Actuator(), {}) == {
        "theta_1": (0.0, np.inf),
        "theta_2": (-np.inf, np.inf),
        "theta_3": (0.0, np.inf),
    }
    smooth = Actuator(load=Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5))))
    assert bounds_of(("theta_1",), smooth, {})["theta_1"] == (-np.inf, np.inf)
