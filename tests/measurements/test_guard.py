"""The guarded reader process: what happens to it never happens to clutchid, and is said in one sentence."""

import gzip
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np
import psutil
import pytest
from scipy.io import savemat

from clutchid.errors import DataError, ParameterError
from clutchid.measurements import opening as guard
from clutchid.measurements import read, read_pieces
from clutchid.measurements.formats.opening import opened_here
from clutchid.measurements.look import look
from clutchid.measurements.opening import open_source
from clutchid.processes import Worker
from fixtures.commands import wait_for

TEXT = "time [s],position [m],duty_supply [1],duty_exhaust [1]\n" + "".join(
    f"{i / 1000},{i}e-06,{i % 2},0\n" for i in range(3000)
)

needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals that stop a process")


@pytest.fixture
def packed(tmp_path):
    """A recording that only the reader process opens."""
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(TEXT.encode()))
    return path


@pytest.fixture
def vectors(tmp_path):
    """A MATLAB file of 3000 samples."""
    path = tmp_path / "run.mat"
    time = np.arange(3000) / 1000
    savemat(path, {"time": time, "position": 1e-3 * time, "duty_supply": time % 1, "duty_exhaust": 0 * time})
    return path


def stopped() -> Worker:
    """The reader process, which answers nothing any more."""
    process = guard.reader(Path("run")).worker
    os.kill(process.pid, signal.SIGSTOP)
    return process


def test_no_process_is_started_for_text(tmp_path, monkeypatch):
    monkeypatch.setattr(guard, "ReaderProcess", lambda: pytest.fail("a reader process was started"))
    plain = tmp_path / "run.csv"
    plain.write_text(TEXT)
    assert len(read(plain)) == 3000
    assert look(plain).rasters[0].samples == 3000


def test_one_process_serves_all_files(packed, vectors):
    read(packed)
    before = guard.reader(Path("run")).worker.pid
    look(vectors)
    read(packed)
    assert guard.reader(Path("run")).worker.pid == before


def test_blocks_are_those_of_the_reader_in_this_process(vectors):
    here, there = opened_here(vectors, []), open_source(vectors)
    assert there.rasters == here.rasters
    for rows in (None, 700, 3000):
        ours, theirs = list(here.tables(0, [0, 1], rows)), list(there.tables(0, [0, 1], rows))
        assert [table.size for table in ours] == [table.size for table in theirs]
        for table, other in zip(ours, theirs, strict=True):
            assert table.places == other.places or (table.places.numbers is other.places.numbers is None)
            for index in (0, 1):
                np.testing.assert_array_equal(table.numbers[index], other.numbers[index])


def test_two_files_are_read_side_by_side(packed, tmp_path):
    second = tmp_path / "second.csv.gz"
    second.write_bytes(gzip.compress(TEXT.replace("e-06", "e-05").encode()))
    pairs = zip(read_pieces(packed, rows=500), read_pieces(second, rows=500), strict=True)
    ratios = [(len(first), len(other), other["position"][-1] / first["position"][-1]) for first, other in pairs]
    assert ratios == [(500, 500, 10.0)] * 6


def test_a_process_that_has_grown_is_left_to_the_files_that_are_open_in_it(packed, vectors, monkeypatch):
    source = open_source(packed)
    before = guard.reader(packed).worker.pid
    megabytes = guard.reader(packed).worker.memory().allocated / 1e6
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", f"{3 * megabytes:.0f}MB")
    assert guard.reader(vectors).worker.pid == before
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", f"{1.5 * megabytes:.0f}MB")
    look(vectors)
    assert guard.reader(vectors).worker.pid != before
    assert sum(table.size for table in source.tables(0, [0], None)) == 3000


@needs_signals
def test_a_process_that_dies_on_a_file_is_one_sentence_and_the_next_file_is_read(packed):
    process = stopped()
    threading.Timer(0.2, os.kill, (process.pid, signal.SIGKILL)).start()
    with pytest.raises(DataError, match=r"run\.csv\.gz: the reader process crashed while reading it \(SIGKILL\)"):
        read(packed)
    assert len(read(packed)) == 3000


