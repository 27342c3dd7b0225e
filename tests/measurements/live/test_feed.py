"""Bytes while they arrive: whole, in order, and one sentence where a file does not only grow."""

import os
import threading
import time
from pathlib import Path

import pytest

from clutchid.errors import DataError
from clutchid.measurements.live.feed import MOST_BYTES, from_descriptor, from_growing_file


def test_a_file_is_read_from_its_start_and_then_what_is_appended(tmp_path):
    path, stop, pieces = tmp_path / "log.csv", threading.Event(), []
    path.write_bytes(b"first\n")
    for piece in from_growing_file(path, stop.is_set):
        pieces.append(piece)
        if len(pieces) < 4:
            with path.open("ab") as file:
                file.write(b"row %d\nha" % len(pieces))
        else:
            stop.set()
    assert pieces == [b"first\n", b"row 1\nha", b"row 2\nha", b"row 3\nha"]


def test_what_the_file_holds_when_it_is_stopped_is_read(tmp_path):
    path, stop = tmp_path / "log.csv", threading.Event()
    path.write_bytes(b"x" * (MOST_BYTES + 7))
    pieces = from_growing_file(path, stop.is_set)
    first = next(pieces)
    stop.set()
    assert [len(first), *map(len, pieces)] == [MOST_BYTES, 7]


def replaced(path):
    path.with_name("new.csv").write_bytes(b"one\ntwo\n")
    path.with_name("new.csv").replace(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda path: os.truncate(path, 3), "has become shorter; samples can only be appended"),
        (replaced, "is another file now"),
        (Path.unlink, r"cannot be read any more \(No such file"),
    ],
)
def test_a_file_that_becomes_shorter_is_replaced_or_removed_is_said(tmp_path, change, words):
    path = tmp_path / "log.csv"
    path.write_bytes(b"one\ntwo\n")
    pieces = from_growing_file(path, lambda: False)
    next(pieces)
    change(path)
    with pytest.raises(DataError, match=rf"log\.csv: {words}"):
        next(pieces)


def test_a_file_that_is_replaced_is_read_to_its_end_first(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"one\n")
    pieces = from_growing_file(path, lambda: False)
    assert next(pieces) == b"one\n"
    with path.open("ab") as file:
        file.write(b"two\n")
    path.rename(tmp_path / "log.csv.1")
    path.write_bytes(b"three\n")
    assert next(pieces) == b"two\n"
    with pytest.raises(DataError, match=r"log\.csv: is another file now"):
        next(pieces)


@pytest.mark.parametrize(
    ("content", "words"), [(b"PAR1\0\0", "is PARQUET; a file that is followed"), (None, "no such file|not found|exist")]
)
def test_a_file_that_cannot_grow_by_lines_is_refused(tmp_path, content, words):
    if content is not None:
        (tmp_path / "log").write_bytes(content)
    with pytest.raises(DataError, match=f"(?i){words}"):
        next(from_growing_file(tmp_path / "log", lambda: False))


def test_a_pipe_is_read_until_it_is_closed_and_its_last_line_is_ended():
    reading, writing = os.pipe()

    def send():
        for piece in (b"one\n", b"two"):
            os.write(writing, piece)
            time.sleep(0.05)
        os.close(writing)

    sender = threading.Thread(target=send)
    sender.start()
    assert b"".join(from_descriptor(reading, lambda: False)) == b"one\ntwo\n"
    sender.join()
    os.close(reading)


def test_a_file_of_json_lines_is_followed_as_one_of_csv(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_text('{"time [s]": 0, "position [m]": 0}\n{"time [s]": 1, "position [m]": 0}\n')
    assert b"".join(from_growing_file(path, lambda: True)) == path.read_bytes()
