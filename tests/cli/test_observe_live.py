"""``clutchid observe -``: live and file give the same numbers, and whatever comes, files are whole or not there."""

import fcntl
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import termios
import threading
import time
from itertools import pairwise
from pathlib import Path

import polars as pl
import pytest

from clutchid.cli import main
from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.observer.health import FLAGS, LIVE_FLAGS
from clutchid.recordings import write

OUTPUTS = ("est.parquet", "est.load.parquet", "state.toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, plant, recorded_by):
    """A calibration, a recording of a worn clutch as CSV and as JSON lines, and what is observed in the file."""
    made = tmp_path_factory.mktemp("live")
    write_parameters(ParameterFile(plant), made / "cal.toml")
    worn = plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names})
    write(recorded_by(worn, seconds=6.0, name="worn"), made / "worn.csv")
    frame = pl.read_csv(made / "worn.csv")
    (made / "worn.jsonl").write_text("".join(json.dumps(row) + "\n" for row in frame.iter_rows(named=True)))
    (made / "file").mkdir()
    outputs = ["--out", str(made / "file" / "est.parquet"), "--save", str(made / "file" / "state.toml")]
    with pytest.raises(SystemExit) as ended:
        main(["observe", str(made / "worn.csv"), "--start", str(made / "cal.toml"), *outputs])
    assert ended.value.code == 0
    return made


@pytest.fixture
def call(folder, tmp_path, monkeypatch, capsys):
    """Run the command in a folder of its own with some text on standard input; exit code, output and errors."""
    monkeypatch.chdir(tmp_path)

    def run(sent, *options, out="est.parquet", end=os.close):
        reading, writing = os.pipe()
        pieces = [sent] if isinstance(sent, bytes) else sent
        sender = threading.Thread(target=_send, args=(writing, pieces, end))
        with os.fdopen(reading) as stream:
            monkeypatch.setattr("sys.stdin", stream)
            sender.start()
            with pytest.raises(SystemExit) as ended:
                main(["observe", "-", "--start", str(folder / "cal.toml"), "--out", out, *options])
        sender.join()
        return ended.value.code, *capsys.readouterr()

    return run


def _send(writing, pieces, end):
    try:
        for piece in pieces:
            rest = piece
            while rest:
                rest = rest[os.write(writing, rest) :]
        end(writing)
    except BrokenPipeError:
        os.close(writing)


def drained(writing):
    """Wait until everything was read."""
    unread = bytearray(4)
    while True:
        fcntl.ioctl(writing, termios.FIONREAD, unread)
        if not any(unread):
            return
        time.sleep(0.01)


def stop(number):
    def end(writing):
        drained(writing)
        os.kill(os.getpid(), number)
        time.sleep(0.3)
        os.close(writing)

    return end


def same(folder, tmp_path, rows=None):
    for name in OUTPUTS[:2]:
        live, file = pl.read_parquet(tmp_path / name), pl.read_parquet(folder / "file" / name)
        if rows is not None:
            live, file = (frame.filter(pl.col("time [s]") < rows / 1000) for frame in (live, file))
        assert live.equals(file, null_equal=True), name
    if rows is None:
        assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()


def cut(text, sizes):
    edges = [0]
    while edges[-1] < len(text):
        edges.append(edges[-1] + sizes[len(edges) % len(sizes)])
    return [text[a:b] for a, b in pairwise(edges)]


@pytest.mark.parametrize("kind", ["csv", "jsonl"])
@pytest.mark.parametrize("sizes", [[10**7], [1, 7000, 3]])
def test_live_and_file_give_the_same_numbers_bit_for_bit(call, folder, tmp_path, kind, sizes):
    text = (folder / f"worn.{kind}").read_bytes()
    code, said, errors = call(cut(text, sizes), "--save", "state.toml")
    assert (code, errors) == (0, "")
    assert said.startswith("observed stdin: load at 12.5 mm ")
    assert "no flags" in said.splitlines()[0]
    same(folder, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_in_mid_line_leaves_whole_files_of_all_whole_lines(call, folder, tmp_path, number):
    text = b"".join((folder / "worn.csv").read_bytes().splitlines(keepends=True)[:4001])
    code, _, errors = call([text, b"4.000,0.0"], "--save", "state.toml", end=stop(number))
    assert (code, errors) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)
    assert pl.read_parquet(tmp_path / "est.parquet").height == 4000
    same(folder, tmp_path, rows=4000)
    assert signal.getsignal(number) is not None


