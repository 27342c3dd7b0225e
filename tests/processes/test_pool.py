"""Worker processes: an item that ends its process is the only one lost, and every one ends with who waits for it."""

import os
import platform
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.processes import Limits, LostWork, Pool, check_workers, results
from fixtures.fleet_faults import faulty, once_killed, own_error, taken_memory

pytestmark = pytest.mark.slow

GOOD = [("good", n) for n in range(30)]

#: Of OpenBLAS, OpenMP (and `clutchid.numerics.threads`), MKL and polars.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")


def children():
    """Processes of this one; the reader of other tests may be among them."""
    return {child.pid for child in psutil.Process().children()}


def test_what_ends_its_worker_is_named_and_all_else_is_done_once():
    bad = [("SIGKILL", 100), ("SIGSEGV", 101), ("slow", 102), ("memory", 103), ("error", 104)]
    items = [*GOOD[:15], *bad, *GOOD[15:]]
    finished = list(results(faulty, iter(items), 2, Limits(5.0, 600_000_000)))
    assert sorted(work.item for work in finished) == sorted(items)
    by_item = {work.item: work.result for work in finished}
    assert [by_item[item] for item in GOOD] == [n for _, n in GOOD]
    assert {kind: by_item[kind, n].status for kind, n in bad} == {
        "SIGKILL": "killed", "SIGSEGV": "killed", "slow": "timed_out", "memory": "killed", "error": "failed",
    }  # fmt: skip
    said = {kind: by_item[kind, n].message for kind, n in bad}
    assert "(SIGKILL, as happens when memory runs out), twice" in said["SIGKILL"]
    assert "(SIGSEGV), twice" in said["SIGSEGV"]
    assert "took longer than 5 s" in said["slow"]
    (slow,) = (work.timing for work in finished if work.item == ("slow", 102))
    assert (slow.wall < 10.0, slow.attempt) == (True, 1), "it is not tried again"
    assert next(work.timing.attempt for work in finished if work.item == ("SIGKILL", 100)) == 2
    assert "more than 0.6 GB" in said["memory"]
    assert "RuntimeError: no" in said["error"]


def test_the_time_of_each_item_is_its_own():
    slow, quick = sorted(results(time.sleep, [0.5, 0.0], 1), key=lambda work: -work.item)
    assert 0.5 <= slow.timing.wall < 0.5 + quick.timing.wall + 5.0
    assert quick.timing.wall < 0.5
    assert slow.timing.processor < 0.2, "it has slept"
    assert (slow.timing.host, slow.timing.attempt) == (platform.node(), 1)
    assert slow.timing.worker not in (None, os.getpid())


def test_an_item_whose_worker_was_taken_away_is_done_again(tmp_path):
    items = [(tmp_path / str(n), n) for n in range(3)]
    assert sorted(result.result for result in results(once_killed, items, 1)) == [0, 1, 2]


def test_the_memory_that_other_work_has_left_behind_is_not_held_against_an_item():
    pool = Pool(Limits(memory=600_000_000))
    assert pool.do(taken_memory, 400_000_000).result == 400_000_000
    assert pool.do(taken_memory, 300_000_000).result == 300_000_000, "with both in one process it would be too much"
    pool.end()


def test_a_sentence_for_the_user_is_raised_and_ends_all_workers():
    before = children()
    with pytest.raises(DataError, match="it is so"):
        list(results(own_error, [1, 2, 3], 2))
    assert children() == before


def test_items_are_asked_for_as_workers_become_free():
    asked, before = [], children()

    def items():
        for n in range(100):
            asked.append(n)
            yield n

    some = results(abs, items(), 2)
    next(some)
    assert len(asked) <= 8
    some.close()
    assert children() == before, "what is at work when nobody waits any more is ended"


def test_a_worker_serves_one_item_after_the_other_and_rests_when_it_is_told():
    pool = Pool()
    first, second = pool.do(faulty, ("pid", 0)).result, pool.do(faulty, ("pid", 0)).result
    assert first == second
    pool.rest()
    assert not psutil.pid_exists(first)
    assert pool.do(faulty, ("pid", 0)).result != first
    pool.end()
    assert pool.do(abs, 1).result.status == "killed"


def test_where_no_worker_can_be_started_the_item_is_lost_with_the_reason(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    assert Pool().do(abs, -1).result == LostWork("killed", "no worker could be started (No such file or directory).")


def test_more_workers_than_the_machine_can_use_are_refused_before_any_starts(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    check_workers(32)
    for workers in (0, 33, 100_000):
        with pytest.raises(ParameterError, match=f"--workers {workers}: "):
            check_workers(workers)


def test_every_worker_has_one_thread():
    assert [result.result for result in results(os.getenv, THREADS, 1)] == ["1"] * len(THREADS)


def test_what_a_worker_leaves_on_the_disk_goes_with_it():
    pool = Pool()
    folder = Path(pool.do(os.getenv, "TMPDIR").result)
    assert folder.is_dir()
    pool.end()
    assert not folder.exists()


#: Programs of which each waits for work that takes a minute, and the number of processes that it has started at least.
WAITING = {
    "pool": ("from clutchid.processes import results; list(results(faulty, [('slow', n) for n in range(2)], 2))", 2),
    "compilation": ("from clutchid.fleets import plan; plan.compile_models = asleep; plan.compile_first(None, [])", 1),
    "reader": (  # somebody else keeps its questions open
        "import subprocess, time; from pathlib import Path; from clutchid.measurements.opening import reader\n"
        "questions = reader(Path('x')).worker._process.stdin\n"
        "questions.write(b''); subprocess.Popen(['sleep', '20'], stdout=questions); time.sleep(60)",
        2,
    ),
    "reader of a worker": ("from clutchid.processes import Pool; Pool().do(reader_started, None)", 2),
    "kernel": ("from clutchid.processes import Pool; Pool().do(held, None)", 1),
}


def started(code: str) -> subprocess.Popen:
    """A program with the work of these tests."""
    paths = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    code = f"from fixtures.fleet_faults import asleep, faulty, held, reader_started\n{code}"
    return subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": paths})


def at_work(member):
    """Whether a process is a worker; one that helped a program to start may have ended."""
    with suppress(psutil.NoSuchProcess):
        return member.name() != "sleep"
    return False


def test_every_worker_ends_with_the_process_that_waits_for_it():
    ways = (signal.SIGKILL, signal.SIGHUP)
    programs, children = {(name, how): started(WAITING[name][0]) for name in WAITING for how in ways}, {}
    try:
        for case, program in programs.items():
            end, children[case] = time.monotonic() + 60.0, []
            while len(children[case]) < WAITING[case[0]][1] and time.monotonic() < end:
                time.sleep(0.05)
                children[case] = psutil.Process(program.pid).children(recursive=True)
        time.sleep(1.5)  # they are at work
        workers = {case: [*filter(at_work, group)] for case, group in children.items()}
        for (_, how), program in programs.items():
            program.send_signal(how)
        for case, program in programs.items():
            assert program.wait(timeout=5.0) == -case[1], case
            assert workers[case], case
            assert not psutil.wait_procs(workers[case], timeout=5.0)[1], case
    finally:
        for program in programs.values():
            program.kill()
        for child in (child for started in children.values() for child in started):
            with suppress(psutil.NoSuchProcess):
                child.kill()
