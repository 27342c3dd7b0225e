"""What the errors of prediction look like, and the noise of the sensors from them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from clutchid.estimation.prediction import innovation_scales, innovations, predict_errors
from clutchid.simulation.noise import Noise

pytestmark = pytest.mark.slow

SAMPLES = 20_000


def prediction(position, pressure=None, variance=4.0):
    """Errors of prediction of given size over deviation."""
    errors = np.full((position.size, 2, 2), np.nan)
    errors[:, :, 1] = variance
    errors[:, 0, 0] = position * np.sqrt(variance)
    if pressure is not None:
        errors[:, 1, 0] = pressure * np.sqrt(variance)
    return SimpleNamespace(segments=(SimpleNamespace(errors=errors),))


def test_white_errors_of_the_expected_size_have_nis_1_and_no_colour():
    nu = np.random.default_rng(0).standard_normal(SAMPLES)
    of = innovations(prediction(nu), "position")
    # five standard deviations of a mean square and of a correlation
    assert of.nis == pytest.approx(1.0, abs=5 * np.sqrt(2 / SAMPLES))
    assert of.lag_1 == pytest.approx(0.0, abs=5 / np.sqrt(SAMPLES))
    assert 1.0 <= of.correlated_samples < 1.2


def test_errors_that_follow_their_neighbours_count_as_few():
    rng, memory = np.random.default_rng(1), 0.8
    nu = np.zeros(SAMPLES)
    for i in range(1, SAMPLES):
        nu[i] = memory * nu[i - 1] + rng.standard_normal()
    of = innovations(prediction(nu), "position")
    assert of.lag_1 == pytest.approx(memory, abs=0.02)
    assert of.correlated_samples == pytest.approx((1 + memory) / (1 - memory), rel=0.2)


def test_columns_are_separate_and_missing_samples_left_out():
    rng = np.random.default_rng(2)
    position, pressure = rng.standard_normal(SAMPLES), 3 * rng.standard_normal(SAMPLES)
    pressure[::2] = np.nan
    of = prediction(position, pressure)
    assert innovations(of, "position").nis == pytest.approx(1.0, rel=0.05)
    assert innovations(of, "pressure_a").nis == pytest.approx(9.0, rel=0.05)


def test_a_noisier_sensor_is_found_out(plant, recorded_by, problem_of):
    log = recorded_by(plant, 2.0, seed=None)
    rng = np.random.default_rng(1)
    rough = log.with_columns(position=log["position"] + 1.5e-4 * rng.standard_normal(len(log)))
    problem = problem_of(rough, plant, ("C_vs",), ("position",))
    scales = innovation_scales(problem, predict_errors(problem, np.zeros(1)))
    # 2000 samples tell a median to 3 %
    assert scales == {"position": pytest.approx(1.5e-4, rel=0.12)}


def test_a_better_sensor_than_usual_is_not_believed(plant, recorded_by, problem_of):
    problem = problem_of(recorded_by(plant, 1.0, seed=None), plant, ("C_vs",))
    assert innovation_scales(problem, predict_errors(problem, np.zeros(1))) == problem.noise.measured


@pytest.mark.parametrize("rough", [2.0, 4.0])
def test_the_state_variance_is_subtracted_from_the_errors_and_the_usual_noise_is_not(rough):
    usual = Noise().measured["position"]
    state_std, sensor = 1.5 * usual, rough * usual
    # the filter expects its spread and the usual sensor; the errors, all quantiles, have the spread and this one
    normal = norm.ppf((np.arange(SAMPLES) + 0.5) / SAMPLES)
    expected = state_std**2 + usual**2
    observed = prediction(np.sqrt((state_std**2 + sensor**2) / expected) * normal, variance=expected)
    problem = SimpleNamespace(measure=("position",), noise=Noise())
    assert innovation_scales(problem, observed) == {"position": pytest.approx(sensor, rel=1e-3)}
