"""MATLAB files that are cut off, damaged, or made to do harm: a sentence each, nothing allocated on their word."""

import io
import random
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from clutchid.errors import DataError
from clutchid.io.formats.mat import file as mat_file

T = np.arange(60) / 1000


def good(form):
    """The bytes of a sound file."""
    signals = np.zeros((1, 2), dtype=[("values", "O"), ("label", "O")])
    for i in range(2):
        signals[0, i] = (np.sin(T + i)[:, None], "ab"[i])
    variables = {"t": T, "m": np.c_[T, T, T], "name": "run 7", "z": T + 1j}
    if form == "7.3":
        h5py = pytest.importorskip("h5py", reason="h5py is needed, of the extra 'mat'.")
        stream = io.BytesIO()
        with h5py.File(stream, "w", userblock_size=512, libver="earliest") as file:
            for name in ("t", "m", "rec/t", "rec/y"):
                file.create_dataset(name, data=np.atleast_2d(variables.get(name, T).T), chunks=(1, 20), compression=3)
            file.create_dataset("c", data=np.array([[file["t"].ref]], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        return stream.getvalue()
    if form != "4":
        variables |= {"x": {"time": T, "signals": signals}, "c": np.array([T, "text"], dtype=object)}
    stream = io.BytesIO()
    savemat(stream, variables, format="4" if form == "4" else "5", do_compression=form == "7")
    return stream.getvalue()


def spoiled(data, seed):
    """`data` truncated, with flipped bits, or with a huge number in it."""
    chance = random.Random(seed)
    spoiled = bytearray(data)
    place = chance.randrange(len(data) - 8)
    match seed % 4:
        case 0:
            return bytes(spoiled[:place])
        case 1:
            for _ in range(chance.choice((1, 4, 64))):
                spoiled[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        case 2:
            size = chance.choice((4, 8))
            spoiled[place // 4 * 4 : place // 4 * 4 + size] = b"\xff\xff\xff\x7f\xff\xff\xff\x7f"[:size]
        case _:
            spoiled[place : place + 8] = chance.randbytes(8)
    return bytes(spoiled)


@pytest.mark.parametrize("form", ["4", "5", "7", "7.3"])
def test_whatever_the_bytes_are_there_is_a_source_or_one_sentence(tmp_path, form):
    data, path = good(form), tmp_path / "run.mat"
    refused, told = 0, []
    for seed in range(240):
        path.write_bytes(spoiled(data, seed))
        source = mat_file.open_file(path)
        assert bool(source.problems) != bool(source.rasters)
        assert all("\n" not in problem and len(problem) < 1000 for problem in source.problems)
        refused += bool(source.problems)
        try:
            for index, raster in enumerate(source.rasters):
                for table in source.tables(index, range(len(raster.headings)), 25):
                    assert all(numbers.size == table.size for numbers in table.numbers.values())
        except DataError as error:
            told.append(str(error))
    assert refused > 40
    assert all("\n" not in text and "run.mat: is " in text for text in told)


def test_an_empty_file(tmp_path):
    path = tmp_path / "run.mat"
    path.write_bytes(b"")
    assert mat_file.open_file(path).problems == ("is no MATLAB file: its header is damaged; copy or save it again.",)
    path.write_bytes(good("5")[:128])
    assert mat_file.open_file(path).problems[0].startswith("holds no vector of two or more numbers")


def test_a_truncated_file_says_where_it_ends(tmp_path):
    path = tmp_path / "run.mat"
    for form in "45":
        data = good(form)
        path.write_bytes(data[:-8])
        (problem,) = mat_file.open_file(path).problems
        assert problem.startswith("is cut off: ")
        assert f"the file ends at {len(data) - 8:,}" in problem


def compressed(data):
    return struct.pack("<II", 15, len(data)) + data


@pytest.mark.parametrize(
    ("declared", "what"),
    [
        (0xFFFFFFF8, "a compressed variable cannot be inflated"),  # 4 GB in 50 kB, more than deflate can do
        (30_000_000, "the checksum of a compressed variable is wrong"),  # and then there are 50 MB
        (1000, "the checksum of a compressed variable is wrong"),
    ],
)
def test_a_small_variable_that_inflates_to_a_huge_one_is_not_inflated(tmp_path, declared, what):
    path = tmp_path / "bomb.mat"
    bomb = zlib.compress(struct.pack("<II", 14, declared) + bytes(50_000_000), 9)
    path.write_bytes(good("5")[:128] + compressed(bomb))
    tracemalloc.start()
    try:
        assert what in mat_file.open_file(path).problems[0]
        # the bytes that are declared, and as many again where the list of them grows
        assert tracemalloc.get_traced_memory()[1] < 2.5 * min(declared, 30_000_000) + 8_000_000
    finally:
        tracemalloc.stop()


def test_cells_in_cells_without_an_end_are_refused(tmp_path):
    path = tmp_path / "run.mat"
    inner = struct.pack("<II", 14, 0)
    for _ in range(100):
        head = struct.pack("<IIIIIIiiII", 6, 8, 1, 0, 5, 8, 1, 1, 1, 0)
        inner = struct.pack("<II", 14, len(head) + len(inner)) + head + inner
    path.write_bytes(good("5")[:128] + inner)
    assert "cannot be understood" in mat_file.open_file(path).problems[0]


@pytest.mark.parametrize("form", ["4", "5", "7"])
def test_a_file_that_becomes_shorter_after_it_was_opened(tmp_path, form):
    path = tmp_path / "run.mat"
    path.write_bytes(good(form))
    source = mat_file.open_file(path)
    path.write_bytes(good(form)[:200])
    with pytest.raises(DataError, match=r"run\.mat: is (cut off|damaged: .*); copy "):
        list(source.tables(0, [0, 1]))
