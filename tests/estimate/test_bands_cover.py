"""Bands of loads from position alone cover what they say, on recordings of the model itself."""

import numpy as np
import pytest

from clutchid.estimate import fit
from clutchid.uncertainty.change_prior import change_covariance, changeable

Y = np.linspace(0.5e-3, 20e-3, 40)

pytestmark = pytest.mark.slow


def drifted(actuator, random):
    """The actuator later: everything has drifted as the prior says, and the load has changed by some percent."""
    names = changeable(actuator)
    drift = random.multivariate_normal(np.zeros(len(names)), change_covariance(actuator, names, ()))
    moved = {name: actuator.value(name) + float(by) for name, by in zip(names, drift, strict=True)}
    moved["C_A0"] = abs(moved["C_A0"])  # a leak is not below 0
    bend = np.sin(np.pi * np.linspace(0.0, 1.0, len(actuator.load.theta)))
    change = 1.0 + 0.08 * random.standard_normal() + 0.08 * random.standard_normal() * bend
    theta = {name: float(v * c) for name, v, c in zip(actuator.load.names, actuator.load.theta, change, strict=True)}
    return actuator.replace({**moved, **theta})


def test_drifted_actuators_lie_within_their_bands(calibrated, recorded_by):
    random = np.random.default_rng(3)
    standardised = []
    for k in range(5):
        truth = drifted(calibrated.actuator, random)
        log = recorded_by(truth, seed=k, name="worn", driven=k).without("pressure_a")
        curve = fit(log, calibrated.actuator, calibration=calibrated.calibration).load_curve
        force, low, high = (np.interp(Y, curve.position, each) for each in (curve.force, curve.low, curve.high))
        standardised.append((force - truth.load.force(Y)) / ((high - low) / (2 * 1.96)))
    squares = np.mean(np.square(standardised), axis=1)
    # the errors of one recording go together: five independent ones, of mean square 1 where bands are right, of
    # chi-square over five beyond 3.0 once in a hundred; a band three times too wide would have 0.1
    assert 0.1 < squares.mean() < 3.0, squares
    assert np.mean(np.abs(standardised) <= 1.96) > 0.8
