"""Processes that share work without Dask: one thread each, and an item that ends its process is the only one lost."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

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


def test_an_error_of_the_work_is_raised():
    with pytest.raises(RuntimeError, match="no"):
        list(pool.results(faulty, [("error", 1)], workers=1))


def test_every_worker_has_one_thread():
    assert [value for _, value in pool.results(os.getenv, THREADS, workers=1)] == ["1"] * len(THREADS)
    with cluster(Place(1)) as on:
        assert [one.result for one in results(on, os.getenv, THREADS)] == ["1"] * len(THREADS)


def test_work_alone_ends_with_the_process_that_waits_for_it():
    code = (
        "from clutchid.fleet.alone import Limits, alone; from fixtures.fleet_faults import faulty; "
        "alone(faulty, ('slow', 0), Limits())"
    )
    folder = Path(__file__).parents[1]
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(folder)})
    try:
        end = time.monotonic() + 60.0
        while not (children := psutil.Process(process.pid).children()) and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(1.0)  # it is at work
        (child,) = children
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not psutil.wait_procs([child], timeout=10.0)[1]
    finally:
        process.kill()
