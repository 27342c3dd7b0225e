"""``clutchid app`` as a process: its address, what it refuses, and that it leaves nothing behind."""

import http.cookiejar
import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request

import psutil
import pytest

from fixtures.commands import called, wait_for


@pytest.fixture
def started(tmp_path):
    """Start the command; the process and the address that it prints."""
    running = []

    def start(*arguments):
        command = [sys.executable, "-m", "clutchid", "app", "--no-browser", *map(str, arguments)]
        environment = {**os.environ, "CLUTCHID_CACHE": str(tmp_path / "cache")}
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=tmp_path
        )
        running.append(process)
        return process, process.stdout.readline().strip()

    yield start
    for job in running:
        job.kill()
        job.communicate()


def opener(address):
    """Something that asks with the cookie of this address."""
    made = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar()))
    with made.open(address, timeout=20) as answer:
        assert answer.status == 200
    return made


def left(tmp_path):
    """Folders of servers."""
    return [*(tmp_path / "cache" / "app").glob("run-*")]


@pytest.mark.slow
def test_the_jobs_of_a_killed_server_end_and_the_next_one_removes_its_folder(started, tmp_path):
    server, address = started()
    opener(address)
    wait_for(lambda: psutil.Process(server.pid).children())
    children = psutil.Process(server.pid).children(recursive=True)
    server.kill()
    server.wait()
    wait_for(lambda: not any(child.is_running() and child.status() != psutil.STATUS_ZOMBIE for child in children), 10.0)
    (dead,) = left(tmp_path)
    started()
    assert dead not in left(tmp_path)


@pytest.mark.slow
def test_two_servers_stand_beside_each_other_print_their_addresses_and_leave_nothing(started, tmp_path):
    servers = [started(), started()]
    first, other = (address for _, address in servers)
    assert first.startswith("http://127.0.0.1:")
    assert first.partition("/?")[0] != other.partition("/?")[0]
    opener(first), opener(other)
    for refused in (other.partition("?")[0], other.partition("token=")[0] + "token=" + first.partition("token=")[2]):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            opener(refused)
    assert len(left(tmp_path)) == 2
    for server, address in servers:
        assert address.partition("token=")[2] not in " ".join(psutil.Process(server.pid).cmdline())
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 0
        assert server.stderr.read() == ""
    assert left(tmp_path) == []


@pytest.mark.slow
def test_a_file_of_the_command_line_is_opened_and_what_is_kept_is_named(started, tmp_path, recorded):
    server, address = started(recorded / "cal.csv", "--keep")
    asked = opener(address)
    events = asked.open(address.partition("/?")[0] + "/api/events", timeout=60)
    names = (json.loads(line[5:])["content"].get("name") for line in events if line.startswith(b"data:"))
    assert next(name for name in names if name) == "cal.csv"
    server.send_signal(signal.SIGINT)
    assert server.wait(20) == 0
    (folder,) = left(tmp_path)
    assert str(folder) in server.stdout.read()


def test_a_port_that_is_in_use_is_said(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert called("app", "--no-browser", "--port", port) == 2
    assert f"--port {port}: cannot be used" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(("arguments", "said"), [
    (["no.csv"], "no.csv: there is no such file"), (["--folder", "no"], "--folder no: there is no such folder"),
    (["--port", "99999"], "--port 99999: cannot be used"),
])  # fmt: skip
def test_what_is_not_there_is_said_before_the_server_starts(arguments, said, capsys):
    assert called("app", "--no-browser", *arguments) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_without_the_libraries_of_the_extra_it_is_said_how_to_install_them(capsys, monkeypatch):
    monkeypatch.setattr(sys.modules["clutchid.cli.app"], "find_spec", lambda _: None)  # `cli.app` is a function too
    assert called("app") == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "clutchid app needs Starlette, which is not installed; install it with:" in said


@pytest.mark.slow
def test_the_server_imports_neither_the_model_nor_matplotlib():
    heavy = "('sympy', 'numba', 'matplotlib', 'scipy')"
    code = f"import sys, clutchid.app.server; print([name for name in {heavy} if name in sys.modules])"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout.strip() == "[]"
