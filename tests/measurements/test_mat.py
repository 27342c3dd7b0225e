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
from clutchid.measurements.formats.mat import signals as mat_signals
from fixtures.cases import cases
from fixtures.mat import N, T, Y, written
from fixtures.sources import called, numbers_of


@pytest.fixture
def opened(tmp_path):
    """Variables, written to a file of a version of MATLAB, and opened; `options` are those of `savemat`."""

    def make(variables, version="5", **options):
        return mat_file.open_file(written(tmp_path / "run.mat", variables, version, **options))

    return make


def values(source, text):
    """The numbers of the channel that is called `text`."""
    (raster,) = [i for i, raster in enumerate(source.rasters) if text in [h.text for h in raster.headings]]
    return numbers_of(source, raster)[text]


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("case", cases(__file__, "test_mat"))
def test_every_vector_is_a_channel_with_its_time(opened, case, version):
    source = opened(case["variables"], version)
    grids = [[clock or "-", *sorted(others)] for clock, *others in called(source)]
    assert sorted(grids) == sorted([clock, *sorted(others)] for clock, *others in case["called"])
    headings = [heading for raster in source.rasters for heading in raster.headings]
    assert {h.text: h.unit for h in headings if h.unit} == case.get("units", {})
    assert {h.text: h.comment for h in headings} | case.get("comments", {}) == {h.text: h.comment for h in headings}
    assert [h.text for h in headings if h.name == "time" and "(" in h.text] == case.get("times", [])
    assert sorted(source.warnings) == sorted(case.get("warnings", []))


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_the_columns_of_arrays_have_their_numbers_in_pieces_of_any_size(opened, version):
    expected = {
        "tall(:,2)": -Y, "wide(3,:)": -Y[:30], "single": Y, "pair(2,:)": -Y, "on": T > 0.01, "sig(2).y": -Y
    }  # fmt: skip
    structs = [{"y": "Y"}, {"y": "-Y"}]
    variables = {"tall": "[Y,-Y]", "wide": "[T;Y;-Y]", "single": "1x1xN", "pair": "2x1xN", "on": "on", "sig": structs}
    source = opened(variables, version)
    for rows in (None, 7):
        numbers = {}
        for raster in range(len(source.rasters)):
            numbers |= numbers_of(source, raster, rows)
        for text, samples in expected.items():
            np.testing.assert_array_equal(numbers[text], samples)
            assert numbers[text].dtype == np.float64


@pytest.mark.parametrize("options", [{"do_compression": True}, {"version": "4"}, {"oned_as": "column"}])
def test_files_of_every_kind_of_versions_4_to_7_are_read(opened, options):
    source = opened({"press": "Y", "t": "T", "gain": "three"}, **options)
    assert called(source) == [["t", "press"], [None, "gain"]]
    np.testing.assert_array_equal(values(source, "press"), Y)


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


def test_sparse_matrices_are_left_out(opened):
    from scipy.sparse import eye_array

    assert opened({"t": "T", "s": eye_array(3).tocsc()}).warnings == (
        ("left out objects that hold no real numbers (1): 's'."),
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
        "left out objects, which only MATLAB can read: 'gov' (custom.Governor), 'ts' (timeseries); in MATLAB, copy the "
        "numbers in them to a struct s; save('numbers.mat', 's', '-v7.3').",
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
    assert source.metadata == {}


def test_files_are_told_by_their_content(opened):
    for form in ("5", "4"):
        assert mat_file.is_mat(opened({"t": T}, form).path.read_bytes()[: mat_file.HEAD])
    assert mat_file.is_mat(b"\x89HDF\r\n\x1a\n")
    for head in (b"", b"PAR1", b"time [s],position [m]\n0,1\n", b"MDF     4.10", bytes(1024), b"\xff" * 1024):
        assert not mat_file.is_mat(head)


def test_too_many_channels_are_refused(opened, monkeypatch):
    monkeypatch.setattr(mat_signals, "MOST_CHANNELS", 3)
    assert opened({"m": np.zeros((9, 4))}).problems == ("has more than 3 channels; save those that are needed.",)
