"""MATLAB files of versions 4 to 7, as engineers save them, and those that we write."""

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from clutchid.errors import ExportError
from clutchid.log import Log
from clutchid.measurements.formats.mat import file as mat_file
from clutchid.measurements.formats.mat import loaded as mat_loaded
from clutchid.measurements.formats.mat import rasters as mat_rasters
from fixtures.cases import cases
from fixtures.sources import called, numbers_of

N = 40
T = np.arange(N) / 1000
Y = np.sin(T)


@pytest.fixture
def opened(tmp_path):
    """Variables, written by SciPy, and opened; `options` are those of `savemat`."""

    def make(variables, **options):
        path = tmp_path / "run.mat"
        savemat(path, variables, **options)
        return mat_file.open_file(path)

    return make


def values(source, text):
    """The numbers of the channel that is called `text`."""
    (raster,) = [i for i, raster in enumerate(source.rasters) if text in [h.text for h in raster.headings]]
    return numbers_of(source, raster)[text]


VECTORS = {"T": T, "Y": Y, "S": T[:9], "Z": Y[:9], "Y2": np.c_[Y, -Y]}


def variable(value):
    """A variable of a table: a vector by its name, a struct, or a struct array."""
    if isinstance(value, dict):
        return {name: variable(entry) for name, entry in value.items()}
    if isinstance(value, str):
        return VECTORS.get(value, value)
    array = np.empty((1, len(value)), dtype=[(name, "O") for name in value[0]])
    for i, entry in enumerate(value):
        array[0, i] = tuple(map(variable, entry.values()))
    return array


@pytest.mark.parametrize("case", cases(__file__, "mat_layouts"))
def test_a_layout_has_its_channels_times_units_and_comments(opened, case):
    source = opened(variable(case["variables"]))
    assert [[name or "-" for name in names] for names in called(source)] == case["channels"]
    assert [raster.name for raster in source.rasters] == case.get("names", [raster.name for raster in source.rasters])
    by_text = {heading.text: heading for raster in source.rasters for heading in raster.headings}
    assert {name: by_text[name].unit or "" for name in case.get("units", {})} == case.get("units", {})
    assert {name: by_text[name].comment for name in case.get("comments", {})} == case.get("comments", {})
    assert source.warnings == ()


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}, {"oned_as": "column"}])
def test_vectors_of_one_length_share_the_time_vector_among_them(opened, options):
    source = opened({"press": Y, "t": T, "valve": (T > 0.01).astype(np.uint8), "gain": [1.0, 2.0, 3.0]}, **options)
    assert called(source) == [["t", "press", "valve"], [None, "gain"]]
    assert [raster.size for raster in source.rasters] == [N, 3]
    np.testing.assert_array_equal(values(source, "press"), Y)
    np.testing.assert_array_equal(values(source, "valve"), T > 0.01)
    assert values(source, "valve").dtype == np.float64


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"])
def test_numbers_of_every_type_are_read(opened, kind):
    written = (np.arange(N) % 2).astype(kind)
    np.testing.assert_array_equal(values(opened({"y": written}), "y"), written)


@pytest.mark.parametrize("order", ["<", ">"])
def test_version_4_is_read_in_either_byte_order(tmp_path, order):
    kinds = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
    data = b""
    for code, kind in kinds.items():
        head = struct.pack(order + "5i", 1000 * (order == ">") + 10 * code, N, 1, 0, 3)
        data += head + kind.encode() + b"\0" + np.arange(N).astype(order + kind).tobytes()
    path = tmp_path / "old.mat"
    path.write_bytes(data)
    source = mat_file.open_file(path)
    assert source.format == "MATLAB 4"
    for kind in kinds.values():
        np.testing.assert_array_equal(values(source, kind), np.arange(N))


def test_a_matrix_alone_has_its_time_in_its_own_first_column(opened):
    source = opened({"simout": np.c_[T, Y], "wide": np.vstack([T, Y, -Y])[:, :30]})
    assert called(source) == [["simout(:,1)", "simout(:,2)"], ["wide(1,:)", "wide(2,:)", "wide(3,:)"]]
    np.testing.assert_array_equal(values(source, "wide(3,:)"), -Y[:30])
    tables = list(source.tables(1, [1], 7))
    np.testing.assert_array_equal(np.concatenate([table.numbers[1] for table in tables]), Y[:30])
    assert called(opened({"noise": np.c_[Y[::-1], T]})) == [[None, "noise(:,1)", "noise(:,2)"]]


