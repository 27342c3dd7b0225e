"""What the user sees of a fit by multiple shooting: intervals, load curve, bands, warnings and notes in words."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.method import fit_at
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration, PositionOnlyErrors
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE

#: Calibrated parameters that do not change between recordings, and their standard deviations: m², Pa, N/m.
NAMES = ("A_A", "P_0", "K_z")
STD = np.array([2e-5, 300.0, 1e5])


@pytest.fixture(scope="module")
def conditions():
    return Calibration(NAMES, np.diag(STD**2))


@pytest.fixture(scope="module")
def shot(plant, worn_log, conditions):
    """The load of the worn plant from position alone, all else exactly as it is."""
    return shoot([worn_log], plant, FreeParameters(plant.load.names, ("position",)), conditions)


@pytest.fixture(scope="module")
def fit(shot, conditions):
    return fit_at(SHOOTING, shot, conditions)


def test_the_load_curve_is_that_of_the_fitted_actuator_within_its_band(fit, worn):
    curve = fit.load_curve
    assert curve.position[[0, -1]] == pytest.approx([0.0, fit.actuator.parameters.y_max])
    assert curve.force == pytest.approx(fit.actuator.load.force(curve.position))
    assert np.all((curve.low < curve.force) & (curve.force < curve.high))
    reached = (curve.position > 0.5e-3) & (curve.position < 20e-3)
    true = worn.load.force(curve.position)
    assert np.all((curve.low < true) & (true < curve.high) | ~reached)


def test_the_band_of_the_load_is_that_of_its_weights(fit, shot):
    phi = fit.actuator.load.phi(fit.load_curve.position)
    weights = slice(len(fit.actuator.load.theta))
    deviation = np.sqrt(np.einsum("ni,ij,nj->n", phi, fit.covariance[weights, weights], phi))
    assert fit.load_curve.high - fit.load_curve.force == pytest.approx(1.96 * deviation)
    assert QUANTILE == 1.96


def test_estimates_have_the_value_the_error_and_the_interval_of_their_number(fit, shot):
    solution = shot.solution.x
    assert list(fit.parameters) == list(shot.problem.names)
    for i, (name, estimate) in enumerate(fit.parameters.items()):
        assert estimate.value == pytest.approx(shot.problem.si(solution)[i])
        assert estimate.value == pytest.approx(fit.actuator.value(name.partition("@")[0]))
        assert estimate.std == pytest.approx(np.sqrt(fit.covariance[i, i]))
        if shot.problem.coordinates[i].positive:  # the interval is one of the logarithm
            assert estimate.high * estimate.low == pytest.approx(estimate.value**2)
            assert estimate.high == pytest.approx(estimate.value * np.exp(1.96 * estimate.std / estimate.value))
        else:
            assert estimate.high - estimate.value == pytest.approx(1.96 * estimate.std)
            assert estimate.value - estimate.low == pytest.approx(1.96 * estimate.std)
    units = {name: fit.parameters[name].unit for name in ("theta_5", "y_max@worn", "P_S@worn", "R_0vs@worn")}
    assert units == {"theta_5": "N", "y_max@worn": "m", "P_S@worn": "Pa", "R_0vs@worn": "1"}


def test_the_bias_of_the_calibration_is_taken_off_and_widens_the_band(fit, shot, conditions):
    bias = np.linspace(-30.0, 60.0, 22)
    errors = PositionOnlyErrors(((),), fit.actuator.load.names, bias[None], np.zeros(1))
    plain, shifted = fit, fit_at(SHOOTING, shot, replace(conditions, position_only=errors))
    y = plain.load_curve.position
    taken = plain.actuator.load.phi(y) @ bias
    assert shifted.load_curve.force == pytest.approx(plain.load_curve.force - taken)
    half, by = plain.load_curve.high - plain.load_curve.force, DEVIATION_FACTOR
    assert shifted.load_curve.high - shifted.load_curve.force == pytest.approx(np.hypot(half, 1.96 * by * taken))
    for number, name in enumerate(plain.actuator.load.names):
        estimate = shifted.parameters[name]
        before = plain.parameters[name]
        assert (estimate.value, estimate.low, estimate.high) == pytest.approx(
            (before.value - bias[number], before.low - bias[number], before.high - bias[number])
        )


def test_the_pressure_has_a_finite_band_that_holds_the_true_pressure(fit, worn, recorded_by):
    simulated = fit.recordings["worn"].simulated
    low, high = simulated["pressure_a low"], simulated["pressure_a high"]
    assert np.isfinite(low).all()
    assert np.all(low < simulated["pressure_a"])
    assert np.all(simulated["pressure_a"] < high)
    prompt = worn.replace({"tau_p": 0.0})
    true = recorded_by(prompt, seconds=6.0, seed=None, driven=1)["pressure_a"]
    assert np.mean((low < true) & (true < high)) > 0.95
    assert np.sqrt(np.mean((simulated["pressure_a"] - true) ** 2)) < 5e3


def test_the_errors_of_a_recording_are_those_of_its_sensor(fit):
    # 30 µm of noise are what is left; the lag of the sensor is no error
    assert fit.recordings["worn"].errors.position_rms == pytest.approx(30e-6, rel=0.1)
    assert fit.recordings["worn"].errors.pressure_a_rms is None
    assert fit.errors == fit.recordings["worn"].errors, "of one recording, the whole is the part"


def test_a_fit_says_how_it_was_done_and_within_which_scales(fit, shot):
    assert fit.method == "shooting"
    assert fit.status == "ok"
    assert fit.message == f"converged after {shot.solution.evaluations} evaluations"
    assert fit.scales == {"position": pytest.approx(5e-5)}
    assert fit.bounds["theta_3"] == (-np.inf, np.inf)
    (start,) = fit.recordings["worn"].starts
    assert start[0] == pytest.approx(0.0, abs=1e-4)
    assert start[1] == pytest.approx(109500.0, abs=2e3)


def test_notes_name_what_the_recordings_tell_and_what_they_do_not(calibrated):
    determined, undetermined, *_ = calibrated.notes
    assert determined.startswith("determined by the data: ")
    assert undetermined.startswith("not determined by the data, so the prior applies: ")
    names = [
        set(note.removesuffix(".").partition(": ")[2].replace(" and ", ", ").split(", "))
        for note in (determined, undetermined)
    ]
    assert names[0] | names[1] == {name for name in calibrated.parameters if not name.startswith("theta_")}
    assert not names[0] & names[1]
    # how fast the valves pass air shows; how fast the reservoir behind them recovers hardly does
    assert {"tau_y", "C_ve", "V_0A", "R_0vs"} <= names[0]
    assert "tau_S" in names[1]


def test_no_note_names_a_load_weight(fit):
    assert all("theta" not in note for note in fit.notes)


def test_a_number_at_its_bound_is_a_warning_that_names_bound_and_value(plant, worn_log, conditions):
    most = 1.02 * plant.value("theta_9")
    wanted = FreeParameters(plant.load.names, ("position",), bounds={"theta_9": (0.0, most)})
    bounded = fit_at(SHOOTING, shoot([worn_log], plant, wanted, conditions), conditions)
    assert bounded.status == "warning"
    assert bounded.warnings == (f"theta_9 lies at its upper bound {most:g} N.",)
    assert bounded.bounds["theta_9"] == (0.0, most)


def test_a_search_that_did_not_converge_is_a_warning(shot, conditions):
    stopped = fit_at(
        SHOOTING, replace(shot, solution=replace(shot.solution, status="limit", evaluations=7)), conditions
    )
    assert stopped.warnings == (
        ("the search stopped after 7 evaluations, not converged: the allowed number of evaluations is used up."),
    )
    assert stopped.status == "warning"
    assert not stopped.converged
    assert fit_at(SHOOTING, shot, conditions).converged


def test_a_failed_search_is_a_result_without_values(shot):
    failure = Failure("y is not finite at 0.3 s.")
    failed = fit_at(SHOOTING, replace(shot, solution=failure))
    assert failed.status == "failed"
    assert failed.message == "the start values cannot be simulated. y is not finite at 0.3 s."
    assert list(failed.parameters) == list(shot.problem.names)
    assert all(np.isnan(estimate.value) for estimate in failed.parameters.values())
