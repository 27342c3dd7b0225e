"""`Load` and `Actuator`: valid from birth, and the table that the kernels read."""

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.model import PAPER_KNOTS, Actuator, Load
from clutchid.model.compiled import kernels
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters


@pytest.mark.parametrize(
    "knots",
    [
        (0, 1, 2), (0, 2, 2, 3), (0, 3, 2, 4), (3, 2, 1, 0), (0, 1, 2, 3, 4), (0, 1, 2, float("nan")),
        (0, 1, 2, float("inf")), (float("-inf"), 1, 2, 3), (0, 1, 2, 3j),
    ],
)  # fmt: skip
def test_knots_must_be_four_and_strictly_increasing(knots):
    with pytest.raises(ParameterError, match="four strictly increasing positions"):
        Load(knots=tuple(1e-3 * k for k in knots))


@pytest.mark.parametrize(
    "theta",
    [
        (1.0, 2.0), (1.0, 2.0, float("nan")), (1.0, float("inf"), 0.0), (1.0, 2.0, 3.0, 4.0), (1.0, 2.0, 3j),
        (1.0, 2.0, "3"), (1.0, 2.0, None), np.ma.masked_array([1.0, 2.0, 3.0], mask=[0, 0, 1]), 1j * np.ones(3),
        np.ones((3, 1)),
    ],
)  # fmt: skip
def test_weights_must_be_three_finite_numbers(theta):
    with pytest.raises(ParameterError, match="three finite weights"):
        Load(theta)


def test_a_slope_that_is_no_number_is_refused():
    with pytest.raises(ParameterError, match=r"0\.001 \(as published\)"):
        Load(phi2_slope=float("nan"))


def test_all_problems_of_a_load_are_named_at_once():
    with pytest.raises(ParameterError) as caught:
        Load((1.0,), knots=(0.0,), phi2_slope=float("inf"))
    assert len(str(caught.value).splitlines()) == 3


def test_a_load_keeps_its_basis_with_its_weights():
    load = Load((1, 2, 3))
    assert load.theta == (1.0, 2.0, 3.0)
    assert load.knots == PAPER_KNOTS
    assert load.basis == "paper"
    assert load.names == ("theta_1", "theta_2", "theta_3")
    assert Load() == Load((9e5, 0.0, 0.0), PAPER_KNOTS, 1.0)
    assert hash(Load()) == hash(Load())


def test_the_force_is_the_weighted_sum_of_the_basis():
    y = np.linspace(-1e-3, 26e-3, 109)
    load = Load((9e5, -5e4, 4e4))
    np.testing.assert_allclose(load.force(y), load.phi(y) @ [9e5, -5e4, 4e4], rtol=0, atol=1e-9)


def test_the_combined_table_is_the_load_itself():
    load = Load((9e5, -5e4, 4e4))
    y = np.array([-1e-3, 1e-3, 5e-3, 10e-3, 15e-3, 30e-3])
    segment = np.searchsorted(load.breakpoints, y, side="right")
    offset = y - load.breakpoints[np.maximum(segment - 1, 0)]
    c = load.combined()[segment]
    computed = sum(c[:, power] * offset**power for power in range(4))
    np.testing.assert_allclose(computed, load.force(y), rtol=0, atol=1e-9)
    np.testing.assert_allclose(load.combined(np.array([1.0, 0, 0])), load.coefficients[0])


def test_the_table_cannot_be_changed_by_accident():
    with pytest.raises(ValueError, match="read-only"):
        Load().breakpoints[0] = 1.0


def test_the_table_has_a_segment_before_between_and_beyond_the_knots():
    load = Load()
    assert load.breakpoints.shape == (5,)
    assert load.coefficients.shape == (3, 6, 4)
    assert not load.coefficients[:, 0].any()  # no load before the first knot


def test_an_actuator_knows_its_numbers_and_units_by_name():
    actuator = Actuator(load=Load((1.0, 2.0, 3.0)))
    assert actuator.names == (*Parameters.names(), "theta_1", "theta_2", "theta_3")
    assert [actuator.value(name) for name in ("theta_2", "M", "P_S")] == [2.0, 10.0, 9e5]
    assert [actuator.unit(name) for name in ("theta_2", "M", "P_S")] == ["N/m", "kg", "Pa"]
    assert [actuator.unit_behind(name) for name in ("M", "R_0vs")] == [" kg", ""]


def test_an_actuator_is_replaced_in_parameters_and_weights_at_once_and_checked():
    changed = Actuator().replace({"M": 12.0, "theta_3": 5e4})
    assert (changed.parameters.M, changed.load.theta) == (12.0, (9e5, 0.0, 5e4))
    with pytest.raises(ParameterError, match="at least 1e-05"):
        Actuator().replace({"M": -1.0})
    with pytest.raises(ParameterError, match="finite"):
        Actuator().replace({"theta_1": float("nan")})


def test_unknown_names_are_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'theta_1'"):
        Actuator().value("theta1")
    with pytest.raises(ParameterError, match="did you mean 'C_ve'"):
        Actuator().replace({"C_vee": 1e-8})
    with pytest.raises(ParameterError, match="did you mean 'isothermal'"):
        Actuator(model="isotherm")
    with pytest.raises(ParameterError, match="isothermal"):
        kernels("isotherm")


def test_the_variant_of_the_paper_comes_first_and_is_the_default():
    assert list(VARIANTS) == [
        "isothermal", "isothermal-stribeck", "energy-balance", "energy-balance-stribeck",
        "energy-balance-stribeck-proportional",
    ]  # fmt: skip
    assert Actuator().model == "isothermal"
