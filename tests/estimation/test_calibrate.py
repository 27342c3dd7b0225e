"""A whole fit: what is free, what a calibration leaves, and what is refused before the search."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.calibrate import calibration_of, fit_with
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.uncertainty.calibration import drift
from clutchid.inference.uncertainty.change_prior import changeable
from clutchid.inference.uncertainty.coordinates import Prior

pytestmark = pytest.mark.slow

BOTH = ("position", "pressure_a")


@pytest.fixture(scope="module")
def short(drive_log):
    return drive_log.slice(0, 2500)


def test_a_calibration_finds_the_parameters_that_the_data_determine(calibrated, plant):
    assert calibrated.status == "ok"
    for name in ("C_ve", "V_0A", "tau_y", "R_0vs", "F_C", "T_w"):
        # six numbers of one recording: three standard deviations
        estimate = calibrated.parameters[name]
        assert abs(estimate.value - plant.value(name)) < 3.0 * estimate.std, name
    # what the sensor remembers at the start of a window is guessed, which costs a part of a lag of a sample and a half
    assert calibrated.parameters["tau_p"].value == pytest.approx(plant.value("tau_p"), rel=0.2)
    y = np.linspace(0.5e-3, 20e-3, 40)
    peak = plant.load.force(y).max()
    assert calibrated.actuator.load.force(y) == pytest.approx(plant.load.force(y), abs=0.005 * peak)


def test_a_calibration_leaves_the_covariance_of_its_numbers_without_the_load(calibrated):
    calibration = calibrated.calibration
    names = [name for name in calibrated.parameters if not name.startswith("theta_")]
    assert calibration.names == tuple(names)
    at = [list(calibrated.parameters).index(name) for name in names]
    assert np.array_equal(calibration.covariance, calibrated.covariance[np.ix_(at, at)])
    assert calibration.covariance_of(("C_vs", "nothing"))[0, 0] == pytest.approx(calibrated.parameters["C_vs"].std ** 2)
    assert calibration.covariance_of(("C_vs", "nothing"))[1, 1] == 0.0
    assert set(calibration.data) == {"log"}


def test_the_covariance_of_the_load_is_in_the_order_of_its_weights_whatever_was_asked_first(calibrated):
    backwards = dict(reversed(calibrated.parameters.items()))
    asked = replace(calibrated, parameters=backwards, covariance=calibrated.covariance[::-1, ::-1])
    calibration = calibration_of(asked, asked.actuator)
    assert calibration.theta == calibrated.actuator.load.theta
    np.testing.assert_array_equal(calibration.theta_covariance, calibrated.calibration.theta_covariance)
    assert calibration.converged


def test_a_worn_fit_carries_the_calibration_on_to_the_next(calibrated, worn_log):
    request = FitRequest(("position",), ("load",), calibration=calibrated.calibration)
    once = fit_with(SHOOTING, [worn_log], calibrated.actuator, request)
    assert once.calibration is calibrated.calibration
    again = fit_with(SHOOTING, [worn_log], once.actuator, replace(request, calibration=once.calibration))
    y = np.linspace(0.5e-3, 20e-3, 40)
    first, second = once.actuator.load.force(y), again.actuator.load.force(y)
    # its load is now what the curvature is compared with
    assert second == pytest.approx(first, abs=0.005 * first.max())


def test_a_worn_load_is_read_from_position_alone(adapted, worn):
    y = np.linspace(0.5e-3, 20e-3, 40)
    true = worn.load.force(y)
    miss = adapted.actuator.load.force(y) - true
    assert np.sqrt(np.mean(miss**2)) < 0.008 * true.max(), "the load was 8 % off"
    assert adapted.errors.pressure_a_rms is None
    changing = {f"{name}@worn" for name in changeable(adapted.actuator)}
    assert set(adapted.parameters) == {*worn.load.names, "y_max@worn", *changing}
    assert {"F_C@worn", "V_0A@worn"} <= changing, "seals and rest wear too"


def test_a_parameter_that_is_freed_again_starts_from_its_calibration(calibrated, worn_log):
    request = FitRequest(("position",), ("P_S",), calibration=calibrated.calibration)
    fit = fit_with(SHOOTING, [worn_log.slice(0, 1500)], calibrated.actuator, request)
    variance = calibrated.parameters["P_S"].std ** 2 + drift(calibrated.actuator, "P_S") ** 2
    own = replace(request, priors={"P_S": Prior(calibrated.actuator.value("P_S"), np.sqrt(variance))})
    by_prior = fit_with(SHOOTING, [worn_log.slice(0, 1500)], calibrated.actuator, own)
    fitted, expected = fit.parameters["P_S"], by_prior.parameters["P_S"]
    assert (fitted.value, fitted.std) == pytest.approx((expected.value, expected.std), rel=1e-6)


def test_an_anchor_of_the_user_wins_over_the_calibration(calibrated, worn_log):
    anchor = {"P_S": Prior(8.7e5, 10.0)}
    request = FitRequest(("position",), ("P_S",), priors=anchor, calibration=calibrated.calibration)
    fit = fit_with(SHOOTING, [worn_log.slice(0, 1500)], calibrated.actuator, request)
    assert fit.parameters["P_S"].value == pytest.approx(8.7e5, abs=100.0)


def test_auto_and_more_are_freed_together_and_each_once(plant, short):
    fit = fit_with(SHOOTING, [short], plant, FitRequest(BOTH, ("auto", "e_y", "C_vs")))
    assert "e_y" in fit.parameters
    assert list(fit.parameters).count("C_vs") == 1


def test_an_own_number_of_every_recording_takes_the_place_of_the_shared_one(plant, short):
    logs = [short, replace(short, name="again")]
    fit = fit_with(SHOOTING, logs, plant, FitRequest(BOTH, ("C_vs", "P_S", "P_S@EACH")))
    assert list(fit.parameters) == ["C_vs", "P_S@log", "P_S@again"]
    assert fit.calibration is None, "the load was not free"


def test_own_numbers_are_not_left_to_other_recordings(plant, short):
    fit = fit_with(SHOOTING, [short], plant, FitRequest(BOTH, ("load", "C_vs", "P_S@EACH")))
    assert fit.calibration.names == ("C_vs",)


@pytest.mark.parametrize(
    ("samples", "free", "options", "error", "sentence"),
    [
        (2500, ("auto",), {}, DataError, "'auto' needs a recording with pressure, and --measure position,pressure_a"),
        (
            2500,
            ("load",),
            {"priors": {"P_S": Prior(9e5, 1e3)}},
            ParameterError,
            "prior for P_S, .*; free are theta_1, theta_2",
        ),
        (100, ("load",), {}, DataError, "log: 100 measured samples for 22 free parameters; at least ten for each"),
        (2500, (), {}, ParameterError, "no parameter is free"),
    ],
)
def test_what_cannot_be_fitted_is_refused_before_the_search(plant, short, samples, free, options, error, sentence):
    with pytest.raises(error, match=f"^{sentence}"):
        fit_with(SHOOTING, [short.slice(0, samples)], plant, FitRequest(("position",), free, **options))
