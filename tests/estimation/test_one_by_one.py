"""Several recordings whose load is read from a calibration are read together and one by one."""

import sys
from dataclasses import replace

import pytest

from clutchid.errors import DataError
from clutchid.estimation.fit import fit_request
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Departure
from fixtures.baselines import calibration_like, with_baseline


@pytest.fixture
def logs(drive):
    return [replace(drive, name=name) for name in ("long", "short", "lost")]


@pytest.fixture
def read(monkeypatch):
    """Read recordings whose fits are known: of "short" alone there is none, that of "lost" alone fails."""

    def run(logs, result, **asked):
        requests = {}

        def fit_with(method, recordings, start, request, progress, *_):
            names = tuple(log.name for log in recordings)
            requests[names] = request
            if names == ("short",):
                raise DataError("short: 90 measured samples for 24 free parameters.")
            (recording,) = result.recordings.values()
            together = replace(result, recordings=dict.fromkeys(names, recording))
            return replace(together, status="failed") if names == ("lost",) else together

        monkeypatch.setattr(sys.modules["clutchid.estimation.fit"], "method_of", lambda *asked: None)
        monkeypatch.setattr(sys.modules["clutchid.estimation.fit"], "fit_with", fit_with)
        return fit_request(logs, None, FitRequest(**asked)), requests

    return run


def test_a_recording_that_cannot_be_read_alone_does_not_cost_the_fit_of_all(logs, short_fit, read):
    together, requests = read(logs, with_baseline(short_fit), bootstrap=20, profile=("theta_1",))
    assert together.status == "ok"
    assert list(together.readings) == ["long"]
    assert requests[("long", "short", "lost")].checks
    assert not requests[("long",)].checks


def test_recordings_are_read_alone_only_if_there_are_several_and_a_load_to_compare_with(logs, short_fit, read):
    assert read(logs[:1], with_baseline(short_fit))[0].readings == {}
    together, requests = read(logs, short_fit)
    assert together.readings == {}
    assert list(requests) == [("long", "short", "lost")]


#: What readings alone say of recordings: near, of another truck, and not converged.
NEAR, ANOTHER, SPOILED = Departure(1.0, 10.0, 0.9), Departure(63.0, 11.0, 0.6), Departure(176.0, 9.0, 30.1)


@pytest.fixture
def read_alone(monkeypatch, drive, short_fit):
    """Read recordings whose readings alone depart so from the calibration; names of the fits that were begun."""

    def run(**departures):
        begun = []

        def fit_with(method, recordings, start, request, progress, *_):
            names = tuple(log.name for log in recordings)
            begun.append(names)
            (recording,) = short_fit.recordings.values()
            departure = departures[names[0]]
            return replace(
                with_baseline(short_fit, share=1.0), recordings=dict.fromkeys(names, recording), departure=departure,
                converged=departure is not SPOILED,
            )  # fmt: skip

        monkeypatch.setattr(sys.modules["clutchid.estimation.fit"], "method_of", lambda *asked: None)
        monkeypatch.setattr(sys.modules["clutchid.estimation.fit"], "fit_with", fit_with)
        logs = [replace(drive, name=name) for name in departures]
        try:
            fit = fit_request(logs, short_fit.actuator, FitRequest(calibration=calibration_like(short_fit)))
        except DataError as error:
            return str(error), begun
        return fit, begun

    return run


def test_recordings_of_two_vehicles_are_named_with_the_result_of_each_and_no_search_of_all_is_begun(read_alone):
    message, begun = read_alone(first=NEAR, second=NEAR, other=ANOTHER)
    head, *lines = message.splitlines()
    assert head == "these recordings are of two vehicles, so each was estimated on its own."
    assert lines[0].startswith("first: of the vehicle of CAL.toml, at most ")
    assert "trust " in lines[0]
    assert lines[2] == "other: of another vehicle than CAL.toml; use the calibration of that vehicle."
    assert begun == [("first",), ("second",), ("other",)]


def test_a_recording_that_does_not_converge_alone_is_named_and_no_vehicle_is_blamed(read_alone):
    message, begun = read_alone(first=NEAR, spoiled=SPOILED)
    head, _, line = message.splitlines()
    assert head == "these recordings have no load in common, so each was estimated on its own."
    assert line.startswith(
        "spoiled: not converged, with a cost 30 times that of the calibration; leave the recording out, and "
    )
    assert line.endswith(" --start CAL.toml")
    assert len(begun) == 2


def test_recordings_that_are_all_of_another_vehicle_are_not_said_to_be_of_two(read_alone):
    message, _ = read_alone(first=ANOTHER, second=ANOTHER)
    assert "two vehicles" not in message
    assert message.count("of another vehicle than CAL.toml") == 2


def test_recordings_of_one_vehicle_are_read_alone_once_and_then_together(read_alone):
    fit, begun = read_alone(first=NEAR, second=NEAR)
    assert begun == [("first",), ("second",), ("first", "second")]
    assert list(fit.readings) == ["first", "second"]
