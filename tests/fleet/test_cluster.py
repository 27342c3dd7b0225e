"""Workers that are killed, run out of memory or of time: nothing is lost or done twice, and the culprit is named."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from distributed.security import Security

from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.fleet.alone import Limits, Lost, alone
from clutchid.fleet.cluster import Place, cluster, results, shared
from clutchid.fleet.scheduler import Tls, answered, security_of
from fixtures.fleet_faults import faulty, once_killed

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

GOOD = [("good", n) for n in range(30)]


def test_what_ends_its_worker_is_named_and_all_else_is_done_once():
    bad = [("SIGKILL", 100), ("SIGSEGV", 101), ("slow", 102), ("memory", 103), ("error", 104)]
    items = [*GOOD[:15], *bad, *GOOD[15:]]
    with cluster(Place(2, memory=600_000_000, seconds=5.0)) as on:
        done = list(results(on, faulty, items))
    assert sorted(one.item for one in done) == sorted(items)
    found = {one.item: one.result for one in done}
    assert [found[item] for item in GOOD] == [n for _, n in GOOD]
    lost = {kind: found[kind, n] for kind, n in bad}
    assert {kind: one.status for kind, one in lost.items()} == {
        "SIGKILL": "killed", "SIGSEGV": "killed", "slow": "timed_out", "memory": "killed", "error": "failed",
    }  # fmt: skip
    assert "SIGSEGV" in lost["SIGSEGV"].message
    assert "took longer than 5 s" in lost["slow"].message
    assert "more than 0.6 GB" in lost["memory"].message
    assert "RuntimeError: no" in lost["error"].message


def test_an_item_whose_worker_was_taken_away_is_done_again(tmp_path):
    items = [(tmp_path / str(n), n) for n in range(3)]
    with cluster(Place(1)) as on:
        assert sorted(one.result for one in results(on, once_killed, items)) == [0, 1, 2]


def test_more_items_than_fit_at_the_scheduler_come_back_once_each():
    with cluster(Place(1)) as on:
        done = [one.result for one in results(on, abs, iter(range(1500)))]
    assert sorted(done) == list(range(1500))


def test_work_alone_ends_with_its_result_or_how_it_was_lost():
    assert alone(faulty, ("good", 7), Limits()) == 7
    assert isinstance(alone(faulty, ("SIGKILL", 0), Limits()), Lost)
    assert alone(faulty, ("slow", 0), Limits(seconds=0.3)).status == "timed_out"


def test_a_scheduler_that_does_not_answer_is_a_sentence_within_10_s():
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes connections, and says nothing
        for address in ("tcp://127.0.0.1:9", "nowhere at all", f"tcp://127.0.0.1:{silent.getsockname()[1]}"):
            begin = time.monotonic()
            with (
                pytest.raises(ParameterError, match=f"--scheduler {address}: does not answer"),
                cluster(Place(scheduler=address)),
            ):
                pass
            assert time.monotonic() - begin < 10.0


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler in a process of its own; gives its address, and starts a worker for it."""
    with _started(tmp_path) as started:
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
    while not file.exists():
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]

    def worker(*options):
        command = (sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard")
        start(*command, *options)

    try:
        yield address, worker, processes[0]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_the_workers_of_a_scheduler_do_the_same_work(scheduler):
    address, worker, _ = scheduler
    with pytest.raises(ParameterError, match="has no workers"), cluster(Place(scheduler=address)):
        pass
    worker()
    with cluster(Place(scheduler=address)) as on:
        assert sorted(one.result for one in results(on, abs, range(50))) == list(range(50))
    assert sorted(shared(abs, range(9), Place(scheduler=address))) == [(n, n) for n in range(9)]
    assert sorted(shared(abs, range(9), Place(2))) == [(n, n) for n in range(9)]


def test_a_scheduler_that_is_lost_is_a_sentence_and_what_is_done_was_given(scheduler, capfd):
    address, worker, process = scheduler
    worker()
    done = []

    def go_on(on):
        for one in results(on, time.sleep, [0.05] * 200):
            done.append(one)
            if len(done) == 5:
                process.kill()

    with cluster(Place(scheduler=address)) as on, pytest.raises(SolveError, match="the connection to the scheduler"):
        go_on(on)
    assert 5 <= len(done) < 200
    assert "distributed" not in capfd.readouterr().err, "Dask's own words are not shown"


def test_what_needs_more_memory_than_the_workers_of_a_scheduler_have_is_named(scheduler):
    address, worker, _ = scheduler
    worker("--memory-limit", "600MB")
    with cluster(Place(scheduler=address)) as on:
        found = {one.item: one.result for one in results(on, faulty, [("memory", 1), *GOOD[:5]])}
    assert "needs more than 0.6 GB of memory" in found["memory", 1].message
    assert [found[item] for item in GOOD[:5]] == [n for _, n in GOOD[:5]]


def test_local_workers_listen_to_this_machine_only():
    with cluster(Place(1)) as on:
        assert [one.result for one in results(on, abs, [-1])] == [1]
        this = psutil.Process()
        ports = [
            port.laddr
            for process in (this, *this.children(recursive=True))
            for port in process.net_connections("inet")
            if port.status == psutil.CONN_LISTEN
        ]
    assert len(ports) >= 3, "of the scheduler, of the worker and of its nanny"
    assert {port.ip for port in ports} == {"127.0.0.1"}


def test_who_has_no_certificate_of_this_run_cannot_reach_its_scheduler_or_its_workers():
    with cluster(Place(1)) as on:
        addresses = [on.client.scheduler.address, *on.client.scheduler_info()["workers"]]
        for address in addresses:
            assert address.startswith("tls://127.0.0.1:")
            for other, security in (
                (address, Security.temporary()), (address.replace("tls", "tcp"), Security()),
            ):  # fmt: skip
                with pytest.raises((OSError, TimeoutError)):
                    asyncio.run(answered(other, security, 1.0))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """An authority, a certificate of it, and its key."""
    made, folder = Security.temporary(), tmp_path_factory.mktemp("tls")
    files = Tls(folder / "ca.pem", folder / "cert.pem", folder / "key.pem")
    for path, text in zip(files, (made.tls_ca_file, made.tls_client_cert, made.tls_client_key), strict=True):
        path.write_text(text)
    return files


def test_a_scheduler_with_certificates_does_the_work_of_who_has_one(tmp_path, certificates):
    options = ("--tls-ca-file", "--tls-cert", "--tls-key")
    tls = [str(part) for pair in zip(options, certificates, strict=True) for part in pair]
    with _started(tmp_path, *tls, "--protocol", "tls") as (address, worker, _):
        worker(*tls)
        with cluster(Place(scheduler=address, tls=certificates)) as on:
            assert sorted(one.result for one in results(on, abs, range(9))) == list(range(9))
        with pytest.raises(ParameterError, match="needs certificates"), cluster(Place(scheduler=address)):
            pass


def test_certificates_that_do_not_fit_are_a_sentence(tmp_path, certificates):
    address, text = "tls://127.0.0.1:9", tmp_path / "text.pem"
    text.write_text("no certificate")
    for where, files, error, said in (
        (address, None, ParameterError, "a connection by TLS needs certificates; give --tls-ca, --tls-cert and"),
        ("tcp://127.0.0.1:9", certificates, ParameterError, "is not secured by TLS"),
        (address, certificates._replace(authority=text), ParameterError, "--tls-ca .*text.pem: is no certificate"),
        (address, certificates._replace(certificate=text), ParameterError, "are no certificate and its key"),
        (
            address,
            certificates._replace(key=certificates.certificate),
            ParameterError,
            "are no certificate and its key",
        ),
        (address, certificates._replace(key=tmp_path / "no.pem"), DataError, "no.pem: there is no such file"),
    ):
        with pytest.raises(error, match=said):
            security_of(where, files)
