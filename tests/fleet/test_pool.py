"""Processes that share work without Dask: one thread each, and an item that ends its process is the only one lost."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from clutchid.errors import ParameterError
from clutchid.fleet import pool
from clutchid.fleet.alone import Lost
from clutchid.fleet.cluster import Place, cluster, results
from fixtures.fleet_faults import faulty

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

#: Of OpenBLAS, OpenMP (and `clutchid.numerics.threads`), MKL and polars.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")


def test_only_the_item_that_ends_its_process_is_lost():
    items = [*(("good", n) for n in range(12)), ("SIGKILL", 100), *(("good", n) for n in range(12, 24))]
    found = list(pool.results(faulty, items, workers=2))
    assert sorted(item for item, _ in found) == sorted(items)
    lost = {item: result for item, result in found if isinstance(result, Lost)}
    assert list(lost) == [("SIGKILL", 100)]
    assert "SIGKILL" in lost["SIGKILL", 100].message
    assert all(result == item[1] for item, result in found if item not in lost)


def test_more_workers_than_the_machine_can_use_are_refused_before_any_starts(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    pool.check_workers(32)
    for workers in (0, 33, 100_000):
        with pytest.raises(ParameterError, match=f"--workers {workers}: "):
            pool.check_workers(workers)


def test_an_error_of_the_work_is_raised():
    with pytest.raises(RuntimeError, match="no"):
        list(pool.results(faulty, [("error", 1)], workers=1))


def test_every_worker_has_one_thread():
    assert [value for _, value in pool.results(os.getenv, THREADS, workers=1)] == ["1"] * len(THREADS)
    with cluster(Place(1)) as on:
        assert [one.result for one in results(on, os.getenv, THREADS)] == ["1"] * len(THREADS)


#: Programs of which each waits for work that takes a minute, and the number of processes that it has started at least.
WAITING = {
    "alone": ("from clutchid.fleet.alone import Limits, alone; alone(faulty, ('slow', 0), Limits())", 1),
    "pool": ("from clutchid.fleet import pool; list(pool.results(faulty, [('slow', n) for n in range(2)], 2))", 3),
    "warming": ("from clutchid.fleet import warming; warming._compile = asleep; warming.warm([])", 2),
    "cluster": (
        "from clutchid.fleet.cluster import Place, cluster, results\n"
        "if __name__ == '__main__':\n with cluster(Place(1)) as on: list(results(on, faulty, [('slow', 0)]))",
        2,
    ),
    "reader": (  # somebody else keeps its questions open
        "import subprocess, time; from clutchid.io.guard.process import reader; questions = reader()._process.stdin\n"
        "questions.write(b''); subprocess.Popen(['sleep', '20'], stdout=questions); time.sleep(60)",
        2,
    ),
}


@pytest.mark.parametrize("name", WAITING)
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGHUP])
def test_every_worker_ends_with_the_process_that_waits_for_it(name, how):
    code, count = WAITING[name]
    paths = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    code = f"from fixtures.fleet_faults import asleep, faulty\n{code}"
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": paths})
    children = []
    try:
        end = time.monotonic() + 60.0
        while len(children) < count and time.monotonic() < end:
            time.sleep(0.05)
            children = psutil.Process(process.pid).children(recursive=True)
        time.sleep(1.5)  # they are at work
        workers = [child for child in children if child.name() != "sleep"]
        process.send_signal(how)
        process.wait()
        assert workers
        assert not psutil.wait_procs(workers, timeout=5.0)[1]
    finally:
        process.kill()
        for child in children:
            with suppress(psutil.NoSuchProcess):
                child.kill()
