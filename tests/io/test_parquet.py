"""Parquet files, whoever wrote them."""

import datetime

import numpy as np
import polars as pl
import pytest

import clutchid.io as cio
from clutchid.errors import DataError
from clutchid.io import parquet_file

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
def test_metadata_of_other_programs_do_no_harm(text, expected):
    assert parquet_file._metadata(text) == expected
