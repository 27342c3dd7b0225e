"""MATLAB files that are cut off, damaged, or made to do harm: one sentence each."""

import re
import struct
import zlib

import numpy as np
import pytest

from clutchid.measurements.formats.mat import file as mat_file
from clutchid.measurements.opening import open_source
from fixtures.mat import T, written


@pytest.fixture
def good(tmp_path):
    """The bytes of a sound file of a version, 7 is the compressed 5."""
    signals = [{"values": "Y", "label": "a"}, {"values": "-Y", "label": "b"}]
    tree = {"x": {"time": "T", "signals": signals}, "c": ["T", "text"]}

    def make(form):
        variables = {"t": "T", "m": "[T,T]", "name": "run 7", "z": "complex", **({} if form == "4" else tree)}
        options = {"do_compression": True} if form == "7" else {}
        return written(tmp_path / "good.mat", variables, "4" if form == "4" else "5", **options).read_bytes()

    return make


def test_an_empty_file(tmp_path, good):
    path = tmp_path / "run.mat"
    path.write_bytes(b"")
    assert mat_file.open_file(path).problems == ("is not a MATLAB file: its header is damaged; copy or save it again.",)
    path.write_bytes(good("5")[:128])
    assert mat_file.open_file(path).problems[0].startswith("holds no vector of two or more numbers")


@pytest.mark.parametrize("form", ["4", "5", "7"])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_truncated_file(tmp_path, good, form, share):
    path = tmp_path / "run.mat"
    data = good(form)
    path.write_bytes(data[: int(share * len(data))])
    (problem,) = mat_file.open_file(path).problems
    assert re.fullmatch(r"is not a complete MATLAB file \(.*\); copy or save it again\.", problem)


def array(rows, columns, data):
    """A variable 'x' of doubles of this shape, with these bytes as its numbers."""
    head = struct.pack("<IIIIIIiiIIII", 6, 8, 6, 0, 5, 8, rows, columns, 1 | 1 << 16, ord("x"), 9, len(data))
    return struct.pack("<II", 14, len(head) + len(data)) + head + data


def test_what_claims_more_than_the_file_can_hold_is_refused(tmp_path, good):
    path = tmp_path / "bomb.mat"
    packed = zlib.compress(array(1 << 30, 1, bytes(100_000)), 9)
    path.write_bytes(good("5")[:128] + struct.pack("<II", 15, len(packed)) + packed)
    (problem,) = open_source(path).problems
    assert problem.startswith(
        (("is not a complete MATLAB file ("), "needs more memory than there is; save it with '-v7.3'")
    )


def test_emoji_in_a_text_are_said(tmp_path, good):
    path = tmp_path / "run.mat"
    head = (
        struct.pack("<IIIIIIiiIIII", 6, 8, 4, 0, 5, 8, 1, 4, 1 | 1 << 16, ord("w"), 16, 7)
        + "a\U0001f600\N{MICRO SIGN}\0".encode()
    )
    path.write_bytes(good("5") + struct.pack("<II", 14, len(head)) + head)
    (problem,) = mat_file.open_file(path).problems
    assert "or contains an emoji, which SciPy cannot read; copy or save it again, or with '-v7.3'." in problem


def test_arrays_of_one_dimension_are_vectors(tmp_path, good):
    # as R writes them
    path = tmp_path / "run.mat"
    data = np.arange(60.0).tobytes()
    head = struct.pack("<IIIIIIiIIIII", 6, 8, 6, 0, 5, 4, 60, 0, 1 | 1 << 16, ord("x"), 9, len(data))
    path.write_bytes(good("5")[:128] + struct.pack("<II", 14, len(head) + len(data)) + head + data)
    source = mat_file.open_file(path)
    assert [heading.text for heading in source.rasters[0].headings] == ["x"]
    (table,) = source.tables(0, [0])
    np.testing.assert_array_equal(table.numbers[0], np.arange(60.0))


@pytest.mark.parametrize("form", ["4", "5", "7"])
def test_a_file_that_changes_after_it_was_opened_gives_what_was_opened(tmp_path, good, form):
    path = tmp_path / "run.mat"
    path.write_bytes(good(form))
    source = mat_file.open_file(path)
    path.write_bytes(good(form)[:200])
    (table,) = source.tables(0, [0])
    np.testing.assert_array_equal(table.numbers[0], T)
