"""Jobs in processes of their own: how they are done, cancelled and killed, and that nothing of them is left."""

import contextlib
import os
import signal

import psutil
import pytest

from clutchid.app.jobs import Job
from fixtures.commands import wait_for

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cal(spread, recorded):
    """The id of a recording with pressure."""
    return spread.checked(recorded / "cal.csv")


def processes():
    """Processes that this one has started and that run; one may end while it is asked."""
    running = []
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            running += [process.pid] if process.status() != psutil.STATUS_ZOMBIE else []
    return running


def fits_running(served):
    return [job for job in served.all(Job) if job["do"] == "FitRecordings" and job["status"] == "running"]


def test_a_cancelled_job_ends_at_once_without_an_orphan(spread, cal):
    id_ = spread.ask("POST", "/api/fits", {"verb": "calibrate", "recordings": [cal]}).json["id"]
    wait_for(lambda: any(running["stage"] == "preparation" for running in fits_running(spread)))
    second = spread.ask("POST", "/api/fits", {"verb": "calibrate", "recordings": [cal]}).json["id"]
    assert spread.get(second)["status"] == "waiting"
    (job,) = fits_running(spread)
    process = spread.session.jobs._jobs[job["id"]].process.pid
    for about in (second, id_):
        (running,) = [job for job in spread.all(Job) if job["about"] == about]
        assert spread.ask("DELETE", f"/api/jobs/{running['id']}").json == {"cancelled": True}
    wait_for(lambda: process not in processes(), 5.0)
    assert spread.get(id_)["status"] == "cancelled"
    assert spread.ask("DELETE", "/api/jobs/job-99").json == {"cancelled": False}


def test_a_killed_worker_is_said_and_the_next_job_goes_on(spread, cal, recorded):
    id_ = spread.ask("POST", "/api/fits", {"verb": "calibrate", "recordings": [cal]}).json["id"]
    wait_for(lambda: fits_running(spread) and fits_running(spread)[0]["stage"])
    os.kill(spread.session.jobs._jobs[fits_running(spread)[0]["id"]].process.pid, signal.SIGKILL)
    assert "SIGKILL" in spread.wait(id_, "failed")["message"]
    again = spread.upload(recorded / "worn.csv")
    assert spread.wait(again, "ready")["look"]
