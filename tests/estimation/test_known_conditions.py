"""Loads from position alone where the vehicle measures temperature and supply pressure."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.hypotheses import explained, log_root, mixture
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.problem import prior_rows, with_hypothesis
from clutchid.inference.uncertainty.change_prior import HYPOTHESES
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.inference.uncertainty.gaussian import gaussian_posterior

Y = np.linspace(0.5e-3, 20e-3, 40)
CALIBRATED = RecordedConditions(293.0, 9.5e5)
COLD = ("temperature and grease",)


@pytest.fixture(scope="module")
def measured(worn_log, calibrated):
    """The worn recording with a temperature and a supply pressure."""

    def at(temperature, supply):
        ones = np.ones(len(worn_log))
        return worn_log.with_columns(temperature_ambient=temperature * ones, pressure_supply=supply * ones)

    return at


@pytest.fixture(scope="module")
def calibration(calibrated):
    return replace(calibrated.calibration, conditions=CALIBRATED)


@pytest.fixture(scope="module")
def problem_of_log(calibrated, calibration):
    def of(log, **options):
        free = FreeParameters(calibrated.actuator.load.names, ("position",), **options)
        return fit_problem([log], calibrated.actuator, free, calibration)

    return of


def test_measured_conditions_condition_the_prior_as_the_textbook_says(problem_of_log, worn_log, measured):
    plain, conditioned = problem_of_log(worn_log), problem_of_log(measured(273.0, 9.3e5))
    k = len(plain.coordinates)
    at = [plain.names.index(name) for name in conditioned.measured]
    assert {plain.names[i] for i in at} == {"T_0@worn", "P_S@worn"}
    x = np.zeros(k)
    for hypothesis in HYPOTHESES:
        hypothetical = with_hypothesis(conditioned, hypothesis)
        before, rows = prior_rows(with_hypothesis(plain, hypothesis), x), prior_rows(hypothetical, x)
        assert rows.shape[0] == before.shape[0] + 2
        normal = gaussian_posterior(np.zeros((0, k + 1)), rows, log_root(hypothetical))
        alone = gaussian_posterior(np.zeros((0, k + 1)), before, log_root(hypothetical))
        C, H = alone.covariance, np.eye(k)[at]
        value = np.array(
            [plain.coordinates[i].of(prior.mean) for i, prior in zip(at, conditioned.measured.values(), strict=True)]
        )
        std = [
            prior.std / plain.coordinates[i].slope(v)
            for i, v, prior in zip(at, value, conditioned.measured.values(), strict=True)
        ]
        S = H @ C @ H.T + np.diag(np.square(std))
        gain = C @ H.T @ np.linalg.inv(S)
        np.testing.assert_allclose(normal.step, alone.step + gain @ (value - alone.step[at]), atol=1e-7)
        np.testing.assert_allclose(normal.covariance, C - gain @ H @ C, atol=1e-7)
        off = value - alone.step[at]
        evidence = -0.5 * off @ np.linalg.solve(S, off) - 0.5 * np.linalg.slogdet(S)[1] + np.sum(np.log(std))
        assert normal.log_evidence - alone.log_evidence == pytest.approx(evidence, abs=1e-6)


def test_grease_follows_the_temperature_where_both_may_have_changed(problem_of_log, measured):
    hypothetical = with_hypothesis(problem_of_log(measured(268.0, 9.5e5)), COLD)
    k = len(hypothetical.coordinates)
    normal = gaussian_posterior(np.zeros((0, k + 1)), prior_rows(hypothetical, np.zeros(k)), log_root(hypothetical))
    value = dict(zip(hypothetical.names, hypothetical.si(normal.step).tolist(), strict=True))
    assert value["T_0@worn"] == pytest.approx(hypothetical.actuator.value("T_0") - 25.0, abs=1.0)
    assert value["D_v@worn"] / hypothetical.actuator.value("D_v") == pytest.approx(np.exp(0.5), rel=0.03)


@pytest.mark.slow
def test_a_known_change_of_nothing_costs_an_unchanged_truck_at_most_a_thousandth_of_the_peak(
    worn_log, measured, calibrated, calibration, worn
):
    free = FreeParameters(calibrated.actuator.load.names, ("position",))
    loads, probabilities = [], []
    for log in (worn_log, measured(293.0, 9.5e5)):
        explanations = explained(shoot([log], calibrated.actuator, free, calibration), SHOOTING.changes, calibration)
        mixed = mixture(explanations, calibration)
        loads.append(explanations[()].result.problem.actuator_of(mixed.x, "worn").load.force(Y))
        probabilities.append(mixed)
    assert np.sqrt(np.mean((loads[1] - loads[0]) ** 2)) < 1e-3 * worn.load.force(Y).max()
    assert probabilities[1].of_group("supply pressure") < probabilities[0].of_group("supply pressure")


@pytest.mark.slow
def test_a_temperature_that_fell_by_30_k_is_a_change_of_temperature(measured, calibrated, calibration):
    request = FitRequest(("position",), ("load",), calibration=calibration)
    fit = fit_with(SHOOTING, [measured(263.0, 9.5e5)], calibrated.actuator, request)
    changed = {change.name: change for change in fit.changes if change.group == COLD[0]}
    assert changed["T_0"].probability > 0.9
    assert changed["T_0"].after == pytest.approx(calibrated.actuator.value("T_0") - 30.0, abs=3 * 2.0 * np.sqrt(2.0))


def test_a_value_of_the_user_is_the_same_measurement_as_a_column(problem_of_log, worn_log):
    measured = problem_of_log(worn_log, conditions={"T_0": Prior(273.0, 2.0)}).measured
    assert [*measured] == ["T_0@worn"]
    assert measured["T_0@worn"].std == pytest.approx(2.0 * np.sqrt(2.0))


def test_a_user_may_give_a_condition_without_freeing_it_only_where_a_load_is_read(worn_log, calibrated, calibration):
    priors = {"T_0": Prior(293.0, 2.0)}
    fit = fit_with(
        SHOOTING,
        [worn_log],
        calibrated.actuator,
        FitRequest(("position",), ("load",), priors=priors, calibration=calibration),
    )
    assert "T_0" not in fit.parameters
    assert fit.parameters["T_0@worn"].value == pytest.approx(calibrated.actuator.value("T_0"), abs=2.0)
    for request in (
        FitRequest(("position",), ("load",), priors=priors),
        FitRequest(("position",), ("load",), priors={"V_S": Prior(1e-2, 1e-3)}, calibration=calibration),
    ):
        with pytest.raises(ParameterError, match="which is not free"):
            fit_with(SHOOTING, [worn_log], calibrated.actuator, request)


@pytest.mark.slow
def test_a_calibration_without_conditions_reads_and_says_what_it_lacks(measured, worn_log, calibrated):
    request = FitRequest(("position",), ("load",), calibration=calibrated.calibration)
    plain, fit = (fit_with(SHOOTING, [log], calibrated.actuator, request) for log in (worn_log, measured(263.0, 9e5)))
    assert fit.actuator.load.theta == plain.actuator.load.theta
    assert len(fit.warnings) == len(plain.warnings) + 2
    assert "temperature_ambient is not used, because the calibration does not have it" in " ".join(fit.warnings)


def test_a_bad_column_is_refused_before_any_search(measured, calibrated, calibration):
    request = FitRequest(("position",), ("load",), calibration=calibration)
    with pytest.raises(DataError, match="worn: temperature_ambient is -253"):
        fit_with(SHOOTING, [measured(20.0, 9e5)], calibrated.actuator, request)
