"""Every command on another system: what Windows and macOS lack is taken away, and processes are started as there.

`fixtures/another_system/sitecustomize.py` says what is taken away. It is no Windows: what that does otherwise than it
says is not seen here.
"""

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import polars as pl
import pytest

from clutchid import systems
from clutchid.systems import Incoming, Outgoing, command_line, ending, interpreter, processors
from fixtures.commands import keep_machine_code, wait_for

OTHER = Path(__file__).parent / "fixtures" / "another_system"

#: Commands in their order, in one process; each has what the ones before it wrote.
COMMANDS = {
    "drive": "drive --out new.csv --seconds 3 --seed 1",
    "drive worn": "drive --out recordings/worn.csv --seconds 3 --seed 2 --wear 1",
    "help": "calibrate --help",
    "look": "look recordings/worn.csv --save map.toml",
    "paper": "paper --fit new.csv --verify recordings/worn.csv --out paper",
    "calibrate": "calibrate new.csv --save cal.toml",
    "estimate": "estimate recordings/worn.csv --start cal.toml --save fit.toml",
    "observe": "observe recordings/worn.csv --start cal.toml --out file.csv --save state.toml",
    "track": "track recordings/worn.csv --start cal.toml --out wear.parquet",
    "fit": "fit new.csv --save paper.toml",
    "export": "export paper.toml --method paper --to c,dbc --out export",
}

