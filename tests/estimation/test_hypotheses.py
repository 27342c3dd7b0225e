"""Loads from position alone of recordings of the model: what has changed is found, and what has not costs nothing."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from clutchid.documents.changes import change_sentences
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.hypotheses import explained, mixture, softmax
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.problem import with_hypothesis
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, change_covariance, changeable
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.numerics.failure import Failure

Y = np.linspace(0.5e-3, 20e-3, 40)


def shares(actuator, **by):
    return actuator.replace({name: share * actuator.value(name) for name, share in by.items()})


@pytest.fixture(scope="module")
def trucks(worn):
    """The worn plant, and what has changed in it besides."""
    kelvin = 30.0 / worn.value("T_0")
    flow = 1.0 / np.sqrt(1.0 - kelvin)
    return {
        "same": worn,
        "supply": shares(worn, P_S=0.95),
        "cold": shares(worn, D_v=2.0, T_0=1.0 - kelvin, T_w=1.0 - kelvin, C_vs=flow, C_ve=flow),
        "valves": shares(worn, C_vs=0.93, C_ve=0.93),
    }


@pytest.fixture(scope="module")
def logs(trucks, recorded_by):
    return {
        name: recorded_by(truck, seconds=5.0, seed=6, name=name, driven=1).without("pressure_a")
        for name, truck in trucks.items()
    }


@pytest.fixture(scope="module")
def known_of(calibrated, logs):
    """Explanations of recordings, each searched once."""
    calibration, actuator, cache = calibrated.calibration, calibrated.actuator, {}

    def of(name):
        if name not in cache:
            free = FreeParameters(actuator.load.names, ("position",))
            cache[name] = explained(shoot([logs[name]], actuator, free, calibration), SHOOTING.changes, calibration)
        return cache[name]

    return of


@pytest.fixture(scope="module")
def reread(calibrated, logs):
    """Read recordings by name, each once."""

    @cache
    def of(*names, free=("load",), priors=()):
        request = FitRequest(("position",), free, priors=dict(priors), calibration=calibrated.calibration)
        return fit_with(SHOOTING, [logs[name] for name in names], calibrated.actuator, request)

    return of


def load_of(explanations, x, stem):
    return next(iter(explanations.values())).result.problem.actuator_of(x, stem).load.force(Y)


def unchanged(explanations):
    """Parameters of a reading that assumes that nothing has changed."""
    return explanations[()].solution.x


def rms(error):
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.slow
def test_where_nothing_has_changed_that_is_most_probable_and_costs_at_most_two_thousandths_of_the_peak(
    known_of, calibrated, trucks
):
    explanations, calibration = known_of("same"), calibrated.calibration
    everything, nothing = mixture(explanations, calibration), unchanged(explanations)
    assert everything.hypotheses[np.argmax(everything.probabilities)] == ()
    peak = trucks["same"].load.force(Y).max()
    cost = load_of(explanations, everything.x, "same") - load_of(explanations, nothing, "same")
    assert rms(cost) < 2e-3 * peak


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "group", "least"),
    [
        ("supply", "supply pressure", 0.5),
        ("cold", "temperature and grease", 0.9),
        ("valves", "valves", 0.8),
    ],
)
def test_what_has_changed_is_probable_and_the_load_is_nearer_to_the_truth(
    known_of, calibrated, trucks, name, group, least
):
    explanations, calibration = known_of(name), calibrated.calibration
    everything, nothing = mixture(explanations, calibration), unchanged(explanations)
    assert everything.of_group(group) > least
    assert everything.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    true = trucks[name].load.force(Y)
    error, without = (rms(load_of(explanations, x, name) - true) for x in (everything.x, nothing))
    assert without > 0.01 * true.max(), "what it costs where nothing is said to have changed"
    assert error < 0.7 * without


@pytest.mark.slow
def test_the_changes_of_a_fit_are_those_of_its_hypotheses(reread, known_of, calibrated, logs, trucks):
    fit = reread("cold")
    expected = mixture(known_of("cold"), calibrated.calibration)
    assert {change.recording for change in fit.changes} == {"cold"}
    for change in fit.changes:
        assert change.probability == pytest.approx(expected.of_group(change.group), abs=1e-9)
        estimate = fit.parameters[f"{change.name}@cold"]
        assert (change.after, change.std) == pytest.approx((estimate.value, estimate.std), rel=1e-9)
        assert change.before == calibrated.actuator.value(change.name)
    grease = {change.name: change.after for change in fit.changes if change.group == "temperature and grease"}
    assert grease["D_v"] == pytest.approx(trucks["cold"].value("D_v"), rel=0.05)
    assert grease["T_0"] == pytest.approx(trucks["cold"].value("T_0"), abs=10.0)
    assert change_sentences(fit)[-1].startswith("cold: temperature and grease changed since the calibration")


@pytest.mark.slow
def test_the_load_of_a_changed_truck_lies_in_its_band(reread, logs, trucks):
    for name in ("supply", "cold", "valves"):
        curve = reread(name).load_curve
        true = trucks[name].load.force(Y)
        low, high = (np.interp(Y, curve.position, side) for side in (curve.low, curve.high))
        assert np.mean((low < true) & (true < high)) >= 0.9, name


@pytest.mark.slow
def test_a_parameter_that_the_user_sets_free_is_his(reread, calibrated, logs):
    supply = calibrated.actuator.value("P_S")
    wide = (("P_S", Prior(supply, 0.05 * supply)),)
    fit = reread("supply", free=("load", "P_S"), priors=wide)
    assert {name for name in fit.parameters if name.startswith("P_S")} == {"P_S"}
    assert {name for name in fit.parameters if name.startswith("D_v")} == {"D_v@supply"}
    assert not any(change.name == "P_S" for change in fit.changes)
    # the calibration has 1.5 % too low a supply, and flows to match
    assert fit.parameters["P_S"].value == pytest.approx(0.95 * supply, rel=0.02)


@pytest.mark.slow
def test_of_two_recordings_each_has_parameters_of_its_own(reread, logs, calibrated):
    fit = reread("same", "cold")
    changing = {f"{name}@{stem}" for name in changeable(calibrated.actuator) for stem in ("same", "cold")}
    assert set(fit.parameters) == {*calibrated.actuator.load.names, "y_max@same", "y_max@cold", *changing}
    grease = calibrated.actuator.value("D_v")
    assert fit.parameters["D_v@cold"].value == pytest.approx(2.0 * grease, rel=0.05)
    assert fit.parameters["D_v@same"].value == pytest.approx(grease, rel=0.05)


@pytest.mark.slow
def test_a_calibration_of_an_earlier_version_weighs_hypotheses_as_well(reread, calibrated, logs, trucks):
    request = FitRequest(("position",), ("load",), calibration=replace(calibrated.calibration, position_only=None))
    fit = fit_with(SHOOTING, [logs["cold"]], calibrated.actuator, request)
    true = trucks["cold"].load.force(Y)
    assert rms(fit.actuator.load.force(Y) - true) < 0.015 * true.max()
    assert {change.group for change in fit.changes} >= {"temperature and grease"}


def test_a_method_without_hypotheses_reads_as_if_nothing_had_changed(calibrated, logs):
    plain = replace(SHOOTING, changes=None)
    request = FitRequest(("position",), ("load",), calibration=calibrated.calibration)
    fit = fit_with(plain, [logs["supply"]], calibrated.actuator, request)
    assert fit.changes == ()


@pytest.mark.slow
def test_a_hypothesis_whose_search_fails_is_left_out(calibrated, logs):
    calibration, free = calibrated.calibration, FreeParameters(calibrated.actuator.load.names, ("position",))
    search, tried = shoot([logs["cold"]], calibrated.actuator, free, calibration), []

    def refine(result, problem, x, progress):
        tried.append(problem)
        return replace(result, solution=Failure("no"))

    explanations = explained(search, replace(SHOOTING.changes, refine=refine), calibration)
    assert list(explanations) == [()]
    assert 1 <= len(tried) <= len(HYPOTHESES) - 1, "none is tried twice"


def test_the_prior_of_a_problem_is_that_of_its_hypothesis(calibrated, logs):
    actuator = calibrated.actuator
    free = FreeParameters(actuator.load.names, ("position",))
    problem = fit_problem([logs["same"], logs["cold"]], actuator, free, calibrated.calibration)
    names = changeable(actuator)
    at = {stem: [problem.names.index(f"{name}@{stem}") for name in names] for stem in problem.stems}
    rest = sorted({*range(len(problem.names))} - {i for places in at.values() for i in places})
    for hypothesis in HYPOTHESES:
        root = with_hypothesis(problem, hypothesis).prior_root
        covariance = np.linalg.inv(root.T @ root)
        for places in at.values():
            slopes = problem.slopes(np.zeros(len(problem.names)))[places]
            expected = change_covariance(actuator, names, hypothesis)
            scale = np.sqrt(np.diag(expected))
            change = covariance[np.ix_(places, places)] * np.outer(slopes, slopes)
            np.testing.assert_allclose(change / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-9)
        np.testing.assert_allclose(covariance[np.ix_(rest, rest)], np.eye(len(rest)), atol=1e-12)
        assert not covariance[np.ix_(at["same"], at["cold"])].any(), "recordings change by themselves"
    np.testing.assert_array_equal(problem.prior_root, with_hypothesis(problem, ()).prior_root)


def test_a_problem_with_pressure_has_no_prior_of_changes(calibrated, drive_log):
    free = FreeParameters(calibrated.actuator.load.names, ("position", "pressure_a"))
    problem = fit_problem([drive_log], calibrated.actuator, free, calibrated.calibration)
    assert problem.changing == ()
    assert with_hypothesis(problem, ("valves",)) is problem


def test_probabilities_of_far_odds_are_finite():
    assert softmax([-1e4, 0.0, 1e4]).tolist() == [0.0, 0.0, 1.0]
    assert softmax([3.0, 3.0 + np.log(3.0)]) == pytest.approx([0.25, 0.75])


@pytest.mark.slow
def test_all_searches_of_a_reading_together_end_at_their_limit_and_the_best_is_said_not_to_have_converged(
    calibrated, logs, monkeypatch
):
    actuator, calibration, reported = calibrated.actuator, calibrated.calibration, []
    first = shoot([logs["cold"]], actuator, FreeParameters(actuator.load.names, ("position",)), calibration)
    whole = first.solution.evaluations + 6
    monkeypatch.setattr("clutchid.estimation.shooting.MOST_TOGETHER", whole)
    request = FitRequest(("position",), ("load",), calibration=calibration)
    reading = fit_with(SHOOTING, [logs["cold"]], actuator, request, reported.append)
    assert not reading.converged
    assert reading.message == (
        f"stopped after {reading.evaluations} evaluations, not converged: the allowed number of evaluations is used up"
    )
    assert first.solution.evaluations < reading.evaluations <= whole
    counted = [
        step for step in reported if step.stage in ("coarse search", "fine search", "changes") and step.evaluations
    ]
    assert {step.most for step in counted} == {whole}
    assert max(step.evaluations for step in counted) <= whole
    assert any(step.stage == "changes" for step in counted)
