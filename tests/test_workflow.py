"""The workflow that the command line, pages and fleets share: several recordings read together and alone."""

import sys
from dataclasses import replace

import pytest

from clutchid import workflow
from clutchid.errors import DataError
from clutchid.estimate import fit
from clutchid.estimate.request import FitRequest
from clutchid.model import Actuator
from fixtures.baselines import with_baseline


@pytest.fixture(scope="module")
def fitted(drive, with_noise):
    """A fit of 4 s by the model that made them."""
    return fit(with_noise(drive, 1).slice(0, 4000))


@pytest.fixture
def logs(drive):
    return [replace(drive, name=name) for name in ("long", "short", "lost")]


@pytest.fixture
def read(fitted, monkeypatch):
    """Read recordings whose fits are known: of "short" alone there is none, that of "lost" alone fails."""

    def run(logs, result, **asked):
        requests = {}

        def known(some, actuator, request, verify, progress):
            names = tuple(log.name for log in some)
            requests[names] = request
            if names == ("short",):
                raise DataError("short: 90 measured samples for 24 free parameters.")
            return replace(result, status="failed") if names == ("lost",) else result

        monkeypatch.setattr(sys.modules["clutchid.estimate.fit"], "fit_request", known)
        return workflow.fit_recordings(logs, Actuator(), FitRequest(**asked)), requests

    return run


def test_a_recording_that_cannot_be_read_alone_does_not_cost_the_fit_of_all(logs, fitted, read):
    outcome, requests = read(logs, with_baseline(fitted), bootstrap=20, profile=("theta_1",))
    assert outcome.fit.status == "ok"
    assert list(outcome.single) == ["long"]
    assert requests[("long", "short", "lost")].checks
    assert not requests[("long",)].checks


def test_recordings_are_read_alone_only_if_there_are_several_and_a_load_to_compare_with(logs, fitted, read):
    assert read(logs[:1], with_baseline(fitted))[0].single == {}
    outcome, requests = read(logs, fitted)
    assert outcome.single == {}
    assert list(requests) == [("long", "short", "lost")]
