"""A whole fit by prediction error."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from clutchid.estimation import prediction_error as module
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.prediction_error import PREDICTION_ERROR
from clutchid.estimation.problem import fit_problem
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import changeable
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation

pytestmark = pytest.mark.slow

EXACT = Calibration((), np.zeros((0, 0)))
Y = np.linspace(0.5e-3, 20e-3, 40)
LOAD = FitRequest(("position",), ("load",), calibration=EXACT)


@pytest.fixture(scope="module")
def worn(plant):
    return plant.replace({n: 1.08 * v for n, v in zip(plant.load.names, plant.load.theta, strict=True)})


@pytest.fixture(scope="module")
def worn_log(worn, recorded_by):
    return recorded_by(worn, seed=5, name="worn").without("pressure_a")


@pytest.fixture(scope="module")
def adapted(plant, worn_log):
    return fit_with(PREDICTION_ERROR, [worn_log], plant, LOAD)


@pytest.fixture(scope="module")
def calibrated(plant, recorded_by):
    start = plant.replace({"C_vs": 20e-9, "F_C": 210.0, "tau_y": 0.0, "tau_p": 0.0})
    free = ("load", "C_vs", "C_ve", "F_C", "V_0A", "tau_y", "tau_p")
    return fit_with(PREDICTION_ERROR, [recorded_by(plant)], start, FitRequest(("position", "pressure_a"), free))


def test_a_worn_load_is_found_from_position_alone(adapted, worn):
    true = worn.load.force(Y)
    assert adapted.status == "ok"
    assert adapted.method == "prediction-error"
    assert adapted.actuator.load.force(Y) == pytest.approx(true, abs=0.01 * true.max())
    low, high = (
        np.interp(Y, adapted.load_curve.position, c) for c in (adapted.load_curve.low, adapted.load_curve.high)
    )
    assert np.mean((low < true) & (true < high)) > 0.9


def test_what_drifts_between_recordings_is_free_beside_the_load(adapted, plant):
    drifting = {f"{name}@worn" for name in changeable(plant)}
    assert set(adapted.parameters) == {*plant.load.names, "y_max@worn", *drifting}
    assert adapted.changes == ()


def test_the_pressure_is_found_from_position_alone_with_a_band(adapted, worn, recorded_by):
    true = recorded_by(worn.replace({"tau_p": 0.0}), seed=None)["pressure_a"]
    simulated = adapted.recordings["worn"].simulated
    assert np.sqrt(np.mean((simulated["pressure_a"] - true) ** 2)) < 4e3
    inside = (simulated["pressure_a low"] < true) & (true < simulated["pressure_a high"])
    assert np.mean(inside) > 0.9


def test_the_notes_say_what_the_errors_look_like(adapted):
    said = re.fullmatch(
        r"prediction errors of position: mean square ([\d.]+) times the expected value \(1 if the noise is "
        r"as assumed\); correlation of neighbouring samples (-?[\d.]+) \(0 for a correct model\)\.",
        adapted.notes[-1],
    )
    # 6000 samples tell a mean square to 2 %; the model made the recording, so the filter expects a little more
    assert 0.9 < float(said[1]) < 1.06
    assert abs(float(said[2])) < 0.07


def test_the_errors_are_those_of_prediction(adapted):
    assert adapted.errors.position_rms == pytest.approx(adapted.scales["position"], rel=0.2)
    assert adapted.errors.pressure_a_rms is None


def test_a_calibration_finds_the_parameters_that_the_data_determine(calibrated, plant):
    assert calibrated.status == "ok"
    for name in ("C_vs", "C_ve", "V_0A", "tau_y", "tau_p", "F_C"):
        estimate = calibrated.parameters[name]
        assert estimate.low < plant.value(name) < estimate.high, name
    true = plant.load.force(Y)
    assert calibrated.actuator.load.force(Y) == pytest.approx(true, abs=0.01 * true.max())


def test_a_calibration_leaves_its_covariance_and_what_position_alone_misses(calibrated, plant):
    calibration = calibrated.calibration
    assert calibration.names == tuple(name for name in calibrated.parameters if not name.startswith("theta_"))
    missed = plant.load.phi(Y) @ calibration.position_only.shift((), plant.load.names)
    # the model made the recording: position alone misses little
    assert np.abs(missed).max() < 0.02 * plant.load.force(Y).max()


def test_the_bias_of_a_calibration_is_taken_off(plant, worn_log, adapted):
    off = np.full(len(plant.load.theta), 100.0)
    errors = PositionOnlyErrors(((),), plant.load.names, off[None], np.zeros(1))
    calibration = replace(EXACT, position_only=errors)
    result = fit_with(PREDICTION_ERROR, [worn_log], plant, replace(LOAD, calibration=calibration))
    lower = adapted.load_curve.force - result.load_curve.force
    assert lower == pytest.approx(plant.load.phi(result.load_curve.position) @ off, rel=1e-6)


def test_rounds_that_swing_make_only_a_share_of_their_moves(plant, worn_log, monkeypatch):
    problem = fit_problem([worn_log.slice(0, 500)], plant, FreeParameters(("theta_5",), ("position",)), EXACT)
    evaluated = []

    def swinging(problem, x, here, evaluate):
        evaluated.append(float(x[0]))
        target = x + 3 * (0.01 - x[0]) * np.eye(x.size)[0]  # three times as far as it should
        at = replace(here.linearisation(), R=1e4 * np.eye(x.size))
        return module.Solution(target, at, "converged", 1)

    monkeypatch.setattr(module, "minimise_round", swinging)
    solution = module.search(problem, np.zeros(len(problem.coordinates)), 4)
    assert solution.status == "limit"
    # a whole move; it is taken back: half a move; again: a quarter; it goes on: half
    assert evaluated == pytest.approx([0.0, 0.03, 0.0, 0.0075])


def test_a_round_whose_first_steps_are_all_rejected_goes_on_with_shorter_ones():
    """Only within 1e-3 of the start the model can be simulated; the minimum lies at 1."""
    problem = SimpleNamespace(bounds=lambda: (np.array([-10.0]), np.array([10.0])))

    def predicted(x):
        cost = 0.5 * float((x - 1.0) @ (x - 1.0))
        return SimpleNamespace(linearisation=lambda: Linearisation(np.eye(1), x - 1.0, cost, 1))

    def evaluate(x, _):
        return predicted(x) if abs(x[0]) <= 1e-3 else Failure("diverged")

    start = np.zeros(1)
    # the damping that the first five steps reach, 33, makes one of 0.03
    assert 0.0 < module.minimise_round(problem, start, predicted(start), evaluate).x[0] <= 1e-3
