"""Work on a Dask scheduler: nothing is lost or done twice, and what ends its process is named."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import dask
import psutil
import pytest
from distributed.security import Security

from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.fleets import cluster
from clutchid.fleets.cluster import Workers, answered, connected, results
from fixtures.fleet_faults import faulty, own_error

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

GOOD = [("good", n) for n in range(30)]


def test_a_scheduler_that_does_not_answer_is_a_sentence_within_10_s(monkeypatch):
    assert cluster.ANSWER <= 4.0, "two attempts, and what is around them, take 10 s"
    monkeypatch.setattr(cluster, "ANSWER", 0.8)
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes connections, and says nothing
        for address in ("tcp://127.0.0.1:9", "nowhere at all", f"tcp://127.0.0.1:{silent.getsockname()[1]}"):
            begin, words = time.monotonic(), f"--scheduler {address}: does not answer"
            with pytest.raises(ParameterError, match=words), connected(Workers(scheduler=address)):
                pass
            assert time.monotonic() - begin < 2.5 * 0.8 + 2.0


@pytest.fixture
def patient(monkeypatch):
    """Workers of Dask take long to start on a busy machine."""
    monkeypatch.setattr(cluster, "ANSWER", 60.0)


@pytest.fixture
def scheduler(tmp_path, patient):
    """A scheduler in a process of its own, that a test may lose; gives its address, and starts a worker for it."""
    with _started(tmp_path) as started:
        yield started


@pytest.fixture(scope="module")
def lasting(tmp_path_factory):
    """A scheduler for the tests that leave it as it was, first without a worker, then with one."""
    with _started(tmp_path_factory.mktemp("scheduler")) as started:
        yield started


@contextmanager
def _started(folder, *options):
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *options]
    file, processes = folder / "scheduler.json", []

    def start(*arguments):
        paths = (str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", ""))  # of the work of these tests
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        processes.append(subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=env))

    start(*command, "--no-dashboard", "--scheduler-file", str(file))
    while not file.exists() or not file.read_text():  # it is written after it was made
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]

    def worker(*options):
        command = (sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard")
        start(*command, *options)

    try:
        yield address, worker, processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_scheduler_without_workers_is_a_sentence(lasting, monkeypatch):
    monkeypatch.setattr(cluster, "ANSWER", 1.0)
    with pytest.raises(ParameterError, match="has no workers"):
        list(results(abs, range(9), Workers(scheduler=lasting[0])))


@pytest.fixture(scope="module")
def limited(lasting):
    """Address of a scheduler, and the process of its one worker, which may take 600 MB."""
    address, worker, processes = lasting
    worker("--memory-limit", "600MB")
    return address, processes[-1]


@pytest.mark.usefixtures("patient")
def test_the_workers_of_a_scheduler_do_the_same_work_once_each_and_raise_sentences_for_the_user(limited):
    address, _ = limited
    for place in (Workers(scheduler=address), Workers(2)):
        with pytest.raises(DataError, match="it is so"):
            list(results(own_error, [1], place))
    rows = results(abs, iter(range(1010)), Workers(scheduler=address))  # more than fit at the scheduler
    assert sorted((row.item, row.result) for row in rows) == [(n, n) for n in range(1010)]


@pytest.mark.usefixtures("patient")
def test_what_ends_its_process_on_a_scheduler_is_named_and_the_workers_of_dask_live_on(limited):
    address, worker = limited
    bad = [("SIGKILL", 100), ("slow", 102), ("memory", 103), ("error", 104)]
    finished = list(results(faulty, [*GOOD[:5], *bad, *GOOD[5:]], Workers(scheduler=address, seconds=5.0)))
    by_item = {work.item: work.result for work in finished}
    assert [by_item[item] for item in GOOD] == [n for _, n in GOOD]
    assert [by_item[item].status for item in bad] == ["killed", "timed_out", "killed", "failed"]
    assert "needs more than 0.6 GB of memory" in by_item["memory", 103].message, "that of the worker of Dask"
    left = psutil.Process(worker.pid).children(recursive=True)
    assert not [work for work in left if "clutchid.processes" in " ".join(work.cmdline())], "they rest when all is done"


def test_an_item_whose_worker_of_dask_is_lost_is_given_to_another_one(scheduler, tmp_path):
    address, worker, started = scheduler
    worker("--no-nanny")
    worker("--no-nanny")
    rows = results(time.sleep, [0.2] * 20, Workers(scheduler=address))
    next(rows)
    started[1].kill()
    assert [row.result for row in rows] == [None] * 19


def test_a_scheduler_that_is_lost_is_a_sentence_and_what_is_done_was_given(scheduler, capfd, monkeypatch):
    address, worker, started = scheduler
    worker()
    finished = []
    with pytest.raises(SolveError, match="the connection to the scheduler"):  # noqa: PT012
        for result in results(time.sleep, [0.05] * 200, Workers(scheduler=address)):
            finished.append(result)
            if len(finished) == 5:
                monkeypatch.setattr(cluster, "ANSWER", 2.0)
                started[0].kill()
    assert 5 <= len(finished) < 200
    assert "distributed" not in capfd.readouterr().err, "Dask's own words are not shown"


def test_local_workers_open_no_port_and_need_no_dask():
    code = (
        "import sys, psutil; from clutchid.fleets.cluster import Workers, results\n"
        "found = results(abs, iter([-1, -2]), Workers(2)); next(found); this = psutil.Process()\n"
        "for one in (this, *this.children(recursive=True)): print(one.net_connections())\n"
        "assert 'distributed' not in sys.modules"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(process.stdout.split()) == {"[]"}, "a process and its workers"
    assert len(process.stdout.split()) >= 2


def test_a_scheduler_with_certificates_does_the_work_of_who_has_one(tmp_path, patient):
    secure = Security.temporary()
    texts = {"ca": secure.tls_ca_file, "cert": secure.tls_client_cert, "key": secure.tls_client_key}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    ca, cert, key = (str(tmp_path / name) for name in texts)
    tls = ("--tls-ca-file", ca, "--tls-cert", cert, "--tls-key", key)
    with _started(tmp_path, *tls, "--protocol", "tls") as (address, worker, _):
        worker(*tls)
        with pytest.raises(ParameterError, match="a connection by TLS needs certificates; name their files in Dask's"):
            list(results(abs, range(9), Workers(scheduler=address)))
        files = {"ca-file": ca, "client": {"cert": cert, "key": key}}
        with dask.config.set({f"distributed.comm.tls.{name}": file for name, file in files.items()}):
            rows = results(abs, range(9), Workers(scheduler=address))
            assert sorted(row.result for row in rows) == list(range(9))
        with pytest.raises((OSError, TimeoutError)):
            asyncio.run(answered(address, Security.temporary(), 1.0))
