"""Parameters that are fixed but uncertain: calibration and drift, and the factor on deviations."""

import numpy as np
import pytest

from clutchid.inference.uncertainty.calibration import DEVIATION_FACTOR, Calibration, calibrated_deviation
from clutchid.model import Actuator


def test_a_calibrated_parameter_is_as_uncertain_as_its_calibration_and_its_drift_together():
    calibration = Calibration(("P_S",), np.array([[3600.0**2]]))
    # 0.3 % of 9 bar
    assert calibrated_deviation(Actuator(), "P_S", calibration) == pytest.approx(np.hypot(3600.0, 2700.0))
    assert calibrated_deviation(Actuator(), "D_v", calibration) == pytest.approx(100.0), "it was not calibrated"


def test_deviations_of_a_fit_by_prediction_error_are_scaled_by_0_85():
    # docs/methods.md, "Intervals"; chosen on trucks of the proving ground
    assert DEVIATION_FACTOR == 0.85
