"""MATLAB 7.3 files, made with h5py in the form that MATLAB writes."""

from contextlib import contextmanager

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.formats.mat import file as mat_file
from clutchid.measurements.formats.mat import hdf5 as mat_hdf5
from fixtures.sources import called, numbers_of

h5py = pytest.importorskip("h5py", reason="h5py is needed, of the extra 'mat'.")

N = 3000
T = np.arange(N) / 1000
Y = np.sin(T)


def typed(item, class_name, **attributes):
    item.attrs["MATLAB_class"] = np.bytes_(class_name)
    for name, value in attributes.items():
        item.attrs[name] = value
    return item


def put(group, name, value):
    """A value as MATLAB writes it: dimensions turned round, long vectors in compressed chunks."""
    if isinstance(value, dict):
        for key, child in value.items():
            put(typed(group.create_group(name), "struct") if key == next(iter(value)) else group[name], key, child)
    elif isinstance(value, str):
        codes = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
        typed(group.create_dataset(name, data=codes), "char", MATLAB_int_decode=np.int32(2))
    elif isinstance(value, list):  # a cell array, or the field of a struct array
        typed(group.create_dataset(name, data=references(group.file, value), dtype=h5py.ref_dtype), "cell")
    else:
        array = np.atleast_2d(value).T if np.ndim(value) < 2 else np.asarray(value).T
        chunks = {"chunks": (1, 500), "compression": 3} if array.size > 1000 else {}
        array = array.T if array.shape[1] == 1 and array.size > 1000 else array
        typed(
            group.create_dataset(name, data=array, **chunks),
            {"f": "double", "u": "uint8"}.get(array.dtype.kind, "logical"),
        )


def references(file, items):
    array = np.empty((len(items), 1), dtype=h5py.ref_dtype)
    for i, item in enumerate(items):
        name = f"#refs#/{len(file.require_group('#refs#'))}"
        put(file, name, item)
        array[i, 0] = file[name].ref
    return array


def struct_array(file, path, **fields):
    group = typed(file.create_group(path), "struct")
    for name, items in fields.items():
        group.create_dataset(name, data=references(file, items), dtype=h5py.ref_dtype)


@pytest.fixture
def made(tmp_path):
    """A file with these variables, and what `more` does to it; with MATLAB's header in front or without."""

    def make(variables, more=lambda file: None, userblock=512):
        path = tmp_path / "run.mat"
        with h5py.File(path, "w", userblock_size=userblock, libver="earliest") as file:
            for name, value in variables.items():
                put(file, name, value)
            more(file)
        if userblock:
            with path.open("r+b") as stream:
                stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
        return path

    return make


@pytest.mark.parametrize("userblock", [0, 512])
def test_vectors_and_structs(made, userblock):
    path = made({"t": T, "y": Y, "on": T > 1, "rec": {"time": T[:9], "p": Y[:9], "unit": "bar"}}, userblock=userblock)
    assert mat_file.is_mat(path.read_bytes()[: mat_file.HEAD])
    source = mat_file.open_file(path)
    assert (source.format, source.problems, source.warnings) == ("MATLAB 7.3", (), ())
    assert sorted(map(sorted, called(source))) == [["on", "t", "y"], ["rec.p", "rec.time"]]
    assert {h.text: h.unit for r in source.rasters for h in r.headings}["rec.p"] == "bar"
    index = next(i for i, raster in enumerate(source.rasters) if raster.size == N)
    assert [table.size for table in source.tables(index, [0], 700)] == [700, 700, 700, 700, 200]
    numbers = numbers_of(source, index, 700)
    for name, expected in {"t": T, "y": Y, "on": T > 1}.items():
        np.testing.assert_array_equal(numbers[name], expected)


def test_matrices_have_their_samples_in_columns_or_rows(made):
    cube = np.stack([T, -Y])[:, None, :20]  # 2 x 1 x 20
    source = mat_file.open_file(made({"cube": cube, "tall": np.c_[T, Y][:50], "wide": np.vstack([T, Y, -Y])[:, :30]}))
    assert called(source) == [
        ["cube(1,:)", "cube(2,:)"],
        ["tall(:,1)", "tall(:,2)"],
        ["wide(1,:)", "wide(2,:)", "wide(3,:)"],
    ]
    for raster, name, expected in [(0, "cube(2,:)", -Y[:20]), (1, "tall(:,2)", Y[:50]), (2, "wide(3,:)", -Y[:30])]:
        np.testing.assert_array_equal(numbers_of(source, raster, 11)[name], expected)


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


def test_struct_arrays_and_cells_are_lists_of_references(made):
    def simulink(file):
        put(file, "x", {"time": T[:20]})
        struct_array(file, "x/signals", values=[Y[:20], -Y[:20]], label=["stroke", ""], blockName=["Scope", "Scope"])

    source = mat_file.open_file(made({"c": [Y[:20], "text", 4.0]}, simulink))
    assert called(source) == [["x.time", "x.stroke", "x.signals(2).values"], [None, "c{1}"]]
    (table,) = source.tables(0, [2])
    np.testing.assert_array_equal(table.numbers[2], -Y[:20])
    assert source.warnings == ("left out texts (1): 'c{2}'.", "left out single numbers (1): 'c{3}'.")


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
        "left out functions (1): 'fh'.",
        "left out empty arrays (1): 'none'.",
        "left out sparse matrices (1): 'sp'.",
        "left out complex numbers (1): 'z'.",
    }


def test_a_dataset_that_claims_more_than_the_file_can_hold_is_left_out(made):
    def more(file):
        file.create_dataset("bomb", shape=(1, 10**12), chunks=(1, 1000), dtype="f8", compression=3)
        file.create_dataset("chunk", data=np.zeros((1, 2**22)), chunks=(1, 2**22), compression=9)

    source = mat_file.open_file(made({"t": T, "y": Y}, more))
    assert "left out arrays whose numbers are not in the file (1): 'bomb'." in source.warnings


def test_a_struct_that_holds_itself_is_looked_through_once(made):
    def more(file):
        group = typed(file.create_group("a"), "struct")
        put(group, "y", Y)
        group["again"] = group

    assert called(mat_file.open_file(made({}, more))) == [[None, "a.y"]]


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
def test_a_truncated_file(made, share):
    path = made({"t": T, "y": Y})
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    source = mat_file.open_file(path)
    assert source.rasters == ()
    assert source.problems[0].startswith("is no whole MATLAB 7.3 (HDF5) file (")


def test_damaged_samples_are_an_error_that_names_the_file(made):
    path = made({"y": np.random.default_rng(0).normal(size=N)})
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    path.write_bytes(data)
    source = mat_file.open_file(path)
    words = r"run\.mat: is no whole MATLAB 7\.3 \(HDF5\) file \(.*\); copy or save it again\."
    with pytest.raises(DataError, match=words):
        list(source.tables(0, [0]))


def test_a_large_channel_is_read_in_bounded_memory(made, monkeypatch):
    asked, plain = [], mat_hdf5.opened

    @contextmanager
    def watched(path):
        with plain(path) as read:
            yield lambda numbers, channel, a, b: asked.append(b - a) or read(numbers, channel, a, b)

    monkeypatch.setattr(mat_file, "_V73", mat_file._V73.__class__("MATLAB 7.3", mat_hdf5.contents, watched))
    source = mat_file.open_file(made({"t": T, "y": Y}))
    asked.clear()
    assert sum(table.size for table in source.tables(0, [0, 1], 100)) == N
    assert max(asked) == 100