@needs_signals
def test_a_process_that_died_between_two_files_is_replaced_without_a_word(packed):
    before = guard.reader(Path("run")).worker
    os.kill(before.pid, signal.SIGKILL)
    while before.alive:
        pass
    assert len(read(packed)) == 3000


@needs_signals
def test_a_file_that_takes_too_long_is_given_up(packed, monkeypatch):
    monkeypatch.setenv("CLUTCHID_READER_SECONDS", "0.3")
    stopped()
    with pytest.raises(DataError, match=r"run\.csv\.gz: was not read within 0 s"):
        look(packed)
    monkeypatch.delenv("CLUTCHID_READER_SECONDS")
    assert len(read(packed)) == 3000


def test_a_file_that_takes_too_much_memory_is_given_up(packed, monkeypatch):
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "1MB")
    with pytest.raises(DataError, match=r"run\.csv\.gz: needs more than 0\.001 GB"):
        read(packed)


def test_limits_that_make_no_sense_are_refused(packed, monkeypatch):
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "much")
    with pytest.raises(ParameterError, match="a size in MB or GB is needed"):
        read(packed)
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "4 GB")
    monkeypatch.setenv("CLUTCHID_READER_SECONDS", "long")
    with pytest.raises(ParameterError, match="a time in s is needed"):
        read(packed)


def test_an_interrupt_ends_the_process_so_that_no_answer_is_taken_for_another(packed, vectors, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(queue.Queue, "get", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            read(packed)
    assert look(vectors).rasters[0].samples == 3000


def test_what_a_reading_left_on_the_disk_goes_with_the_process(packed, tmp_path, monkeypatch):
    guard.reader(packed).worker.end()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    read(packed)
    folder, *others = Path(tempfile.gettempdir()).glob("clutchid-*")
    assert not others
    guard.reader(Path("run")).worker.end()
    assert not folder.exists()


def test_a_recording_is_forgotten_when_nothing_needs_it(packed):
    source = open_source(packed)
    process = guard.reader(Path("run"))
    waiting = len(process.forgotten)
    del source
    assert len(process.forgotten) == waiting + 1


BAD = b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n0,x,0,0\n1,1e-3,0,0\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (gzip.compress(TEXT.encode())[:-200], "is not a complete gzip file .* copy it again"),
        (gzip.compress(BAD), ".*position"),
        (gzip.compress(gzip.compress(TEXT.encode())), "is packed twice"),
    ],
    ids=["cut off", "no number", "packed twice"],
)
def test_a_packed_file_that_cannot_be_read_is_named_in_one_sentence(packed, content, words):
    packed.write_bytes(content)
    with pytest.raises(DataError, match=rf"run\.csv\.gz: {words}"):
        read(packed)


@pytest.mark.slow
def test_a_matlab_file_that_unpacks_to_gigabytes_is_not_read_as_a_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "500MB")
    path = tmp_path / "zeros.mat"
    zeros = np.zeros(7_000_000)
    savemat(path, {"time": zeros, "position": zeros, "duty_supply": zeros, "duty_exhaust": zeros}, do_compression=True)
    with pytest.raises(DataError, match=r"zeros\.mat: its 7,000,000 samples of 4 channels take 0\.224 GB"):
        read(path)


def test_where_no_process_can_be_started_the_file_is_named(packed, tmp_path, monkeypatch):
    guard.reader(packed).worker.end()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    with pytest.raises(DataError, match=r"run\.csv\.gz: the process that reads it could not be started \(No such file"):
        read(packed)


@needs_signals
def test_the_process_does_not_outlive_clutchid(packed):
    script = (
        "import os, signal, sys; from clutchid.measurements import read;"
        "from clutchid.measurements.opening import reader;"
        "read(sys.argv[1]); print(reader(sys.argv[1]).worker.pid, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    process = subprocess.run([sys.executable, "-c", script, str(packed)], capture_output=True, text=True, check=False)
    pid = int(process.stdout)
    wait_for(lambda: not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE, 10.0)
