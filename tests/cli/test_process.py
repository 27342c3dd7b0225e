"""The command as a process: signals, full disks and odd paths end in one sentence, and nothing is left behind."""

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time

import psutil
import pytest

from clutchid.errors import ExportError
from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.files import check_writable
from clutchid.verbs.saving import check_outputs
from fixtures.commands import called, process, wait_for

pytestmark = pytest.mark.slow

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals, links or devices")
COMMAND = [sys.executable, "-m", "clutchid"]


def ended(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


@posix
def test_the_workers_of_a_command_end_with_it(tmp_path):
    command = subprocess.Popen(
        [*COMMAND, "drive", "--fleet", "4", "--out", tmp_path / "out", "--workers", "2"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wait_for(lambda: len(psutil.Process(command.pid).children(recursive=True)) >= 2)
    time.sleep(2.0)  # they load the package
    workers = psutil.Process(command.pid).children(recursive=True)
    command.terminate()
    command.wait(timeout=60)
    wait_for(lambda: all(ended(worker.pid) for worker in workers), 10.0)


@posix
def test_an_interrupt_while_the_command_loads_or_ends_is_quiet():
    started = "from clutchid.__main__ import main; print(flush=True); main()"
    for delay in (0.1, 0.3, 0.6):
        process = subprocess.Popen([sys.executable, "-c", started, "fit", "no.csv"],
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
        assert process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert "Traceback" not in said, delay
        assert process.returncode in (-signal.SIGINT, 130, 2), delay


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_an_interrupt_before_the_command_begins_is_one_sentence(options, monkeypatch, capsys):
    def interrupted(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr("cyclopts.App.__call__", interrupted)
    assert called("look", "no.csv", *options) == 130
    shown = capsys.readouterr()
    assert (json.loads(shown.out)["message"] if options else shown.err.strip()).endswith("stopped.")


@pytest.mark.parametrize("options", [[], ["--json"]])
@pytest.mark.parametrize(
    ("command", "interrupted", "sentence"),
    [
        (["fleet", "F", "--start", "C", "--out", "R"], "clutchid.fleets.verbs.fleet",
         "stopped: the results so far are kept in R; run the same command again to continue."),
        (["drive", "--fleet", "3", "--out", "R"], "clutchid.verbs.virtual_fleet.write_fleet",
         "stopped: R has only a part of the fleet, and no tables; delete it and run the same command again."),
        (["drive", "--out", "r.csv"], "clutchid.truck.drive",
         "stopped: no incomplete file was left behind; run the same command again to start from the beginning."),
        (["track", "r.csv", "--start", "C.toml", "--out", "w.parquet"], "clutchid.verbs.tracking.track",
         "stopped: no incomplete file was left behind; run the same command again to start from the beginning."),
        (["look", "r.csv"], "clutchid.verbs.looking.looked",
         "stopped: no incomplete file was left behind; run the same command again to start from the beginning."),
    ],
)  # fmt: skip
def test_an_interrupted_command_says_what_is_kept(command, interrupted, sentence, options, monkeypatch, capsys):
    def stop(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(interrupted, stop)
    assert called(*command, *options) == 130
    shown = capsys.readouterr()
    assert (json.loads(shown.out)["message"] if options else shown.err.strip().removeprefix("clutchid: ")) == sentence


ADDRESSES = ["s3://bucket/run.csv", "https://host/run.csv", r"\\server\share\run.csv", "ftp://host/run.csv"]

#: Commands that read or write at @.
READING = [
    "fit r.csv --start @", "look r.csv --map @", "fleet @ --start C.toml --out R", "fleet . --start @ --out R",
    "fleet . --start C.toml --out @", "track @ --start C.toml --out w.parquet", "drive --out @", "paper --out @",
    "track r.csv --start C.toml --table @ --out w.parquet", "drive --fleet 1 --out @",
    "app --folder @", "app @",
]  # fmt: skip


@posix
@pytest.mark.parametrize(
    ("command", "address"),
    [*(("look @", at) for at in ADDRESSES), *((line, ADDRESSES[-("fleet" in line)]) for line in READING)],
)
def test_an_address_is_refused_with_what_to_do(command, address, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text("time [s],position [m],duty_supply [1],duty_exhaust [1]\n0,0,0,0\n1,0,0,0\n")
    (tmp_path / "C.toml").write_text("[parameters]\n")
    assert called(*command.replace("@", address).split()) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "is a network address, and clutchid opens only files and folders of this machine: copy or mount the data"
    ) in said
    assert {path.name for path in tmp_path.iterdir()} == {"r.csv", "C.toml"}


def gone_terminal():
    """A terminal that has hung up."""
    master, terminal = os.openpty()
    os.close(master)
    return terminal


def full_disk():
    return os.open("/dev/full", os.O_WRONLY)


def closed_pipe():
    reader, writer = os.pipe()
    os.close(reader)
    return writer


@posix
@pytest.mark.parametrize(
    ("command", "output", "sentence"),
    [
        ("drive --help", full_disk, ["clutchid: standard output cannot be written (No space left on device)."]),
        ("look log.csv", gone_terminal, ["clutchid: standard output cannot be written (Input/output error)."]),
        ("drive --help", closed_pipe, []),
        ("look log.csv", closed_pipe, []),
    ],
)
def test_a_standard_output_that_is_lost_is_at_most_one_sentence(tmp_path, command, output, sentence):
    (tmp_path / "log.csv").write_text("time [s],position [m]\n0,0\n1,0\n")
    descriptor = output()
    streams = {"stdout": descriptor, "stderr": subprocess.PIPE, "capture_output": False}
    ended = process(*command.split(), cwd=tmp_path, **streams)
    os.close(descriptor)
    assert ended.returncode == 1
    assert ended.stderr.splitlines() == sentence


#: The command, which says on standard error that it is about to print.
ABOUT_TO_PRINT = """
import builtins, sys
from clutchid.__main__ import main
write = builtins.print
builtins.print = lambda *lines, **options: (write("prints", file=sys.stderr, flush=True), write(*lines, **options))
main()
"""


@posix
def test_one_signal_ends_a_command_that_waits_for_a_reader_that_has_stalled(tmp_path):
    (tmp_path / "log.csv").write_text("time [s],position [m]\n0,0\n1,0\n")
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    command = [sys.executable, "-c", ABOUT_TO_PRINT, "look", tmp_path / "log.csv"]
    waiting = [subprocess.Popen(command, stdout=writer, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    for look, number in zip(waiting, (signal.SIGINT, signal.SIGTERM), strict=True):
        assert look.stderr.readline() == "prints\n"
        time.sleep(0.3)  # from there to the pipe
        look.send_signal(number)
        _, said = look.communicate(timeout=20)
        assert look.returncode == 130, number
        assert "clutchid: stopped: no incomplete file was left behind;" in said
    os.close(reader)
    os.close(writer)


@posix
def test_an_output_that_no_file_can_be_is_refused(tmp_path):
    first, other = tmp_path / "one.toml", tmp_path / "other.toml"
    first.symlink_to(other)
    other.symlink_to(first)
    loop = r"one\.toml: cannot be written \(.*(loop|links)"
    with pytest.raises(ExportError, match=loop):
        check_writable(first)
    with pytest.raises(ExportError, match=loop):
        check_outputs({"--out": first}, [("the recording", tmp_path / "log.csv")])
    with pytest.raises(ExportError, match=r"cannot be written \(File name too long\); name another file"):
        check_writable(tmp_path / ("a" * 300))


@posix
@pytest.mark.parametrize("closed", ["0<&-", "0<&- 1>&- 2>&-"])
def test_closed_standard_streams_are_a_sentence_and_no_file_takes_their_number(closed, plant, tmp_path):
    write_parameters(ParameterFile(plant), tmp_path / "cal.toml")
    inner = f"{shlex.join(COMMAND)} observe - --start cal.toml --out est.parquet {closed}"
    sent = "time [s],position [m],duty_supply [1],duty_exhaust [1]\n"
    process = subprocess.run(["sh", "-c", inner], input=sent, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert process.returncode == 2
    assert process.stdout == ""
    assert process.stderr.startswith("clutchid: standard input: is closed;" if closed == "0<&-" else "")
    assert "Traceback" not in process.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["cal.toml"]


def test_an_interrupt_that_python_ignores_comes_again():
    script = """
import sys, time
from clutchid.__main__ import keeping_interrupts
sys.unraisablehook = keeping_interrupts(sys.unraisablehook)
class Page:
    def __del__(self):
        raise KeyboardInterrupt
page = Page()
try:
    del page
    time.sleep(20)
except KeyboardInterrupt:
    print("stopped")
"""
    process = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (process.stdout, process.stderr) == ("stopped\n", "")
