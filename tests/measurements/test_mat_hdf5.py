"""MATLAB 7.3 files, made with h5py in the form that MATLAB writes."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.formats.mat import contents as mat_contents
from clutchid.measurements.formats.mat import file as mat_file
from fixtures.mat import typed, written
from fixtures.sources import called, numbers_of

h5py = pytest.importorskip("h5py", reason="h5py is needed, of the extra 'mat'.")

N = 3000
T = np.arange(N) / 1000
Y = np.sin(T)


@pytest.fixture
def made(tmp_path):
    """A file with these variables, and what `more` does to it."""
    return lambda variables, more=lambda file: None: written(tmp_path / "run.mat", variables, "7.3", more)


def test_hdf5_without_a_header_of_matlab_is_read(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["y"], file["texts"], file["word"] = T, Y, ["a", "b"], "run 7"
        file["c"] = np.array([file["y"].ref], dtype=h5py.ref_dtype)
    assert mat_file.is_mat(path.read_bytes()[: mat_file.HEAD])
    source = mat_file.open_file(path)
    assert (source.format, called(source), source.metadata) == ("MATLAB 7.3", [["t", "c{1}", "y"]], {})
    assert source.warnings == ("left out objects that hold no real numbers (2): 'texts', 'word'.",)
    assert [table.size for table in source.tables(0, [0], 700)] == [700, 700, 700, 700, 200]
    np.testing.assert_array_equal(numbers_of(source, 0, 700)["y"], Y)


@pytest.mark.parametrize("size", [1, 5])
def test_a_file_of_ours_that_matlab_saved_again_is_known(made, size):
    units = {"time": "s", "position": "m"}
    path = made({"time": T[:size], "position": Y[:size], "units": units, "clutchid": '{"truck": "7"}'})
    source = mat_file.open_file(path)
    (raster,) = source.rasters
    assert [(heading.name, heading.unit) for heading in raster.headings] == [("position", "m"), ("time", "s")]
    assert (raster.size, raster.clock, source.metadata, source.warnings) == (size, 1, {"truck": "7"}, ())
    (table,) = source.tables(0, [0])
    np.testing.assert_array_equal(table.numbers[0], Y[:size])


def test_what_is_no_channel_is_left_out_and_counted(made):
    def more(file):
        typed(file.create_dataset("ts", data=np.zeros((1, 6), "u4")), "timeseries", MATLAB_object_decode=np.int32(3))
        typed(file.create_group("sp"), "double", MATLAB_sparse=np.uint64(3))
        typed(file.create_dataset("z", data=np.zeros((1, 9), [("real", "f8"), ("imag", "f8")])), "double")
        typed(file.create_dataset("none", data=np.zeros(2, "u8")), "double", MATLAB_empty=np.uint8(1))
        typed(file.create_group("fh"), "function_handle", MATLAB_object_decode=np.int32(1))
        file["soft"] = h5py.SoftLink("/t")
        file["elsewhere"] = h5py.ExternalLink("/etc/hostname", "/t")
        file.create_group("#subsystem#")

    source = mat_file.open_file(made({"t": T, "y": Y}, more))
    assert called(source) == [["t", "y"]]
    assert source.warnings[0].startswith("left out objects, which only MATLAB can read: 'ts' (timeseries); in MATLAB")
    assert set(source.warnings[1:]) == {
        "left out arrays whose numbers are not in the file (2): 'elsewhere', 'soft'.",
        "left out objects that hold no real numbers (4): 'fh', 'none', 'sp' and 1 more.",
    }


def test_a_dataset_that_claims_more_than_the_file_can_hold_is_left_out(made):
    def more(file):
        file.create_dataset("bomb", shape=(1, 10**12), chunks=(1, 1000), dtype="f8", compression=3)
        file.create_dataset("chunk", data=np.zeros((1, 2**22)), chunks=(1, 2**22), compression=9)

    source = mat_file.open_file(made({"t": T, "y": Y}, more))
    assert "left out arrays whose numbers are not in the file (1): 'bomb'." in source.warnings


def test_a_struct_that_holds_itself_is_refused(made):
    def more(file):
        group = file.create_group("a")
        group["again"] = group

    assert mat_file.open_file(made({}, more)).problems[0].startswith("is not a complete MATLAB 7.3 (HDF5) file (")


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
def test_a_truncated_file(made, share):
    path = made({"t": T, "y": Y})
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    source = mat_file.open_file(path)
    assert source.rasters == ()
    assert source.problems[0].startswith("is not a complete MATLAB 7.3 (HDF5) file (")


def test_damaged_samples_are_an_error_that_names_the_file(made):
    path = made({"y": np.random.default_rng(0).normal(size=N)})
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    path.write_bytes(data)
    source = mat_file.open_file(path)
    words = r"run\.mat: is not a complete MATLAB 7\.3 \(HDF5\) file \(.*\); copy or save it again\."
    with pytest.raises(DataError, match=words):
        list(source.tables(0, [0]))


def test_a_large_channel_is_read_in_bounded_memory(made, monkeypatch):
    asked, plain = [], mat_contents.ArrayChannel.samples

    def watched(channel, file, start, stop):
        asked.append(stop - start)
        return plain(channel, file, start, stop)

    monkeypatch.setattr(mat_contents.ArrayChannel, "samples", watched)
    source = mat_file.open_file(made({"t": T, "y": Y}))
    asked.clear()
    assert sum(table.size for table in source.tables(0, [0, 1], 100)) == N
    assert max(asked) == 100