#: Files that the commands write.
WRITTEN = ("new.csv", "map.toml", "paper/index.html", "cal.toml", "fit.toml", "file.csv", "state.toml",
           "wear.parquet", "export/PARITY.md")  # fmt: skip


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Environment of a process on the other system."""
    paths = [str(OTHER), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONIOENCODING": "cp1252",
            "PYTHONDONTWRITEBYTECODE": "1"}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory, environment):
    """A folder in which all commands were called, with their exit codes in codes.json and what they printed."""
    made = tmp_path_factory.mktemp("Prüfung 7 of another system")
    (made / "recordings").mkdir()
    calls = [[name, *text.split()] for name, text in COMMANDS.items()]
    subprocess.run([sys.executable, OTHER / "verbs.py", json.dumps(calls)], cwd=made, env=environment, check=True)
    return made


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_does_what_it_does_elsewhere(folder, name):
    said, errors = ((folder / f"{name}.{stream}").read_bytes().decode("cp1252") for stream in ("out", "err"))
    assert (json.loads((folder / "codes.json").read_text())[name], "Traceback" in errors) == (0, False), said + errors
    assert said.endswith("\r\n")


@pytest.mark.slow
def test_files_are_whole_and_the_same_on_every_system(folder):
    for name in WRITTEN:
        content = (folder / name).read_bytes()
        assert content, name
        assert b"\r" not in content or name.endswith("parquet"), name
        content.decode() if not name.endswith("parquet") else pl.read_parquet(folder / name)
    assert not [path.name for path in folder.rglob(".clutchid*")]


@pytest.mark.slow
def test_samples_of_a_pipe_are_observed_as_those_of_a_file(folder, environment):
    command = ["observe", "-", "--start", "cal.toml", "--out", "pipe.csv", "--publish", "-"]
    with (
        (folder / "recordings" / "worn.csv").open("rb") as file,
        subprocess.Popen(["cat"], stdin=file, stdout=-1) as cat,
    ):
        process = subprocess.run([sys.executable, "-m", "clutchid", *command], stdin=cat.stdout, cwd=folder,
                              env=environment, capture_output=True, check=False)  # fmt: skip
    assert process.returncode == 0, process.stderr
    samples = [json.loads(line) for line in process.stdout.splitlines() if b'"time [s]"' in line]
    assert len([sample for sample in samples if "position [m]" in sample]) == 3000
    assert (folder / "pipe.csv").read_bytes() == (folder / "file.csv").read_bytes()


@pytest.mark.slow
def test_a_fleet_has_two_workers(folder, environment):
    worn = (folder / "recordings" / "worn.csv").read_bytes()
    (folder / "recordings" / "again.csv").write_bytes(worn)
    command = ["fleet", "recordings", "--start", "cal.toml", "--out", "fleet", "--workers", "2", "--verb", "observe"]
    process = subprocess.run([sys.executable, "-m", "clutchid", *command], cwd=folder, env=environment,
                          capture_output=True, check=False)  # fmt: skip
    assert process.returncode == 0, process.stderr
    assert set(pl.read_parquet(folder / "fleet" / "results.parquet")["status"]) <= {"ok", "warning"}


@pytest.mark.slow
def test_the_page_reads_a_file_in_a_process_of_its_own_and_leaves_nothing(folder, environment, tmp_path):
    command = [sys.executable, "-m", "clutchid", "app", "--no-browser", "recordings/worn.csv"]
    keep_machine_code(tmp_path)
    own = {**environment, "CLUTCHID_CACHE": str(tmp_path)}
    with subprocess.Popen(command, cwd=folder, env=own, stdout=-1, stderr=-1) as server:
        try:
            address = server.stdout.readline().decode().strip()
            asked = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            assert b"<html" in asked.open(address, timeout=30).read()
            events = asked.open(address.partition("/?")[0] + "/api/events", timeout=60)
            contents = (json.loads(line[5:])["content"] for line in events if line.startswith(b"data:"))
            jobs = (job["status"] for job in contents if job and job.get("do"))
            assert next(status for status in jobs if status not in ("waiting", "running")) == "done"
            server.send_signal(signal.SIGINT)
            assert server.wait(20) == 0, server.stderr.read()
        finally:
            server.kill()
    wait_for(lambda: not [*(tmp_path / "app").glob("run-*")], 5.0)


#: What a process of the other system prints where all is well, by what is tried there.
TRIED = {
    "a file that a program has open is not replaced, and the sentence says so": """
        from clutchid.errors import ExportError
        from clutchid.files import write_text
        write_text("old", "a.txt")
        with open("a.txt", encoding="utf-8") as file:
            try:
                write_text("new", "a.txt")
            except ExportError as error:
                assert "cannot be written (another program, or this one, has it open; close it there)" in str(error)
                assert file.read() == "old"
                print("well")
        """,
    "a run that still goes on is left alone, and one that was killed is recovered": """
        import numpy as np, os, shutil
        from clutchid.log import Log
        from clutchid.measurements.spool import recovered, spooled
        log = Log(np.arange(100) * 1e-3, {"position": np.zeros(100)}, "run")
        os.mkdir("killed")
        with spooled("live.csv") as add:
            add(log, now=True)
            assert recovered("live.csv") == []
            (folder,) = [name for name in os.listdir(".") if name.startswith(".clutchid-live")]
            shutil.copytree(folder, f"killed/{folder}")
        assert [path.name for path in recovered("killed/live.csv")] == ["live.recovered.csv"]
        assert os.listdir("killed") == ["live.recovered.csv"]
        print("well")
        """,
    "a worker ends with the process that started it, and its limits hold": """
        from clutchid.processes import Limits, Pool
        import os, time
        pool = Pool(Limits(seconds=1.0))
        assert pool.do(os.path.basename, "a/b").result == "b"
        assert pool.do(time.sleep, 30.0).result.status == "timed_out"
        pool.end()
        print("well")
        """,
    "a session is ended with all that it started": """
        import psutil, subprocess, sys, time
        from clutchid.systems import DETACHED, kill_session
        text = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'input()'], stdin=-1).wait()"
        parent = subprocess.Popen([sys.executable, "-c", text], **DETACHED)
        while not (children := psutil.Process(parent.pid).children()):
            time.sleep(0.05)
        kill_session(parent.pid)
        parent.wait(5.0)
        assert not psutil.wait_procs(children, timeout=5.0)[1]
        print("well")
        """,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIED)
def test_on_the_other_system(name, environment, tmp_path):
    text = re.sub(r"^        ", "", TRIED[name], flags=re.MULTILINE)
    process = subprocess.run(
        [sys.executable, "-c", text], cwd=tmp_path, env=environment, capture_output=True, check=False
    )
    assert (process.stdout.strip(), process.returncode) == (b"well", 0), process.stderr.decode()


def test_arguments_are_a_line_for_the_terminal_of_the_system(monkeypatch):
    words = ["clutchid", "look", r"C:\data\run 7.csv", "load,P_S", "it's", r"D:\a.csv"]
    assert command_line(words) == r"clutchid look 'C:\data\run 7.csv' load,P_S 'it'" + '"\'"' + r"'s' 'D:\a.csv'"
    monkeypatch.setattr(sys, "platform", "win32")
    assert command_line(words) == r"""clutchid look "C:\data\run 7.csv" "load,P_S" "it's" D:\a.csv"""


def test_python_of_a_process_is_not_the_launcher_of_a_virtual_environment(monkeypatch):
    assert interpreter() == (sys.executable, {})
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(sys, "_base_executable", "base")
    assert interpreter() == ("base", {"__PYVENV_LAUNCHER__": sys.executable})


def test_processors_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {3}, raising=False)
    assert processors() == 1
    monkeypatch.delattr("os.sched_getaffinity")
    monkeypatch.setattr("os.cpu_count", lambda: None)
    assert processors() == 1


@pytest.mark.parametrize(("code", "words"), [(0, "exit code 0"), (-11, "SIGSEGV"), (-99, "signal 99")])
def test_an_end_in_words(code, words):
    assert ending(code) == words


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits what a process allocates")
@pytest.mark.parametrize(("hard", "limit"), [(-1, 100), (50, 50), (200, 100)])
def test_no_more_is_allocated_than_the_system_allows(monkeypatch, hard, limit):
    limits = []
    monkeypatch.setattr("resource.getrlimit", lambda _: (-1, hard))
    monkeypatch.setattr("resource.setrlimit", lambda _, both: limits.append(both))
    systems.limit_allocations(100)
    assert limits == [(limit, hard)]


def test_what_was_read_of_a_pipe_counts_when_reading_ends():
    reading, writing = os.pipe()
    with Incoming(reading) as feed:
        assert feed.next(0.0) is None
        os.write(writing, b"one")
        assert feed.next(5.0) == b"one"
        os.write(writing, b"two")
        wait_for(lambda: feed._parts.qsize() == 1)
        feed.close()
        os.close(writing)
        assert feed.next(5.0) == b"two"
    os.close(reading)


def test_a_writer_waits_for_no_reader_and_says_what_it_has_not_taken():
    reading, writing = os.pipe()
    with Outgoing(writing) as out:
        out.send(bytes(1 << 20))
        wait_for(lambda: not out.wait(0.1))
        left = out.left
        assert 0 < left < 1 << 20
        os.close(reading)
        with pytest.raises(BrokenPipeError):
            wait_for(lambda: out.left < left)
    os.close(writing)


def test_a_substitute_takes_room_on_the_disk(tmp_path, monkeypatch):
    monkeypatch.delattr("os.posix_fallocate", raising=False)
    with (tmp_path / "free").open("wb") as file:
        systems.reserve(file, 4096)
        systems.reserve(file, 9000)
    assert (tmp_path / "free").stat().st_size == 9000
