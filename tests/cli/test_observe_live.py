"""``clutchid observe -``: live and file give the same numbers, and whatever comes, files are whole or not there."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import polars as pl
import pytest

from clutchid.observer.health import FLAGS, LIVE_FLAGS
from clutchid.observer.live import SENTENCES
from clutchid.verbs.live.following import shown_clock
from fixtures.commands import called, meanwhile, wait_for
from fixtures.pipes import unread

OUTPUTS = ("est.parquet", "est.load.parquet", "state.toml")
HEADER = b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n"

#: Samples before a state is saved.
CUT = 2345


@pytest.fixture
def call(observe, monkeypatch):
    """Observe some text on standard input; exit code, output and errors."""

    def run(sent, *options, out="est.parquet", end=os.close):
        reading, writing = os.pipe()
        pieces = [sent] if isinstance(sent, bytes) else sent
        with meanwhile(lambda: _send(writing, pieces, end)), os.fdopen(reading) as stream:
            monkeypatch.setattr("sys.stdin", stream)
            return observe("-", *options, out=out)

    return run


@pytest.fixture
def lines(folder):
    """Header and samples of the recording as lines of text."""
    return (folder / "worn.csv").read_bytes().splitlines(keepends=True)


def _send(writing, pieces, end):
    try:
        for piece in pieces:
            rest = piece
            while rest:
                rest = rest[os.write(writing, rest) :]
        end(writing)
    except BrokenPipeError:
        os.close(writing)


def stop(number):
    def end(writing):
        wait_for(lambda: not unread(writing))
        os.kill(os.getpid(), number)
        time.sleep(0.3)
        os.close(writing)

    return end


def cut(text, sizes):
    edges = [0]
    while edges[-1] < len(text):
        edges.append(edges[-1] + sizes[len(edges) % len(sizes)])
    return [text[a:b] for a, b in pairwise(edges)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["csv", "jsonl"])
@pytest.mark.parametrize("sizes", [[10**7], [1, 7000, 3]])
def test_live_and_file_give_the_same_numbers_bit_for_bit(call, folder, same, tmp_path, kind, sizes):
    text = (folder / f"worn.{kind}").read_bytes()
    code, said, errors = call(cut(text, sizes), "--save", "state.toml")
    assert (code, errors) == (0, "")
    assert said.startswith("observed stdin: load at 12.5 mm ")
    assert "no flags" in said.splitlines()[0]
    same()
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_in_mid_line_leaves_whole_files_of_all_whole_lines(call, lines, same, tmp_path, number):
    code, _, errors = call([*lines[:4001], b"4.000,0.0"], "--save", "state.toml", end=stop(number))
    assert (code, errors) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)
    assert pl.read_parquet(tmp_path / "est.parquet").height == 4000
    same(rows=4000)
    assert signal.getsignal(number) is not None


@pytest.mark.slow
def test_a_terminal_that_is_closed_sends_its_signal_twice_and_one_that_ignores_it_goes_on(call, folder, same):
    def twice(writing):
        wait_for(lambda: not unread(writing))
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGHUP)
        stop(signal.SIGHUP)(writing)

    text = (folder / "worn.csv").read_bytes()
    assert call(text, "--save", "state.toml", end=twice)[0] == 0
    same()
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert call([text[:100_000], text[100_000:]], end=stop(signal.SIGHUP))[0] == 0
    finally:
        signal.signal(signal.SIGHUP, before)
    same(rows=5900)


@pytest.mark.parametrize("as_json", [False, True])
def test_a_folder_that_is_removed_costs_no_result(call, folder, tmp_path, as_json):
    (tmp_path / "out").mkdir()

    def remove(writing):
        while len([*(tmp_path / "out").glob(".*/free")]) < 2:  # the outputs are begun
            time.sleep(0.01)
        wait_for(lambda: not unread(writing))
        while (tmp_path / "out").exists():  # something may be written meanwhile
            shutil.rmtree(tmp_path / "out", ignore_errors=True)
        os.close(writing)

    text = (folder / "worn.csv").read_bytes()
    options = ["--save", "out/state.toml", *(["--json"] if as_json else [])]
    code, said, errors = call(text, *options, out="out/est.parquet", end=remove)
    assert code == 1
    places = dict(re.findall(r"warning: (\S+): can no longer be written; it is in (\S+) instead", errors))
    assert set(places) == {"out/est.parquet", "out/est.load.parquet", "out/state.toml"}, (errors, said)
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
    monkeypatch.setattr("clutchid.measurements.spool.PIECE", 1 << 14)
    before, limit = resource.getrlimit(resource.RLIMIT_FSIZE), 400_000
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        code, said, errors = call((folder / "worn.csv").read_bytes(), "--save", "state.toml")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert code == 1
    assert said.startswith("observed stdin: ")
    words = "est.parquet: can no longer be written (File too large). What came before is kept"
    assert words in errors
    live, file = pl.read_parquet(tmp_path / "est.parquet"), pl.read_parquet(folder / "file" / "est.parquet")
    assert 500 < live.height < 6000
    assert live.equals(file.head(live.height), null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()
    assert {path.name for path in tmp_path.iterdir()} == set(OUTPUTS)


@pytest.mark.slow
def test_a_run_that_is_killed_leaves_its_results_and_a_state_to_go_on_from(call, folder, lines, tmp_path):
    script = "from clutchid.cli import main; from clutchid.verbs.live import following; following.MINUTE = 0.0; main()"
    options = ["--start", str(folder / "cal.toml"), "--out", "est.parquet", "--save", "state.toml"]
    head, *lines = lines
    command = [sys.executable, "-c", script, "observe", "-", *options]
    with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE) as killed:
        killed.stdin.write(head + b"".join(lines[:4000]))
        killed.stdin.flush()
        wait_for((tmp_path / "state.toml").exists)
        time.sleep(1.0)
        killed.kill()
    assert not (tmp_path / "est.parquet").exists()
    _, _, errors = call(b"", "--save", "state.toml")
    said = errors
    assert "an earlier run ended before it wrote est.parquet: what it had observed is in" in said
    assert "go on from it with --resume state.toml" in said
    table = pl.read_parquet(tmp_path / "est.recovered.parquet")
    file = pl.read_parquet(folder / "file" / "est.parquet")
    assert table.height == pytest.approx(3950, abs=1)  # the rest waits for samples that are late
    assert table.equals(file.head(table.height), null_equal=True)
    rest = head + b"".join(lines[table.height :])
    assert call(rest, "--resume", "state.toml", "--save", "state.toml")[0] == 0
    assert pl.concat([table, pl.read_parquet(tmp_path / "est.parquet")]).equals(file, null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (folder / "file" / "state.toml").read_text()


def test_a_run_that_goes_on_says_which_rows_of_a_killed_run_come_again(call, folder, lines, tmp_path, monkeypatch):
    assert call(lines[: CUT + 1], "--save", "state.toml", out="one.parquet")[0] == 0
    file = pl.read_parquet(folder / "file" / "est.parquet")
    left = file.filter(pl.col("time [s]") < 3.0)  # with samples after the state was saved
    monkeypatch.setattr("clutchid.measurements.spool.recovered", lambda path: [tmp_path / f"left.{path.name}"])
    code, _, said = call([lines[0], *lines[CUT + 1 :]], "--save", "state.toml", "--resume", "state.toml")
    new = pl.read_parquet(tmp_path / "est.parquet")
    begin = new["time [s]"][0]
    assert (code, f"rows from {begin:g} s on come again in est.parquet and its load by stroke" in said) == (0, True)
    earlier = left.filter(pl.col("time [s]") < begin)
    assert pl.concat([earlier, new]).equals(file, null_equal=True)


def with_cell(row, column, value):
    """Another value in a row and column."""

    def change(lines):
        cells = lines[row].split(b",")
        cells[lines[0].split(b",").index(column)] = value
        return [*lines[:row], b",".join(cells), *lines[row + 1 :]]

    return change


#: Faults of line 3000 and thereabouts, and the flag that each raises.
FAULTS = {
    "a missing position": (with_cell(3000, b"position [m]", b"nan"), "position_missing"),
    "an infinite position": (with_cell(3000, b"position [m]", b"inf"), "invalid"),
    "a duty cycle above 1": (with_cell(3000, b"duty_supply [1]", b"1.5"), "invalid"),
    "a time far ahead": (with_cell(3000, b"time [s]", b"2999"), "invalid"),
    "a first time far ahead": (with_cell(1, b"time [s]", b"1e9"), "invalid"),
    "a time that goes back": (lambda t: [*t[:3000], *t[3001:3201], t[3000], *t[3201:]], "late"),
    "a line that is cut": (lambda t: [*t[:3000], t[3000][:9] + b"\n", *t[3001:]], "unreadable"),
    "a line that comes twice": (lambda t: [*t[:3000], *t[2999:]], "repeated"),
    "a line that is lost": (lambda t: [*t[:3000], *t[3001:]], "lost"),
    "a cell that is no number": (lambda t: [*t[:3000], b"x" + t[3000], *t[3001:]], "unreadable"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_survived_and_flagged(call, folder, lines, name):
    change, flag = FAULTS[name]
    code, said, _ = call(change(lines), "--json")
    answer = json.loads(said)
    assert (code, answer["status"]) == (0, "warning")
    assert set(answer["health"]) == {*FLAGS, *LIVE_FLAGS}
    assert answer["health"][flag] == pytest.approx(1e-3)
    assert answer["strokes"] == pl.read_parquet(folder / "file" / "est.load.parquet").height


def with_times(lines, time_of):
    """The lines with other times in ms, whole numbers, in place of the whole numbers of ms that they have."""
    cells = [line.split(b",", 1) for line in lines[1:]]
    return [lines[0], *(f"{time_of(i) / 1e3:.3f},".encode() + rest for i, (_, rest) in enumerate(cells))]


@pytest.mark.slow
def test_a_counter_that_wraps_gives_the_numbers_of_one_that_does_not(call, lines, tmp_path):
    assert call(with_times(lines, lambda i: i + 62536), out="plain.parquet")[0] == 0
    code, _, errors = call(with_times(lines, lambda i: (i + 62536) % 65536))
    assert code == 0
    assert "its counter of 16 bits wraps at sample 3001 (0 s after 65.535 s); 65.536 s are corrected" in errors
    plain, wrapped = (pl.read_parquet(tmp_path / f"{name}.parquet") for name in ("plain", "est"))
    for name in ("time [s]", "position [m]", "pressure_a [Pa]"):  # the period is added to stamps that were rounded
        assert wrapped[name].to_list() == pytest.approx(plain[name].to_list(), rel=1e-9)
    text = with_times(lines, lambda i: (i + 62536) % 65536)
    assert call(text[:4001], "--save", "state.toml", out="one.parquet")[0] == 0
    assert call([text[0], *text[4001:]], "--resume", "state.toml", out="two.parquet")[0] == 0
    both = pl.concat(pl.read_parquet(tmp_path / f"{name}.parquet") for name in ("one", "two"))
    assert both.equals(wrapped, null_equal=True)


def test_sentences_about_the_clock_come_to_an_end():
    shown, said = [], 0
    for i in range(3 * SENTENCES):
        new = [f"sentence {i}"] * (i % 3)
        shown += shown_clock(new, said)
        said += len(new)
    assert len(shown) == SENTENCES + 1
    assert [sentence for sentence in shown if "not shown" in sentence] == shown[-1:]


@pytest.mark.slow
def test_a_clock_that_is_set_back_goes_on_behind_a_hole_and_is_a_warning(call, lines, tmp_path):
    text = [*lines[:4001], *lines[1:]]
    code, said, errors = call(text, "--save", "state.toml", "--report", "page.html")
    assert code == 0
    words = "the clock restarts at sample 4001 (0 s after 3.999 s); each run becomes a separate segment"
    assert errors.count(words) == 1, "said while it goes on, and not again with the result"
    assert {path.name for path in tmp_path.iterdir()} == {*OUTPUTS, "page.html"}
    assert pl.read_parquet(tmp_path / "est.parquet").height == 4000 + len(lines) - 1
    assert "flags: time_missing" in said
    answer = json.loads(call(text, "--json", out="json.parquet")[1])
    assert answer["status"] == "warning"
    assert any("the clock restarts" in sentence for sentence in answer["warnings"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "ended before the first sample"),
        (b"\0\1\2\3" * 999, "stdin:"),
        (HEADER + b"".join(b"%d,nan,0,0\n" % i for i in range(300)), "no sample has a position and both duty cycles"),
    ],
)
def test_what_cannot_be_observed_is_one_sentence_and_nothing_is_written(call, tmp_path, text, words):
    code, said, errors = call(text, "--save", "state.toml", "--report", "page.html")
    assert (code, said) == (2, "")
    assert words in errors
    assert list(tmp_path.iterdir()) == []


def test_checks_of_the_recording_are_warnings_while_live(call, folder, tmp_path):
    text = (folder / "worn.csv").read_bytes()
    swapped = text.replace(b"duty_supply", b"duty_x").replace(b"duty_exhaust", b"duty_supply")
    code, _, errors = call(swapped.replace(b"duty_x", b"duty_exhaust"))
    assert code == 0
    assert "warning: " in errors


def test_other_formats_of_the_output_are_refused(call):
    assert call(b"", out="est.mf4")[0] == 2


def test_a_mistyped_option_is_not_taken_for_the_recording(capsys):
    assert called("observe", "--forec", "--start", "cal.toml", "--out", "est.parquet") == 2
    assert "Unknown option: --forec" in capsys.readouterr().err