def test_a_terminal_that_is_closed_sends_its_signal_twice_and_one_that_ignores_it_goes_on(call, folder, tmp_path):
    def twice(writing):
        drained(writing)
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGHUP)
        stop(signal.SIGHUP)(writing)

    text = (folder / "worn.csv").read_bytes()
    assert call(text, "--save", "state.toml", end=twice)[0] == 0
    same(folder, tmp_path)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert call([text[:100_000], text[100_000:]], end=stop(signal.SIGHUP))[0] == 0
    finally:
        signal.signal(signal.SIGHUP, before)
    same(folder, tmp_path, rows=5900)


@pytest.mark.parametrize("as_json", [False, True])
def test_a_folder_that_is_removed_costs_no_result(call, folder, tmp_path, as_json):
    (tmp_path / "out").mkdir()

    def remove(writing):
        while len([*(tmp_path / "out").glob(".*")]) < 2:  # the outputs are begun
            time.sleep(0.01)
        drained(writing)
        while (tmp_path / "out").exists():  # something may be written meanwhile
            shutil.rmtree(tmp_path / "out", ignore_errors=True)
        os.close(writing)

    text = (folder / "worn.csv").read_bytes()
    options = ["--save", "out/state.toml", *(["--json"] if as_json else [])]
    code, said, errors = call(text, *options, out="out/est.parquet", end=remove)
    assert code == 1
    places = dict(re.findall(r"warning: (\S+): cannot be written any more; it is in (\S+) instead", errors))
    assert set(places) == {"out/est.parquet", "out/est.load.parquet", "out/state.toml"}
    for name, place in places.items():
        file = folder / "file" / name.removeprefix("out/")
        if name.endswith("parquet"):
            assert pl.read_parquet(place).equals(pl.read_parquet(file), null_equal=True)
        else:
            assert Path(place).read_text() == file.read_text()
        assert place in said
        shutil.rmtree(Path(place).parent)
    assert json.loads(said)["status"] == "failed" if as_json else said.startswith("observed stdin: ")


def test_a_full_disk_costs_what_comes_later_and_the_right_file_is_named(call, folder, tmp_path, monkeypatch):
    monkeypatch.setattr("clutchid.recordings.spool.PIECE", 1 << 14)
    before, limit = resource.getrlimit(resource.RLIMIT_FSIZE), 400_000
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        code, said, errors = call((folder / "worn.csv").read_bytes(), "--save", "state.toml")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert code == 1
    assert said.startswith("observed stdin: ")
    words = "est.parquet: cannot be written any further (File too large). What came before is kept"
    assert words in " ".join(errors.split())
    live, file = pl.read_parquet(tmp_path / "est.parquet"), pl.read_parquet(folder / "file" / "est.parquet")
    assert 500 < live.height < 6000
    assert live.equals(file.head(live.height), null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)


