"""Parquet files, whoever wrote them."""

import datetime

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import clutchid.io as cio
from clutchid.errors import DataError
from clutchid.io.formats.parquet import file as parquet_file
from clutchid.io.formats.parquet.pages import damage

GOOD = {
    "time [ms]": [0, 1, 2],
    "position [mm]": [0, 1, 2],
    "duty_supply [%]": [0, 50, 100],
    "duty_exhaust [1]": [0, 0, 0],
}


@pytest.fixture
def parquet(tmp_path):
    def make(columns, name="run.parquet"):
        path = tmp_path / name
        with path.open("wb") as file:
            pl.DataFrame(columns).write_parquet(file)
        return path

    return make


def test_the_content_tells_the_format_not_the_suffix(parquet, recording, save):
    log = cio.read(parquet(GOOD, "run.csv"))
    assert log["position"].tolist() == [0.0, 0.001, 0.002]
    assert log["duty_supply"].tolist() == [0.0, 0.5, 1.0]
    assert log.metadata["source"] == "run.csv"
    assert len(cio.read(save(recording(4), "run.parquet"))) == 4


def test_every_kind_of_number_is_read_and_null_is_missing(parquet):
    columns = GOOD | {
        "velocity [m/s]": pl.Series([1, None, 3], dtype=pl.Float32),
        "pressure_a [bar]": pl.Series([1, 2, None], dtype=pl.UInt8),
        "pressure_b [Pa]": pl.Series([None, None, None], dtype=pl.Null),
    }
    log = cio.read(parquet(columns))
    np.testing.assert_array_equal(log["velocity"], [1, np.nan, 3])
    np.testing.assert_array_equal(log["pressure_a"], [1e5, 2e5, np.nan])
    assert np.isnan(log["pressure_b"]).all()


def test_problems_are_located_by_row(parquet):
    columns = GOOD | {"time [ms]": [0.0, None, 0.0], "duty_exhaust [1]": [0.0, -1.0, 0.0]}
    with pytest.raises(DataError) as caught:
        cio.read(parquet(columns))
    text = str(caught.value)
    assert "'time [ms]' is missing in row 2;" in text
    assert "row 3 has 0 ms after 0 ms;" in text
    assert "row 2 has -1;" in text


def test_holes_are_located_by_row(parquet):
    columns = {name: [*values, 3, 4][:5] for name, values in GOOD.items()} | {"time [ms]": [0, 1, 2, 30, 31]}
    columns |= {"duty_exhaust [1]": [0] * 5}
    assert "0.028 s between rows 3 and 4" in cio.read(parquet(columns)).warnings[0]


@pytest.mark.parametrize("values", [["a", "b", "c"], [True, False, True], [datetime.date(2024, 1, 1)] * 3])
def test_a_column_that_holds_no_numbers(parquet, values):
    with pytest.raises(DataError, match=r"column 'position \[mm\]' holds .* values; write numbers \(Float64\)"):
        cio.read(parquet(GOOD | {"position [mm]": values}))
    log = cio.read(parquet(GOOD | {"comment": values}))
    assert log.warnings[0].startswith("column 'comment' is not known and left out;")


def test_a_table_without_samples(parquet):
    with pytest.raises(DataError, match="there are columns, but no samples;"):
        cio.read(parquet({name: pl.Series([], dtype=pl.Float64) for name in GOOD}))


def test_a_table_without_columns(parquet):
    with pytest.raises(DataError, match="no columns 'time'"):
        cio.read(parquet({"a": [1.0]}))


@pytest.mark.parametrize("kept", [0.02, 0.5, 0.9, 0.99])
def test_a_truncated_file(parquet, save, kept):
    data = parquet(GOOD).read_bytes()
    with pytest.raises(DataError, match=r"is no complete Parquet file \(.*\); copy or write it again"):
        cio.read(save(data[: max(4, int(kept * len(data)))], "cut.parquet"))


def test_names_with_wildcards_and_folders_with_equal_signs_are_names(parquet, tmp_path):
    (tmp_path / "time=3").mkdir()
    assert len(cio.read(parquet(GOOD, "time=3/run[1]*.parquet"))) == 3