@pytest.mark.parametrize("options", [{}, {"do_compression": True}])
def test_simulinks_signals_that_change_along_the_third_dimension(opened, options):
    cube = np.stack([Y, -Y])[:, None, :]  # 2 x 1 x N
    source = opened({"t": T, "single": Y.reshape(1, 1, N), "pair": cube}, **options)
    assert called(source) == [["t", "single", "pair(1,:)", "pair(2,:)"]]
    np.testing.assert_array_equal(values(source, "single"), Y)
    np.testing.assert_array_equal(values(source, "pair(2,:)"), -Y)


def test_cells_of_vectors(opened):
    cell = np.empty(2, dtype=object)
    cell[:] = [T, Y]
    source = opened({"t": T, "c": cell})
    assert called(source) == [["t", "c{1}", "c{2}"]]


@pytest.mark.parametrize(
    ("t", "is_time"),
    [
        (np.r_[T, T], True),  # a clock that starts again is a fault to be told, yet a clock
        (np.repeat(T, 2), True),
        (20 + np.random.default_rng(1).normal(size=N), False),  # a temperature
        (np.full(N, 20.0), False),
        (np.full(N, np.nan), False),
    ],
)
def test_what_is_called_t_is_time_only_where_it_runs_on(opened, t, is_time):
    source = opened({"t": t, "y": t[::-1]})
    assert source.rasters[0].clock == (0 if is_time else None)


def test_what_is_no_channel_is_left_out_and_counted(opened):
    from scipy.sparse import eye_array

    texts = np.array(["a", "b"], dtype=object)
    left = {"z": Y + 1j, "s": eye_array(3).tocsc(), "c": texts, "w": "hello", "g": 1.0, "cube": np.zeros((2, 3, 4))}
    source = opened({"t": T, "y": Y, **left, "gains": {"a": 1.0, "b": 2.0, "c": 3.0}, "wide": np.zeros((300, 301))})
    assert called(source) == [["t", "y"]]
    assert source.warnings == (
        "left out single numbers (4): 'g', 'gains.a', 'gains.b' and 1 more.",
        "left out arrays of three or more dimensions (1): 'cube'.",
        "left out matrices of more than 256 columns (1): 'wide'.",
        "left out complex numbers (1): 'z'.",
        "left out sparse matrices (1): 's'.",
        "left out cells of text (1): 'c'.",
        "left out texts (1): 'w'.",
    )


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def mcos(name, class_name):
    """An object as MATLAB writes it: flags, name, type system, class, and a matrix without a meaning here."""
    parts = [element(1, text.encode()) for text in (name, "MCOS", class_name)]
    return element(14, element(6, struct.pack("<II", 17, 0)) + b"".join(parts) + element(14, b""))


@pytest.mark.parametrize("compressed", [False, True])
def test_objects_are_told_with_what_to_do_in_matlab(tmp_path, compressed):
    path = tmp_path / "run.mat"
    savemat(path, {"t": T, "y": Y})
    plain = path.read_bytes()
    added = [mcos("gov", "custom.Governor"), mcos("ts", "timeseries"), mcos("note", "string")]
    added = [struct.pack("<II", 15, len(z)) + z for z in map(zlib.compress, added)] if compressed else added
    path.write_bytes(plain + b"".join(added))
    source = mat_file.open_file(path)
    assert called(source) == [["t", "y"]]
    assert source.warnings == (
        "left out objects, which only MATLAB can read: 'gov' (custom.Governor), 'ts' (timeseries); in MATLAB, with "
        "x = ts, s = struct('time', x.Time, 'data', x.Data); save('numbers.mat', 's', '-v7.3').",
        "left out texts (1): 'note'.",
    )
    path.write_bytes(plain[:128] + mcos("log", "Simulink.SimulationData.Dataset"))
    source = mat_file.open_file(path)
    assert source.rasters == ()
    assert "'log' (Simulink.SimulationData.Dataset); in MATLAB, with x = log" in source.problems[0]


def test_a_file_without_vectors(opened):
    source = opened({"mass": 1.4, "name": "cylinder"})
    assert source.rasters == ()
    assert source.problems == (
        "holds no vector of two or more numbers; save the time and the channels as vectors of one length.",
    )
    assert source.warnings == ("left out single numbers (1): 'mass'.",)


@pytest.mark.filterwarnings("ignore:.*spmatrix:DeprecationWarning")  # of SciPy 1.18; sparse matrices are not compared
def test_the_files_that_come_with_scipy_hold_what_scipy_reads():
    """Written by MATLAB 4.2 to 8 on several machines."""
    folder = Path(savemat.__code__.co_filename).parent / "tests" / "data"
    files = sorted(folder.glob("test*.mat"))
    if not files:
        pytest.skip("SciPy is installed without the files of its tests.")
    compared = 0
    for source in map(mat_file.open_file, files):
        if source.format == "MATLAB 7.3":
            continue
        expected = loadmat(source.path)
        for index in range(len(source.rasters)):
            for text, numbers in numbers_of(source, index).items():
                name, _, place = text.partition("(")
                if name in expected and expected[name].dtype != object:
                    at = [slice(None) if i == ":" else int(i) - 1 for i in place.strip(")").split(",")] if place else []
                    np.testing.assert_array_equal(numbers, expected[name][tuple(at)].ravel())
                    compared += 1
    assert compared > 50


