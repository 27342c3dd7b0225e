"""A whole fit: what is free, what a calibration leaves, and what is refused before the search."""

import re
from dataclasses import replace

import numpy as np
import pytest

from clutchid import parameter_file, read_parameters, write_parameters
from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.comparison import comparison
from clutchid.estimation.calibrate import calibration_of, fit_with, missed_load
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.uncertainty.calibration import MODEL_MISSES, drift
from clutchid.inference.uncertainty.change_prior import changeable
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.numerics.interval import QUANTILE
from clutchid.verbs.start import saved_load

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


@pytest.fixture(scope="module")
def missing(plant, short):
    """A calibration of a pressure that the model cannot follow: 2 kPa at 20 Hz."""
    swing = 2e3 * np.sqrt(2.0) * np.sin(2 * np.pi * 20.0 * short.time)
    log = short.with_columns(pressure_a=short["pressure_a"] + swing)
    return fit_with(SHOOTING, [log], plant, FitRequest(BOTH, ("load", "C_vs")))


def half_by_data(calibrated):
    """Half width of the band that the covariance of the weights makes."""
    load, curve = calibrated.actuator.load, calibrated.load_curve
    phi = load.phi(curve.position)
    return QUANTILE * np.sqrt(np.einsum("ni,ij,nj->n", phi, calibrated.calibration.theta_covariance, phi))


def test_the_band_of_a_calibration_has_what_the_model_misses_once_and_says_so(missing):
    curve, missed = missing.load_curve, missing.calibration.missed
    by_pressure, by_peak = (
        MODEL_MISSES.pressure * missing.actuator.parameters.A_A * 2e3,
        MODEL_MISSES.peak * curve.force.max(),
    )
    assert missed == pytest.approx(np.hypot(by_pressure, by_peak), rel=0.1)
    half = np.hypot(half_by_data(missing), QUANTILE * missed)
    assert curve.high - curve.force == pytest.approx(half, rel=1e-9)
    assert curve.force - curve.low == pytest.approx(half, rel=1e-9)
    assert [f"includes {QUANTILE * missed:.0f} N (" in note for note in missing.notes].count(True) == 1
    weights = [missing.parameters[name] for name in missing.actuator.load.names]
    variance = np.diag(missing.calibration.theta_covariance)
    assert [weight.std for weight in weights] == pytest.approx(np.sqrt(variance)), "weights have the data's own"


def test_what_the_model_misses_is_as_large_as_the_error_of_the_pressure_that_lasts(calibrated):
    (recording,) = calibrated.recordings.values()
    rng, area = np.random.default_rng(0), calibrated.actuator.parameters.A_A
    sizes = []
    for slow in (0.0, 2e3, 4e3):  # Pa, over 20 ms and more
        lasting = slow * np.sqrt(2.0) * np.sin(2 * np.pi * 5.0 * recording.measured.time)
        error = lasting + 500.0 * rng.standard_normal(lasting.size)
        log = recording.measured.with_columns(pressure_a=recording.simulated["pressure_a"] + error)
        sensed = replace(calibrated.actuator.replace({"tau_p": 0.0, "e_p": 0.0}))
        fit = replace(calibrated, actuator=sensed, recordings={"log": replace(recording, measured=log)})
        by_pressure = np.sqrt(missed_load(fit) ** 2 - (MODEL_MISSES.peak * fit.load_curve.force.max()) ** 2)
        sizes.append(by_pressure / (MODEL_MISSES.pressure * area))
    # the correlation of 6000 samples is known to 0.013, of the white 500 Pa therefore 57 Pa may look like it
    assert sizes[0] < 3**0.5 * 57.0
    assert sizes[1:] == pytest.approx([2e3, 4e3], rel=0.02)


def test_a_reading_is_the_same_whatever_the_model_misses_of_its_calibration(calibrated, adapted, worn_log):
    more = replace(calibrated.calibration, missed=100.0)
    request = FitRequest(("position",), ("load",), calibration=more)
    fit = fit_with(SHOOTING, [worn_log], calibrated.actuator, request)
    assert np.array_equal(fit.load_curve.table(), adapted.load_curve.table())
    assert fit.parameters == adapted.parameters
    assert fit.verdict == adapted.verdict
    now, before = comparison(fit), comparison(adapted)
    for name in ("difference", "shift", "half_now"):
        np.testing.assert_array_equal(getattr(now, name), getattr(before, name))
    wide, usual = ((of.calibrated.high - of.calibrated.low) / 2 for of in (now, before))
    more = QUANTILE**2 * (100.0**2 - calibrated.calibration.missed**2)
    assert wide == pytest.approx(np.sqrt(usual**2 + more), rel=1e-9), "the band of the calibrated load has it"
    assert now.half_before.high - now.half_before.low > before.half_before.high - before.half_before.low


def test_on_the_model_s_own_data_the_pressure_misses_nothing(calibrated):
    assert calibrated.calibration.missed == pytest.approx(
        MODEL_MISSES.peak * calibrated.load_curve.force.max(), rel=1e-9
    )


def test_a_calibration_in_a_file_has_the_band_that_it_was_printed_with(missing, tmp_path):
    path = tmp_path / "cal.toml"
    write_parameters(parameter_file(missing), path)
    curve = saved_load(path).load
    assert curve.table() == pytest.approx(missing.load_curve.table(), rel=1e-9)
    assert read_parameters(path).calibration.missed == missing.calibration.missed
    older = re.sub(r"(?m)^missed = .*\n|^\[fit.load\](?s:.*?)(?=^\[)", "", path.read_text(encoding="utf-8"))
    path.write_text(older, encoding="utf-8")
    curve = saved_load(path).load
    assert (curve.high - curve.low) / 2 == pytest.approx(half_by_data(missing), rel=1e-9), "it has the data's own"


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
