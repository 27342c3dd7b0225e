"""Objects of MATLAB's classes, as mat-io decodes them, and the structs that Simulink writes."""

import sys
import warnings

import numpy as np
import pytest
from scipy.io.matlab import MatlabOpaque

from clutchid.measurements.formats.mat import file as mat_file
from clutchid.measurements.formats.mat.contents import Contents
from fixtures.sources import numbers_of

N = 40
T = np.arange(N) / 1000
Y = np.sin(T)


@pytest.fixture
def saved(tmp_path):
    """A function that writes variables, objects among them, as MATLAB does, and opens the file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        matio = pytest.importorskip("matio", reason="mat-io is needed, of the extra 'mat'.")

    def make(version="v7", **variables):
        path = tmp_path / "run.mat"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            matio.save_to_mat(str(path), variables, version=version)
        return mat_file.open_file(path)

    return make


def made(name, **properties):
    """An object of a class with these properties."""
    from matio.utils import MatlabOpaque as Object

    return Object(properties=properties, classname=name)


def column(values):
    return np.asarray(values, dtype=np.float64).reshape(-1, 1)


def cells(*items):
    array = np.empty((1, len(items)), dtype=object)
    array[0, :] = items
    return array


def texts(*items):
    return cells(*(np.array([item]) for item in items))


def frame(kind, **columns):
    """A table or timetable of columns, whose rows are 1 ms apart, as mat-io writes it: its properties."""
    import pandas as pd
    from matio.utils.converters import mattables

    times = {"index": pd.to_timedelta(T, unit="s").rename("Time")} if kind == "timetable" else {}
    return getattr(mattables, f"{kind}_to_mat")(pd.DataFrame(columns, **times))


def read(source):
    """Names, units and samples of every channel, by raster."""
    numbers = [numbers_of(source, index) for index in range(len(source.rasters))]
    return [{h.text: (h.unit, n[h.text]) for h in r.headings} for r, n in zip(source.rasters, numbers, strict=True)]


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_a_timetable_is_a_struct_of_its_columns_and_times(saved, version):
    if version == "v7.3":
        pytest.importorskip("h5py", reason="h5py is needed, of the extra 'mat'.")
    properties = frame("timetable", stroke=Y, pressure=-Y)
    properties["any"]["varUnits"][0, 0] = texts("mm", "mm")
    source = saved(version, rec=made("timetable", **properties), z=column(Y))
    assert (source.problems, source.warnings) == ((), ())
    named, plain = read(source)
    units = {name: unit for name, (unit, _) in named.items()}
    assert units == {"rec.Time": "s", "rec.stroke": "mm", "rec.pressure": "mm"}
    assert source.rasters[0].headings[source.rasters[0].clock].text == "rec.Time"
    np.testing.assert_allclose(named["rec.Time"][1], T, rtol=1e-15)
    np.testing.assert_array_equal(named["rec.pressure"][1], -Y)
    np.testing.assert_array_equal(plain["z"][1], Y)


@pytest.mark.parametrize("by_rate", [True, False])
def test_a_timetable_with_a_sample_rate_counts_from_zero(saved, by_rate):
    regular = np.empty((1, 1), dtype=[(name, "O") for name in ("origin", "specifiedAsRate", "stepSize", "sampleRate")])
    zero, step = np.array([[0], [1]], "m8[ms]")
    regular[0, 0] = (zero[:, None], np.array([[by_rate]]), step[:, None], column([1000.0 if by_rate else np.nan]))
    properties = frame("timetable", stroke=Y)
    properties["any"]["rowTimes"][0, 0] = regular
    (named,) = read(saved(rec=made("timetable", **properties)))
    np.testing.assert_allclose(named["rec.Time"][1], T, rtol=1e-15)


def test_dates_are_seconds_from_the_first(saved):
    start = 1.7e12
    stamps = made("datetime", data=column(start + 1000 * T), tz=np.array([""]), fmt=np.array([""]))
    (named,) = read(saved(when=stamps, y=column(Y)))
    assert named["when"][0] == "s"
    np.testing.assert_allclose(named["when"][1], T, atol=3e-7)  # milliseconds since 1970 have steps of 0.24 us


def test_a_table_is_a_struct_with_its_units(saved):
    properties = frame("table", t=T, p=Y)
    properties["props"]["VariableUnits"][0, 0] = texts("s", "bar")
    source = saved(rec=made("table", **properties))
    (named,) = read(source)
    assert {name: unit for name, (unit, _) in named.items()} == {"rec.t": "s", "rec.p": "bar"}
    assert source.rasters[0].clock == 0


@pytest.mark.parametrize("regular", [True, False])
def test_a_timeseries_is_a_struct_of_time_and_data(saved, regular):
    times = column([]) if regular else column(T)
    grid = {"Start_": column([0.5]), "Increment_": column([1e-3]), "Length": column([N])}
    about = made("tsdata.timemetadata", Units=np.array(["seconds"]), **grid)
    info = made("tsdata.datametadata", Units=np.array(["mm"]))
    (named,) = read(saved(ts=made("timeseries", Data_=column(Y), Time_=times, TimeInfo=about, DataInfo=info)))
    assert {name: unit for name, (unit, _) in named.items()} == {"ts.time": "s", "ts.data": "mm"}
    np.testing.assert_allclose(named["ts.time"][1], T + 0.5 * regular, rtol=1e-15)
    np.testing.assert_array_equal(named["ts.data"][1], Y)


def test_timeseries_count_from_the_first_start_date(saved):
    def series(date):
        about = made("tsdata.timemetadata", Units=np.array(["seconds"]), StartDate=np.array([date]))
        info = made("tsdata.datametadata", Units=np.array(["mm"]))
        return made("timeseries", Data_=column(Y), Time_=column(T), TimeInfo=about, DataInfo=info)

    first, second = read(saved(a=series("01-May-2024 12:00:01"), b=series("01-May-2024 12:00:00")))
    np.testing.assert_allclose(first["a.time"][1], 1 + T, atol=1e-9)
    np.testing.assert_allclose(second["b.time"][1], T, atol=1e-9)


def test_a_string_is_a_text_such_as_a_unit(saved):
    from matio.utils.converters.matstring import string_to_mat

    unit = made("string", **string_to_mat(np.array([["mm"]])))
    (named,) = read(saved(t=column(T), y=column(Y), y_unit=unit))
    assert named["y"][0] == "mm"


def test_an_object_of_another_class_is_told_with_what_to_do(saved):
    source = saved(y=column(Y), model=made("custom.Governor", gain=column([1.0])), broken=made("duration", x=column(T)))
    assert [list(named) for named in read(source)] == [["y"]]
    assert source.warnings[0].startswith(
        "left out objects, which only MATLAB can read: 'model' (custom.Governor), 'broken' (duration); in MATLAB"
    )


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_without_mat_io_objects_are_told_with_what_to_do(saved, monkeypatch, version):
    path = saved(version, y=column(Y), rec=made("timetable", **frame("timetable", stroke=Y))).path
    monkeypatch.setitem(sys.modules, "matio", None)
    source = mat_file.open_file(path)
    assert [list(named) for named in read(source)] == [["y"]]
    assert "'rec' (timetable); in MATLAB, copy the numbers in them to a struct s; save" in source.warnings[0]


@pytest.mark.parametrize(
    ("fields", "values"),
    [
        (("s0", "s1", "s2", "arr"), (b"d", b"MCOS", b"duration", T)),
        (("_TypeSystem", "_Class", "_ObjectMetadata"), ("MCOS", "duration", T)),
    ],
    ids=["SciPy to 1.17", "SciPy from 1.18"],
)
def test_the_class_of_an_object_is_named_by_whatever_scipy_calls_its_field(fields, values):
    value = np.empty(1, dtype=[(name, "O") for name in fields])
    value[0] = values
    contents = Contents()
    contents.add(("x",), value.view(MatlabOpaque))
    assert contents.objects == {"duration": [("x",)]}
