"""Several recordings whose load is read from a calibration are read together and one by one."""

import sys
from dataclasses import replace

import pytest

from clutchid.errors import DataError
from clutchid.estimation.fit import fit_request
from clutchid.estimation.request import FitRequest
from fixtures.baselines import with_baseline


@pytest.fixture
def logs(drive):
    return [replace(drive, name=name) for name in ("long", "short", "lost")]


@pytest.fixture
def read(monkeypatch):
    """Read recordings whose fits are known: of "short" alone there is none, that of "lost" alone fails."""

    def run(logs, result, **asked):
        requests = {}

        def fit_with(method, recordings, start, request, progress):
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
