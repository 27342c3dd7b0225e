"""What a fit to position alone errs on the recording of its calibration, and that later fits subtract it."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.hypotheses import explanation, mixture
from clutchid.estimation.position_only import position_only_errors
from clutchid.estimation.posterior import parameter_uncertainty
from clutchid.estimation.request import FitRequest, FreeParameters, SearchStart
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.uncertainty.calibration import PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, changeable
from clutchid.numerics.failure import Failure

Y = np.linspace(0.5e-3, 20e-3, 40)


@pytest.fixture(scope="module")
def errors(calibrated):
    return calibrated.calibration.position_only


@pytest.fixture(scope="module")
def start(calibrated):
    return SearchStart({}, calibrated.scales)


@pytest.fixture(scope="module")
def blind(calibrated, drive_log, start):
    """The search in the calibration recording without its pressure."""
    free = FreeParameters(calibrated.actuator.load.names, ("position",), start=start)
    return shoot([drive_log.without("pressure_a")], calibrated.actuator, free, calibrated.calibration)


def reread(calibrated, log, calibration):
    request = FitRequest(("position",), ("load",), calibration=calibration)
    return fit_with(SHOOTING, [log.without("pressure_a")], calibrated.actuator, request)


def test_they_are_of_the_load_and_of_what_may_change_under_every_hypothesis(errors, calibrated):
    actuator = calibrated.actuator
    assert errors.hypotheses == HYPOTHESES
    assert errors.names == (*actuator.load.names, *changeable(actuator)), "neither a phase nor a far stop repeats"
    assert errors.shifts.shape == (len(HYPOTHESES), len(errors.names))
    assert np.isfinite(errors.shifts).all()
    assert np.isfinite(errors.log_evidence).all()
    assert errors.dispersion > 0.0


def test_a_model_without_an_error_errs_by_noise_only(errors, blind, calibrated):
    names = calibrated.actuator.load.names
    phi = calibrated.actuator.load.phi(Y)
    covariance = parameter_uncertainty(blind.problem, blind.solution, None).matrix
    slopes = blind.problem.slopes(blind.solution.x)[: len(names)]
    load = phi * slopes
    std = np.sqrt(np.einsum("ni,ij,nj->n", load, covariance[: len(names), : len(names)], load))
    error = phi @ errors.shift((), names)
    assert np.all(np.abs(error) < 3.0 * std)
    peak = calibrated.actuator.load.force(Y).max()
    assert np.abs(error).max() < 0.02 * peak
    evidence = {h: errors.evidence(h) for h in HYPOTHESES}
    assert all(gain <= 0.0 for gain in evidence.values()), "a change explains nothing where nothing has changed"
    assert evidence[()] == 0.0


def test_they_are_what_the_search_finds_beside_the_calibration(errors, blind, calibrated):
    explained = explanation(blind, errors.dispersion)
    problem = blind.problem
    for hypothesis in (HYPOTHESES[0], HYPOTHESES[2]):
        x = explained.solution.x + explained.under(hypothesis).step
        for name, shift in zip(errors.names, errors.shift(hypothesis, errors.names), strict=True):
            place = [c.base for c in problem.coordinates].index(name)
            c = problem.coordinates[place]
            moved = np.log(c.si(x[place]) / c.mean) if c.positive else c.si(x[place]) - c.mean
            assert moved == pytest.approx(shift, abs=1e-9 * max(1.0, abs(c.mean))), name


@pytest.mark.slow
def test_the_calibration_recording_without_pressure_gives_the_calibrated_load_back(calibrated, drive_log):
    calibration, true = calibrated.calibration, calibrated.actuator.load.force(Y)
    missed, plain = (
        np.abs(reread(calibrated, drive_log, errors).actuator.load.force(Y) - true).max()
        for errors in (calibration, replace(calibration, position_only=None))
    )
    # a model without an error misses little anyway: what is left is that hypotheses are searched again
    assert missed < 0.5 * plain
    assert missed < 1e-3 * true.max()


def test_known_errors_shift_a_load_by_exactly_as_much(calibrated, worn_log):
    names = calibrated.actuator.load.names
    shifts = np.append(np.linspace(-30.0, 60.0, len(names)), 0.02)
    shift_errors = PositionOnlyErrors(((),), (*names, "C_vs"), shifts[None], np.zeros(1))
    calibration = calibrated.calibration
    free = FreeParameters(names, ("position",))
    search = shoot([worn_log], calibrated.actuator, free, calibration)
    explanations = {(): explanation(search, 1.0)}
    plain, shifted = (
        mixture(explanations, replace(calibration, position_only=errors)).x for errors in (None, shift_errors)
    )
    si = search.problem.si(plain) - search.problem.si(shifted)
    assert si[: len(names)] == pytest.approx(shifts[:-1], abs=1e-9)
    place = search.problem.names.index("C_vs@worn")
    ratio = search.problem.si(plain)[place] / search.problem.si(shifted)[place]
    assert np.log(ratio) == pytest.approx(0.02, rel=1e-9)
    others = [i for i in range(len(names), si.size) if i != place]
    np.testing.assert_array_equal(plain[others], shifted[others])


@pytest.mark.slow
def test_of_several_recordings_they_are_the_mean_and_one_whose_search_fails_is_left_out(calibrated, drive_log):
    calibration, actuator = replace(calibrated.calibration, position_only=None), calibrated.actuator
    parts = [replace(drive_log.slice(*ends), name=name) for name, ends in (("a", (0, 4000)), ("b", (4000, 8000)))]

    def errors_of(logs, failing=()):
        def search(logs, *args):
            result = shoot(logs, *args)
            return replace(result, solution=Failure("no")) if logs[0].name in failing else result

        return position_only_errors(replace(SHOOTING, search=search), logs, actuator, calibration)

    a, b, both = errors_of(parts[:1]), errors_of(parts[1:]), errors_of(parts)
    np.testing.assert_allclose(both.shifts, (a.shifts + b.shifts) / 2, rtol=1e-12)
    np.testing.assert_allclose(both.log_evidence, (a.log_evidence + b.log_evidence) / 2, rtol=1e-12)
    assert both.dispersion == pytest.approx((a.dispersion + b.dispersion) / 2)
    np.testing.assert_array_equal(errors_of(parts, ("b",)).shifts, a.shifts)
    assert errors_of(parts, ("a", "b")) is None


def test_a_method_without_hypotheses_has_the_errors_of_no_change(calibrated, drive_log, blind, start):
    calibration, actuator = replace(calibrated.calibration, position_only=None), calibrated.actuator
    errors = position_only_errors(replace(SHOOTING, changes=None), [drive_log], actuator, calibration, start)
    assert errors.hypotheses == ((),)
    expected = np.array(blind.problem.actuator_of(blind.solution.x, "log").load.theta) - actuator.load.theta
    np.testing.assert_allclose(errors.shift((), actuator.load.names), expected, atol=1e-6)
