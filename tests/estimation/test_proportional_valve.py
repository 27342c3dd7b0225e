"""A proportional valve with a spool that lags and a port that opens with a power: a calibration finds both."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING

pytestmark = pytest.mark.slow

EXPONENT, LAGS = 1.3, {"tau_vs": 4e-3, "tau_ve": 1.5e-3}


@pytest.fixture(scope="module")
def proportional(plant):
    return replace(plant, model=AUTOMATIC).replace({"n_vs": EXPONENT, "n_ve": EXPONENT, **LAGS})


@pytest.fixture(scope="module")
def log(proportional, recorded_by):
    return recorded_by(proportional)


@pytest.fixture(scope="module")
def calibrated(proportional, log):
    """A calibration that starts from lines and the usual lag, as without knowledge of the valves."""
    start = proportional.replace({"n_vs": 1.0, "n_ve": 1.0, "tau_vs": 2e-3, "tau_ve": 2e-3})
    return fit_with(SHOOTING, [log], start, FitRequest(("position", "pressure_a"), ("auto",)))


def test_the_calibration_finds_exponents_lags_and_supply_pressure(calibrated, proportional):
    assert calibrated.status == "ok"
    for name in ("n_vs", "n_ve", *LAGS, "gamma", "P_S"):
        estimate = calibrated.parameters[name]
        assert abs(estimate.value - proportional.value(name)) < 3.0 * estimate.std, name
    # a line is excluded by far: its prior allows a fifth
    for name in ("n_vs", "n_ve"):
        estimate = calibrated.parameters[name]
        assert (estimate.value - 1.0) / estimate.std > 5.0, name


def test_the_calibration_finds_the_load(calibrated, proportional):
    y = np.linspace(0.5e-3, 20e-3, 40)
    true = proportional.load.force(y)
    assert calibrated.actuator.load.force(y) == pytest.approx(true, abs=0.005 * true.max())