def test_the_pneumatic_cylinder(data):
    path = data("wbident_pneumatic_cylinder/data.mat")
    source = mat_file.open_file(path)
    assert called(source) == [["t", "desl", "press"]]
    assert (source.format, source.rasters[0].size, source.problems, source.warnings) == ("MATLAB 5", 10_000, (), ())
    expected = loadmat(path)
    for name in ("t", "desl", "press"):
        np.testing.assert_array_equal(values(source, name), expected[name].ravel())
    assert (values(source, "desl").min().round(1), values(source, "desl").max().round(1)) == (16.7, 107.8)  # mm


def test_matlab_finds_columns_units_and_metadata_as_variables(tmp_path):
    log = Log(T, {"position": Y, "pressure_a low": Y, "deflection_bearing": Y}, metadata={"truck": "7 µ"})
    mat_file.save(log, tmp_path / "run.mat")
    variables = loadmat(tmp_path / "run.mat", simplify_cells=True)
    assert set(variables) >= {"time", "position", "pressure_a_low", "deflection_bearing"}
    assert variables["units"] == {"time": "s", "position": "m", "pressure_a_low": "Pa", "deflection_bearing": "m"}
    assert json.loads(variables["clutchid_recording"]) == {"truck": "7 µ"}


def test_a_file_of_an_earlier_version_keeps_its_metadata(opened):
    source = opened({"time": T, "position": Y, "units": {"time": "s", "position": "m"}, "clutchid": '{"truck": "7"}'})
    assert source.metadata == {"truck": "7"}
    assert called(source) == [["time", "position"]]


def test_a_log_that_is_too_long_for_the_format(tmp_path, monkeypatch):
    monkeypatch.setattr(mat_file, "_LONGEST", N - 1)
    with pytest.raises(ExportError, match=r"has 40 samples, a MATLAB 5 file holds 39 samples at most; write \.parquet"):
        mat_file.save(Log(T, {}), tmp_path / "run.mat")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["clutchid", "clutchid_recording"])
@pytest.mark.parametrize("text", ["", "[1]", "{", "{} {}"])
def test_a_variable_of_our_name_from_another_program_does_no_harm(opened, text, name):
    source = opened({"t": T, "y": Y, name: text})
    assert called(source) == [["t", "y"]]
    assert list(source.metadata) == ["mat_header"]


def test_files_are_told_by_their_content(opened):
    for form in ("5", "4"):
        assert mat_file.is_mat(opened({"t": T}, format=form).path.read_bytes()[: mat_file.HEAD])
    assert mat_file.is_mat(b"\x89HDF\r\n\x1a\n")
    for head in (b"", b"PAR1", b"time [s],position [m]\n0,1\n", b"MDF     4.10", bytes(1024), b"\xff" * 1024):
        assert not mat_file.is_mat(head)


def test_too_many_channels_are_refused(opened, monkeypatch):
    monkeypatch.setattr(mat_rasters, "MOST_CHANNELS", 3)
    assert opened({"m": np.zeros((9, 4))}).problems == ("has more than 3 channels; save those that are needed.",)


@pytest.mark.parametrize("options", [{}, {"do_compression": True}])
def test_a_variable_that_is_too_large_is_refused_before_it_is_loaded(opened, monkeypatch, options):
    monkeypatch.setattr(mat_loaded, "LARGEST", 8000)
    assert opened({"t": T, "y": np.arange(1000.0)}, **options).problems == ()
    (problem,) = opened({"t": T, "y": np.arange(1001.0)}, **options).problems
    assert problem.startswith("has 0.0 GB in 'y'; save it with '-v7.3', which is read piece by piece.")


@pytest.mark.parametrize("options", [{}, {"do_compression": True}])
def test_variables_of_a_large_file_are_not_kept_in_memory(opened, monkeypatch, options):
    variables = {"t": T, "y": Y, "z": Y + 1j, "name": "run 7", "rec": {"t": T, "p": -Y}}
    in_memory = opened(variables, **options)
    monkeypatch.setattr(mat_loaded, "KEPT", 8 * N)
    monkeypatch.setattr(mat_loaded, "_LARGE", 8 * N - 1)
    large = opened(variables, **options)
    assert called(large) == called(in_memory) == [["rec.t", "rec.p"], ["t", "y"]]
    assert large.warnings == in_memory.warnings
    np.testing.assert_array_equal(values(large, "y"), Y)
    assert sum(table.size for table in large.tables(1, [1], 7)) == N
