"""What a live recording gives while it goes on: published lines."""

import io
import json
import os
import pty
import signal
import time

import numpy as np
import polars as pl
import pytest

from fixtures.commands import meanwhile, wait_for
from fixtures.pipes import unread


@pytest.fixture
def piped(folder, monkeypatch):
    """The recording on standard input."""
    with (folder / "worn.csv").open() as stream:
        monkeypatch.setattr("sys.stdin", stream)
        yield


def published(said):
    lines = [json.loads(line) for line in said.splitlines()]
    strokes = [line for line in lines if "stroke" in line]
    return [line for line in lines if "position [m]" in line], strokes, lines


def test_published_lines_have_the_numbers_of_the_files_bit_for_bit(observe, folder, same, tmp_path, piped):
    code, said, errors = observe("-", "--publish", "-")
    assert code == 0
    assert errors.startswith("observed stdin: ")
    samples, strokes, lines = published(said)
    file = pl.read_parquet(folder / "file" / "est.parquet")
    assert list(samples[0]) == file.columns
    for name in file.columns:
        column = np.array([line[name] for line in samples], dtype=float)
        assert np.array_equal(column, file[name].to_numpy(), equal_nan=True), name
    by_stroke = pl.read_parquet(folder / "file" / "est.load.parquet")
    assert [line["stroke"] for line in strokes] == by_stroke["stroke [1]"].to_list()
    assert [line["load_curve"]["force_N"][10] for line in strokes] == by_stroke["load_05000um [N]"].to_list()
    theta = [line["parameters"]["theta_1"] for line in strokes]
    assert [estimate["std"] for estimate in theta] == by_stroke["theta_1_std [N]"].to_list()
    assert lines[lines.index(strokes[0]) - 1]["time [s]"] == strokes[0]["time [s]"]


def test_faults_are_published_when_they_occur(observe, folder, monkeypatch, tmp_path):
    lines = (folder / "worn.csv").read_text().splitlines(keepends=True)
    del lines[3000]
    (tmp_path / "torn.csv").write_text("".join(lines))
    with (tmp_path / "torn.csv").open() as stream:
        monkeypatch.setattr("sys.stdin", stream)
        _, said, _ = observe("-", "--publish", "-")
    faults = [line for line in published(said)[2] if "health" in line]
    assert [line["health"]["lost"] for line in faults] == pytest.approx([1e-3])


def closed():
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def full():
    return os.open("/dev/full", os.O_WRONLY)


def hung_up():
    leader, follower = pty.openpty()
    os.close(leader)
    return follower


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "words"),
    [
        (closed, "warning: standard output was closed: nothing more is published"),
        (full, "warning: standard output was lost ("),
        (hung_up, "warning: standard output was lost ("),
    ],
)
def test_where_standard_output_is_lost_the_recording_goes_on(observe, same, monkeypatch, piped, lost, words):
    with os.fdopen(lost(), "w") as stream:
        monkeypatch.setattr("sys.stdout", stream)
        code, _, errors = observe("-", "--publish", "-", "--save", "state.toml")
    assert code == 0
    assert words in errors
    assert errors.count("warning") == 1
    same()


@pytest.mark.slow
@pytest.mark.parametrize("stall", [0.05, 1e3])
def test_a_reader_that_stalls_costs_its_lines_and_the_first_signal_writes_the_files(
    observe, folder, same, monkeypatch, stall
):
    monkeypatch.setattr("clutchid.verbs.live.streams._STALL", stall)
    (arriving, sending), (reading, writing) = os.pipe(), os.pipe()

    def send():
        with os.fdopen(sending, "wb", buffering=0) as stream:
            stream.write((folder / "worn.csv").read_bytes())
            wait_for(lambda: unread(reading) > 32_000 and not unread(arriving))
            time.sleep(0.5)  # the pipe is full, and has been for a while
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.3)

    with meanwhile(send), os.fdopen(arriving) as source, os.fdopen(writing, "w") as stream:
        monkeypatch.setattr("sys.stdin", source)
        monkeypatch.setattr("sys.stdout", stream)
        code, _, errors = observe("-", "--publish", "-")
    with os.fdopen(reading) as lines:
        whole = lines.read().rpartition("\n")[0].splitlines()
    assert code == 0
    assert ("warning: standard output is not read" in errors) is (stall < 1.0)
    samples, *_ = published("\n".join(whole))
    assert 0 < len(samples) < 6000
    same()


@pytest.mark.slow
def test_lines_go_on_whole_once_they_are_read_again(observe, folder, same, monkeypatch):
    monkeypatch.setattr("clutchid.verbs.live.streams._STALL", 0.05)
    text = (folder / "worn.csv").read_bytes()
    (arriving, sending), (reading, writing) = os.pipe(), os.pipe()
    said = []

    def read():
        os.write(sending, text[:200_000])
        wait_for(lambda: unread(reading) > 32_000)
        time.sleep(0.5)
        with os.fdopen(reading, "rb") as lines, meanwhile(go_on):
            said.append(lines.read())

    def go_on():
        with os.fdopen(sending, "wb", buffering=0) as stream:
            for begin in range(200_000, len(text), 50_000):
                stream.write(text[begin : begin + 50_000])
                time.sleep(0.2)

    with meanwhile(read), os.fdopen(arriving) as source, os.fdopen(writing, "w") as stream:
        monkeypatch.setattr("sys.stdin", source)
        monkeypatch.setattr("sys.stdout", stream)
        code, _, _ = observe("-", "--publish", "-")
    assert code == 0
    samples, *_ = published(b"".join(said).decode())
    assert samples[-1]["time [s]"] == pytest.approx(5.999)
    same()


@pytest.mark.slow
def test_one_reader_of_results_and_messages_that_stalls_holds_nothing_up(
    observe, folder, same, tmp_path, monkeypatch, piped
):
    monkeypatch.setattr("clutchid.verbs.live.streams._STALL", 0.05)
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as stream, monkeypatch.context() as both:
        both.setattr("sys.stdout", stream)
        both.setattr("sys.stderr", stream)
        code, *_ = observe("-", "--publish", "-", "--save", "state.toml")
        os.close(reading)
    assert code == 0
    same()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["worn.csv", "--publish", "-"], "--publish -: is for a live recording; give - or can:CHANNEL"),
        (["-", "--publish", "can:can0"], 'Invalid value "can:can0" for --publish. Choose from: "-".'),
        (["-", "--publish", "-", "--json"], "leave one of them out"),
    ],
)
def test_options_that_do_not_go_together_are_said_in_a_sentence(observe, tmp_path, monkeypatch, options, words):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    code, said, errors = observe(*options)
    assert code == 2
    assert words in " ".join((json.loads(said)["message"] if "--json" in options else errors).split())
    assert list(tmp_path.iterdir()) == []