@pytest.mark.parametrize(("text", "expected"), [(None, {}), ("{", {}), ("[1]", {}), ('{"truck": 7}', {"truck": "7"})])
def test_metadata_of_other_programs_do_no_harm(tmp_path, text, expected):
    metadata = {"program": "other"} if text is None else {"clutchid": text}
    pl.DataFrame(GOOD).write_parquet(tmp_path / "run.parquet", metadata=metadata)
    source = parquet_file.open_file(tmp_path / "run.parquet")
    assert (source.metadata, source.problems) == (expected, ())
    assert source.rasters[0].size == 3


def read(path, rows=None):
    """The source, its tables, and the numbers of every column."""
    source = parquet_file.open_file(path)
    tables = list(source.tables(0, range(len(source.rasters[0].headings)), rows))
    columns = [np.concatenate([table.numbers[index] for table in tables]) for index in tables[0].numbers]
    return source, tables, columns


@pytest.mark.parametrize("rows", [None, 1, 7, 100, 1000])
def test_blocks_are_the_whole_in_pieces_and_count_on(tmp_path, rows):
    frame = pl.DataFrame({"time [s]": np.arange(100) / 10, "x": np.arange(100), "note": ["a"] * 100})
    frame.write_parquet(tmp_path / "run.parquet", row_group_size=16)
    source, tables, columns = read(tmp_path / "run.parquet", rows)
    assert (source.format, source.rasters[0].size, source.rasters[0].clock) == ("Parquet", 100, 0)
    np.testing.assert_array_equal(columns[:2], [np.arange(100) / 10, np.arange(100)])
    assert np.isnan(columns[2]).all()
    places = [table.places.number(row) for table in tables for row in range(table.size)]
    assert places == list(range(1, 101))
    assert max(table.size for table in tables) == min(rows or 100, 100)


def test_only_the_asked_columns_are_read(parquet):
    source = parquet_file.open_file(parquet(GOOD))
    (table,) = source.tables(0, [2])
    assert {index: values.tolist() for index, values in table.numbers.items()} == {2: [0, 50, 100]}


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_and_times_become_seconds_from_the_first(parquet, unit):
    noon = datetime.datetime(2024, 5, 1, 12)
    stamps = [noon, noon + datetime.timedelta(milliseconds=1500), None]
    source, _, columns = read(parquet({"Time": pl.Series(stamps, dtype=pl.Datetime(unit)), "x": [1, 2, 3]}))
    np.testing.assert_array_equal(columns[0], [0, 1.5, np.nan])
    assert source.rasters[0].headings[0].unit == "s"
    assert source.metadata["start"] == "2024-05-01 12:00:00"


def test_truth_values_of_a_valve_are_one_and_zero(parquet):
    log = cio.read(parquet(GOOD | {"duty_exhaust [1]": [True, False, None]}))
    np.testing.assert_array_equal(log["duty_exhaust"], [1, 0, np.nan])


@pytest.mark.parametrize("compression", ["zstd", "snappy", "lz4", "gzip", "brotli", "uncompressed"])
def test_a_whole_file_is_not_taken_for_a_damaged_one(tmp_path, compression):
    columns = {"x": np.arange(5000.0), "y": ["a", None, "b", "c", "d"] * 1000, "z": [[1, 2], []] * 2500}
    pl.DataFrame(columns).write_parquet(tmp_path / "x", compression=compression, row_group_size=999)
    assert damage(tmp_path / "x") == ""


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused_in_a_sentence(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damaged") / "run.parquet"
    pl.DataFrame(GOOD).write_parquet(path)
    content = bytearray(path.read_bytes())
    for place in data.draw(st.lists(st.integers(4, len(content) - 1), max_size=4)):
        content[place] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content[: data.draw(st.integers(4, len(content)))])
    source = parquet_file.open_file(path)
    assert source.problems or all(table.size >= 0 for table in source.tables(0, [0, 1], 2))


def test_a_page_that_claims_more_samples_than_the_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"x": np.arange(300.0)}).write_parquet(path, compression="uncompressed", use_pyarrow=False)
    content = path.read_bytes()
    header = bytes([0x15, 0xD8, 4])  # 300 as a field of the header of a page
    assert header in content[:400]
    path.write_bytes(content.replace(header, bytes([0x15, 0xFF, 127]), 1))
    (problem,) = parquet_file.open_file(path).problems
    assert problem.startswith("is no complete Parquet file (the page before byte")
