"""Coordinates of the free numbers: values and back, slopes, bounds, priors, and the smoothness of a load."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.coordinates import STOP_STD, Prior, coordinates, far_stop, smoothness
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters

ACTUATOR = Actuator(Parameters(), Load.on_b_splines(), "energy-balance-stribeck")
KNOWN = tuple(name for name, row in Parameters.rows().items() if row.spread)


def coordinate(name, prior=None, bounds=None, actuator=ACTUATOR):
    priors, limits = {name: prior} if prior else {}, {name: bounds} if bounds else {}
    return coordinates(actuator, [name], limits, priors)[0]


@given(st.sampled_from([*KNOWN, "theta_3"]), st.floats(-3, 3))
def test_a_value_leads_back_to_its_coordinate(name, x):
    c = coordinate(name)
    value = c.si(x)
    assert c.low <= value <= c.high
    if c.low < value < c.high:
        # of subtracts the mean, which may be many widths large
        assert abs(c.of(value) - x) <= 1e-13 * (1 + abs(c.mean / c.width))


@given(st.sampled_from([*KNOWN, "theta_3"]), st.floats(-2, 2))
def test_the_slope_is_the_derivative_of_the_value(name, x):
    c, h = coordinate(name), 1e-4
    if c.low < c.si(x - h) and c.si(x + h) < c.high:
        central = (c.si(x + h) - c.si(x - h)) / (2 * h)
        # third derivative width**3 over six, and rounding of the mean over the step
        assert abs(central - c.slope(x)) <= 1e-8 * c.slope(x) + 1e-11 * abs(c.mean)


def test_one_unit_is_one_standard_deviation_of_what_is_known():
    assert coordinate("C_vs").slope(0.0) == pytest.approx(0.15 * 19e-9)
    assert coordinate("P_S").slope(0.0) == pytest.approx(0.05 * 9e5)
    assert coordinate("R_0vs").slope(0.0) == pytest.approx(0.03)
    assert coordinate("tau_y").slope(0.0) == pytest.approx(2e-3)
    assert coordinate("P_S", Prior(8.8e5, 4e3)).slope(0.0) == pytest.approx(4e3)
    assert coordinate("e_p", Prior(500.0, 50.0)).slope(0.0) == pytest.approx(50.0)


def test_a_given_prior_moves_the_middle():
    c = coordinate("P_S", Prior(8.8e5, 4e3))
    assert c.si(0.0) == 8.8e5
    assert c.of(9e5) == pytest.approx(np.log(9e5 / 8.8e5) / (4e3 / 8.8e5))


def test_a_positive_number_stays_positive_however_far_it_is_moved():
    c = coordinate("C_vs")
    assert 0 < c.si(-1e6) < c.si(-3.0) < c.si(3.0) < c.si(1e6) < np.inf


def test_bounds_are_those_of_the_parameter_and_of_the_user():
    c = coordinate("R_1vs")
    assert (c.low, c.high) == (0.0, 2.0)
    c = coordinate("R_1vs", bounds=(0.8, 5.0))
    assert (c.low, c.high) == (0.8, 2.0)
    assert c.si(-1e3) == 0.8
    assert c.si(1e3) == 2.0
    assert (coordinate("theta_2").low, coordinate("theta_2").high) == (-np.inf, np.inf)


def test_a_weight_of_either_basis_has_a_width_in_its_own_unit():
    paper = Actuator(load=Load((9e5, 0.0, 0.0)))
    assert coordinate("theta_1", actuator=paper).slope(0.0) == 5e5
    assert coordinate("theta_1").slope(0.0) == 2e3
    assert coordinate("theta_1", actuator=paper).si(-4.0) == pytest.approx(9e5 - 4 * 5e5), "a weight may be negative"


def test_a_number_of_one_recording_keeps_the_name_that_the_user_gave():
    shared, own = coordinates(ACTUATOR, ["P_S", "P_S@morning"], {}, {})
    assert (shared.base, shared.stem, shared.name) == ("P_S", None, "P_S")
    assert (own.base, own.stem, own.name) == ("P_S", "morning", "P_S@morning")


def test_every_parameter_but_the_period_of_the_carrier_has_a_spread():
    assert set(Parameters.names()) - set(KNOWN) == {"T_pwm"}


def test_an_unknown_spread_is_one_sentence_that_says_what_to_give():
    with pytest.raises(ParameterError) as caught:
        coordinate("T_pwm")
    assert str(caught.value) == "T_pwm: there is no default prior; give --prior T_pwm=VALUE±STD."
    with pytest.raises(ParameterError, match=r"^C_vs: there is no default prior"):
        coordinate("C_vs", actuator=ACTUATOR.replace({"C_vs": 0.0}))
    assert coordinate("T_pwm", Prior(0.01, 1e-4)).slope(0.0) == 1e-4


def test_a_prior_outside_its_bounds_is_one_sentence_with_both():
    with pytest.raises(
        ParameterError, match=r"^P_S: the prior mean 900000 lies outside its bounds 800000 to 850000\.$"
    ):
        coordinate("P_S", bounds=(8e5, 8.5e5))


def test_smoothness_rows_are_the_curvature_of_the_curve():
    names, curvature = ("C_vs", *ACTUATOR.load.names), 3e8
    rows = smoothness(ACTUATOR, names, (0.0,) * 22, curvature)
    knots, h = np.asarray(ACTUATOR.load.knots), 1e-6
    # second derivatives are continuous and piecewise linear: a central difference at an inner knot is off by h times
    # the change of the third derivative, which is below 1e-2 of the curvature of a basis function over 0.5 mm
    inner = slice(1, -1)
    second = (ACTUATOR.load.phi(knots + h) - 2 * ACTUATOR.load.phi(knots) + ACTUATOR.load.phi(knots - h)) / h**2
    weight = np.sqrt(np.gradient(knots) / 1e-3) / curvature
    assert rows.shape == (20, 24)
    assert np.all(rows[:, 0] == 0.0), "a conductance has no curvature"
    largest = np.abs(rows).max()
    assert rows[inner, 1:-1] == pytest.approx((second * weight[:, None])[inner], abs=1e-2 * largest)
    force = second @ np.asarray(ACTUATOR.load.theta)
    assert rows[inner, -1] == pytest.approx((force * weight)[inner], abs=1e-2 * np.abs(rows[:, -1]).max())


def test_a_load_like_its_reference_and_a_straight_load_have_no_curvature_to_pay():
    reference = ACTUATOR.load.theta
    assert np.all(smoothness(ACTUATOR, ACTUATOR.load.names, reference, 3e8)[:, -1] == 0.0)
    y = np.linspace(0, 0.025, 200)
    straight = np.linalg.lstsq(ACTUATOR.load.phi(y), 100 + 2e5 * y, rcond=None)[0]
    moved = ACTUATOR.replace(dict(zip(ACTUATOR.load.names, (np.asarray(reference) + straight).tolist(), strict=True)))
    residual = smoothness(moved, ACTUATOR.load.names, reference, 3e8)[:, -1]
    assert residual == pytest.approx(0.0, abs=1e-8)


def test_the_smoothness_residual_has_the_derivatives_that_its_rows_say():
    names = ACTUATOR.load.names
    rows = smoothness(ACTUATOR, names, (0.0,) * 22, 3e8)
    moved = ACTUATOR.replace({"theta_7": ACTUATOR.value("theta_7") + 100.0})
    change = smoothness(moved, names, (0.0,) * 22, 3e8)[:, -1] - rows[:, -1]
    assert change == pytest.approx(100.0 * rows[:, names.index("theta_7")], abs=1e-9)


def test_the_stroke_is_that_of_the_drawing_or_as_far_as_a_recording_reaches():
    t = np.arange(0, 1, 1e-3)
    short, far = (Log(t, {"position": top * np.sin(np.pi * t)}, "log").reach() for top in (0.02, 0.0262))
    assert far_stop(Actuator(), short) == Prior(0.025, STOP_STD)
    assert far_stop(Actuator(), far).mean == pytest.approx(0.0262, abs=1e-5)
    assert Log(t, {"position": np.full(t.size, np.nan)}, "log").reach() == 0.0


@pytest.mark.parametrize(
    ("mean", "std"), [(8e5, -1.0), (8e5, 0), (8e5, np.nan), (8e5, np.inf), (np.nan, 1.0), (-np.inf, 1.0)]
)
def test_a_prior_without_a_finite_mean_and_a_positive_deviation_is_refused(mean, std):
    with pytest.raises(ParameterError, match=r"Prior\(.*\): a finite mean and a standard deviation above 0 are needed"):
        Prior(mean, std)