@pytest.mark.slow
def test_a_run_that_is_killed_leaves_its_results_and_a_state_to_go_on_from(call, folder, tmp_path):
    script = "from clutchid.cli import main, observe_live; observe_live.MINUTE = 0.0; main()"
    options = ["--start", str(folder / "cal.toml"), "--out", "est.parquet", "--save", "state.toml"]
    head, *lines = (folder / "worn.csv").read_bytes().splitlines(keepends=True)
    command = [sys.executable, "-c", script, "observe", "-", *options]
    with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE) as killed:
        killed.stdin.write(head + b"".join(lines[:4000]))
        killed.stdin.flush()
        deadline = time.monotonic() + 60.0
        while not (tmp_path / "state.toml").exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(1.0)
        killed.kill()
    assert not (tmp_path / "est.parquet").exists()
    _, _, errors = call(b"", "--save", "state.toml")
    said = " ".join(errors.split())
    assert "an earlier run ended before it wrote est.parquet: what it had observed is in" in said
    assert "go on from it with --resume state.toml" in said
    kept = pl.read_parquet(tmp_path / "est.recovered.parquet")
    file = pl.read_parquet(folder / "file" / "est.parquet")
    assert kept.height == pytest.approx(3950, abs=1)  # the rest waits for samples that are late
    assert kept.equals(file.head(kept.height), null_equal=True)
    rest = head + b"".join(lines[kept.height :])
    assert call(rest, "--resume", "state.toml", "--save", "state.toml")[0] == 0
    assert pl.concat([kept, pl.read_parquet(tmp_path / "est.parquet")]).equals(file, null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()


def test_a_live_run_goes_on_from_a_state_and_gives_the_numbers_of_one_run(call, folder, tmp_path):
    head, *lines = (folder / "worn.csv").read_bytes().splitlines(keepends=True)
    assert call(head + b"".join(lines[:2345]), "--save", "state.toml", out="one.parquet")[0] == 0
    rest = head + b"".join(lines[2345:])
    assert call(rest, "--save", "state.toml", "--resume", "state.toml", out="est.parquet")[0] == 0
    for suffix in (".parquet", ".load.parquet"):
        both = [pl.read_parquet(tmp_path / f"{name}{suffix}") for name in ("one", "est")]
        assert pl.concat(both).equals(pl.read_parquet(folder / "file" / f"est{suffix}"), null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()
    kept = (tmp_path / "state.toml").read_text()
    code, _, errors = call(rest, "--save", "state.toml", "--resume", "state.toml", out="again.parquet")
    assert code == 2
    assert "time must go on" in " ".join(errors.split())
    assert (tmp_path / "state.toml").read_text() == kept
    assert not (tmp_path / "again.parquet").exists()


def test_what_a_killed_run_left_loses_what_comes_again_so_that_each_sample_is_there_once(
    call, folder, tmp_path, monkeypatch
):
    head, *lines = (folder / "worn.csv").read_bytes().splitlines(keepends=True)
    assert call(head + b"".join(lines[:2345]), "--save", "state.toml", out="one.parquet")[0] == 0
    file = {name: pl.read_parquet(folder / "file" / name) for name in OUTPUTS[:2]}
    for name, frame in file.items():  # samples after the state was saved, and before the run was killed
        frame.filter(pl.col("time [s]") < 3.0).write_parquet(tmp_path / f"left.{name}")
    monkeypatch.setattr("clutchid.recordings.spool.recovered", lambda path: [tmp_path / f"left.{path.name}"])
    rest = head + b"".join(lines[2345:])
    assert call(rest, "--save", "state.toml", "--resume", "state.toml")[0] == 0
    for name, frame in file.items():
        both = [pl.read_parquet(path) for path in (tmp_path / f"left.{name}", tmp_path / name) if path.exists()]
        assert pl.concat(both).equals(frame, null_equal=True), name


def test_a_file_that_grows_is_followed_on_from_a_state_and_another_one_is_refused(
    folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    head, *lines = (folder / "worn.csv").read_bytes().splitlines(keepends=True)

    def follow(text, out, *options):
        (tmp_path / "log.csv").write_bytes(text)
        over = threading.Event()

        def stop_it():
            while signal.getsignal(signal.SIGTERM) is signal.SIG_IGN and not over.wait(0.01):
                pass
            os.kill(os.getpid(), signal.SIGTERM)

        before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
        other = threading.Thread(target=stop_it)
        other.start()
        try:
            with pytest.raises(SystemExit) as ended:
                main(["observe", "log.csv", "--follow", "--start", str(folder / "cal.toml"), "--out", out,
                      "--save", "state.toml", *options])  # fmt: skip
        finally:
            over.set()
            other.join()
            signal.signal(signal.SIGTERM, before)
        return ended.value.code, " ".join(capsys.readouterr().err.split())

    assert follow(head + b"".join(lines[:2345]), "one.parquet") == (0, "")
    kept = (tmp_path / "state.toml").read_text()
    code, said = follow(head + b"".join(lines[:2345]), "two.parquet", "--resume", "state.toml")
    assert code == 2
    assert "log: has no sample behind 2.344 s, where state.toml is" in said
    shifted = head + b"".join(lines[i].split(b",")[0] + b"," + lines[i + 9].split(b",", 1)[1] for i in range(5000))
    code, said = follow(shifted.replace(b"2.340,", b"2.3401,"), "two.parquet", "--resume", "state.toml")
    assert code == 2
    assert "log: has other samples up to 2.344 s than the recording that state.toml comes from" in said
    assert not (tmp_path / "two.parquet").exists()
    assert (tmp_path / "state.toml").read_text() == kept
    assert follow(head + b"".join(lines), "est.parquet", "--resume", "state.toml") == (0, "")
    for suffix in (".parquet", ".load.parquet"):
        both = [pl.read_parquet(tmp_path / f"{name}{suffix}") for name in ("one", "est")]
        assert pl.concat(both).equals(pl.read_parquet(folder / "file" / f"est{suffix}"), null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()


def spoiled(lines, kind):
    """The lines of a recording with a fault, and the flag that it raises."""
    cells = [line.split(b",") for line in lines]
    head = cells[0].index
    place = {name: head(f"{name} [{unit}]".encode()) for name, unit in (("position", "m"), ("duty_supply", "1"))}
    if kind == "a missing position":
        cells[3000][place["position"]] = b"nan"
    if kind == "an infinite position":
        cells[3000][place["position"]] = b"inf"
    if kind == "a time far ahead":
        cells[3000][0] = cells[3000][0].replace(b".", b"")
    if kind == "a first time far ahead":
        cells[1][0] = b"1e9"
    if kind == "a duty cycle above 1":
        cells[3000][place["duty_supply"]] = b"1.5"
    lines = [b",".join(row) for row in cells]
    if kind == "a time that goes back":
        lines.insert(3200, lines.pop(3000))
    if kind == "a line that is cut":
        lines[3000] = lines[3000][:9] + b"\n"
    if kind == "a line that comes twice":
        lines.insert(3000, lines[3000])
    if kind == "a line that is lost":
        del lines[3000]
    if kind == "a cell that is no number":
        lines[3000] = b"x" + lines[3000]
    return b"".join(lines)


@pytest.mark.parametrize(
    ("kind", "flag"),
    [
        ("a missing position", "position_missing"),
        ("an infinite position", "invalid"),
        ("a duty cycle above 1", "invalid"),
        ("a time that goes back", "late"),
        ("a time far ahead", "invalid"),
        ("a first time far ahead", "invalid"),
        ("a line that is cut", "unreadable"),
        ("a line that comes twice", "repeated"),
        ("a line that is lost", "lost"),
        ("a cell that is no number", "unreadable"),
    ],
)
def test_a_fault_is_survived_and_flagged(call, folder, tmp_path, kind, flag):
    text = spoiled((folder / "worn.csv").read_bytes().splitlines(keepends=True), kind)
    code, said, _ = call(text, "--json")
    answer = json.loads(said)
    assert (code, answer["status"]) == (0, "warning")
    assert set(answer["health"]) == {*FLAGS, *LIVE_FLAGS}
    assert answer["health"][flag] == pytest.approx(1e-3)
    file = pl.read_parquet(folder / "file" / "est.load.parquet")
    assert answer["strokes"] == file.height


def test_a_clock_that_is_set_back_ends_the_recording_and_what_came_before_is_written(call, folder, tmp_path):
    head, *lines = (folder / "worn.csv").read_bytes().splitlines(keepends=True)
    code, said, errors = call(head + b"".join([*lines[:4000], *lines]), "--save", "state.toml", "--report", "page.html")
    assert code == 2
    assert "stdin: the time goes back from 3.999 to" in " ".join(errors.split())
    assert {path.name for path in tmp_path.iterdir()} == {*OUTPUTS, "page.html"}
    assert pl.read_parquet(tmp_path / "est.parquet").height == 4000
    assert "flags: late" in said
    code, said, _ = call(head + b"".join([*lines[:4000], *lines]), "--json", out="json.parquet")
    answer = json.loads(said)
    assert (code, answer["status"]) == (2, "bad_input")
    assert "the time goes back" in answer["message"]
    assert len(answer["load_curve"]["force_N"]) == 101


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "ended before the first sample"),
        (b"time [s],weg [mm]\n0,1\n", "give a channel map with --map"),
        (b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n", "ended before the first sample"),
        (b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n0,0,0,0\n", "an observer needs two at least"),
        (b"\0\1\2\3" * 999, "stdin:"),
        (
            b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n"
            + b"".join(b"%d,nan,0,0\n" % i for i in range(300)),
            "no sample has a position and both duty cycles",
        ),
    ],
)
def test_what_cannot_be_observed_is_one_sentence_and_nothing_is_written(call, tmp_path, text, words):
    code, said, errors = call(text, "--save", "state.toml", "--report", "page.html")
    assert (code, said) == (2, "")
    assert words in " ".join(errors.split())
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_checks_of_the_recording_are_warnings_while_live(call, folder, tmp_path):
    text = (folder / "worn.csv").read_bytes()
    swapped = text.replace(b"duty_supply", b"duty_x").replace(b"duty_exhaust", b"duty_supply")
    code, _, errors = call(swapped.replace(b"duty_x", b"duty_exhaust"))
    assert code == 0
    assert "warning: " in errors


def test_other_formats_of_the_output_are_refused(call, folder, tmp_path):
    code, _, errors = call(b"", out="est.mf4")
    assert code == 2
    assert "a live recording is written as .parquet or .csv" in " ".join(errors.split())
    assert call((folder / "worn.csv").read_bytes(), out="est.csv")[0] == 0
    assert {path.name for path in tmp_path.iterdir()} == {"est.csv", "est.load.csv"}


def test_a_mistyped_option_is_not_taken_for_the_recording(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["observe", "--forec", "--start", "cal.toml", "--out", "est.parquet"])
    assert ended.value.code == 2
    assert "Unknown option: --forec" in capsys.readouterr().err
