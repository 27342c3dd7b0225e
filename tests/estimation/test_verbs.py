"""`calibrate` and `estimate` in Python: fits with their own defaults, from a fit, a file, or what is in a file."""

import inspect

import numpy as np
import pytest

from clutchid import FitRequest, calibrate, estimate, fit, parameter_file, read_parameters, write_parameters
from clutchid.errors import DataError
from clutchid.truck import Truck, drive


@pytest.fixture(scope="module")
def recordings():
    """A recording with pressure, and one without."""
    return drive(Truck(), seconds=1.5, seed=1, name="cal").log, drive(Truck(), seconds=1.5, seed=2, pressure=False).log


def same(result, expected):
    return result.parameters == expected.parameters and np.array_equal(result.covariance, expected.covariance)


def test_both_have_the_arguments_of_fit_and_their_own_defaults():
    of_fit = inspect.signature(fit).parameters
    for verb, own in ((calibrate, set()), (estimate, {"start"})):
        arguments = inspect.signature(verb).parameters
        assert set(arguments) - set(of_fit) == own
        assert set(of_fit) - set(arguments) <= {"actuator", "calibration"}
        assert {name: of_fit[name].default for name in arguments if name not in {"measure", "free", *own}} == {
            name: arguments[name].default for name in arguments if name not in {"measure", "free", *own}
        }


def test_a_calibration_that_is_not_there_is_a_sentence(recordings, tmp_path):
    with pytest.raises(DataError, match="there is no such file"):
        estimate(recordings[1], tmp_path / "cal.toml")


def test_a_calibration_is_a_fit_with_its_defaults(recordings, monkeypatch):
    requests = []
    monkeypatch.setattr("clutchid.verbs.fitting.fit_request", lambda *request, **_: requests.append(request[1:]))
    calibrate(recordings[0], on_failure="return")
    fit(recordings[0], measure="position,pressure_a", free="auto", on_failure="return")
    assert requests[0] == requests[1]


@pytest.mark.slow
def test_an_estimate_is_a_fit_with_its_defaults_whatever_holds_the_calibration(recordings, tmp_path):
    cal, worn = recordings
    calibrated = calibrate(cal, free="load,P_S", method="shooting")
    read = fit(worn, calibrated.actuator, request=FitRequest(calibration=calibrated.calibration))
    assert read.comparison is not None
    write_parameters(parameter_file(calibrated), tmp_path / "cal.toml")
    for start in (calibrated, str(tmp_path / "cal.toml"), read_parameters(tmp_path / "cal.toml")):
        assert same(estimate(worn, start), read)
