"""Bands of loads from position alone cover what they say, on recordings of the model itself."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from clutchid import FitRequest, fit

ROOT = Path(__file__).resolve().parents[2]

Y = np.linspace(0.5e-3, 20e-3, 40)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def drifted():
    """The actuator later: everything has drifted as the prior says, and the load has changed by some percent."""
    spec = importlib.util.spec_from_file_location("own_data", ROOT / "benchmarks" / "own_data.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.used


def test_drifted_actuators_lie_within_their_bands(calibrated, recorded_by, drifted):
    random = np.random.default_rng(3)
    standardised = []
    for k in range(5):
        truth = drifted(calibrated.actuator, random)
        log = recorded_by(truth, seconds=4.0, seed=k, name="worn", driven=k).without("pressure_a")
        curve = fit(log, calibrated.actuator, request=FitRequest(calibration=calibrated.calibration)).load_curve
        force, low, high = (np.interp(Y, curve.position, column) for column in (curve.force, curve.low, curve.high))
        standardised.append((force - truth.load.force(Y)) / ((high - low) / (2 * 1.96)))
    squares = np.mean(np.square(standardised), axis=1)
    # the errors of one recording go together: five independent ones, of mean square 1 where bands are right, of
    # chi-square over five beyond 3.0 once in a hundred; a band three times too wide would have 0.1
    assert 0.1 < squares.mean() < 3.0, squares
    assert np.mean(np.abs(standardised) <= 1.96) > 0.8
