"""Parquet files, whoever wrote them."""

import datetime

import numpy as np
import polars as pl
import pytest

import clutchid.measurements as cio
from clutchid.errors import DataError
from clutchid.measurements.formats.parquet import file as parquet_file
from clutchid.measurements.opening import open_source
from fixtures.cases import case_tables
from fixtures.sources import everything, tables_of

CASES = case_tables(__file__, "test_parquet")

GOOD = CASES["good"]


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
    columns = GOOD | {"time [ms]": [0.0, None, 0.0]}
    repeated, missing = cio.read(parquet(columns)).warnings
    assert "stamp of an earlier one replace it: 1 (row 3)" in repeated
    assert "without a time stamp are dropped: 1 (row 2)" in missing
    with pytest.raises(DataError, match="row 3 has -1;"):
        cio.read(parquet(columns | {"duty_exhaust [1]": [0.0, 0.0, -1.0]}))


def test_holes_are_located_by_row(parquet):
    columns = {name: [*values, 3, 4][:5] for name, values in GOOD.items()} | {"time [ms]": [0, 1, 2, 30, 31]}
    columns |= {"duty_exhaust [1]": [0] * 5}
    assert "0.028 s between rows 3 and 4" in cio.read(parquet(columns)).warnings[0]


@pytest.mark.parametrize("values", [["a", "b", "c"], [True, False, True], [datetime.date(2024, 1, 1)] * 3])
def test_a_column_that_holds_no_numbers(parquet, values):
    words = r"column 'position \[mm\]' holds (text|truth values|dates); write numbers \(Float64\)"
    with pytest.raises(DataError, match=words):
        cio.read(parquet(GOOD | {"position [mm]": values}))
    log = cio.read(parquet(GOOD | {"comment": values}))
    assert any("'comment'" in warning and "left out" in warning for warning in log.warnings)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({name: pl.Series([], dtype=pl.Float64) for name in GOOD}, "there are columns, but no samples;"),
        ({"a": [1.0]}, "no columns 'time'"),
    ],
)
def test_a_table_without_samples_or_columns(parquet, columns, words):
    with pytest.raises(DataError, match=words):
        cio.read(parquet(columns))


@pytest.mark.parametrize("share", [0.02, 0.5, 0.9, 0.99])
def test_a_truncated_file(parquet, save, share):
    data = parquet(GOOD).read_bytes()
    with pytest.raises(DataError, match=r"is not a complete Parquet file, or .* \(.*\); copy it again"):
        cio.read(save(data[: max(4, int(share * len(data)))], "cut.parquet"))


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
    return everything(parquet_file.open_file(path), rows)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_and_times_become_seconds_from_the_first(parquet, unit):
    noon = datetime.datetime(2024, 5, 1, 12)
    stamps = [noon, noon + datetime.timedelta(milliseconds=1500), None]
    source, _, columns = read(parquet({"Time": pl.Series(stamps, dtype=pl.Datetime(unit)), "x": [1, 2, 3]}))
    np.testing.assert_array_equal(columns[0], [0, 1.5, np.nan])
    assert source.rasters[0].headings[0].unit == "s"
    assert source.metadata["start"] == "2024-05-01 12:00:00"


@pytest.mark.parametrize("stored", ["int96", "s", "ms", "us", "ns"])
@pytest.mark.parametrize("year", [1, 1600, 1969, 2024, 2300, 9999])
def test_stamps_of_any_year_are_read_in_any_unit(tmp_path, stored, year):
    arrow, arrow_parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    if stored == "ns" and not 1677 < year < 2262:
        return  # 64 bits do not hold them
    unit = "us" if stored == "int96" else stored
    step = {"s": 1.0, "ms": 2e-3, "us": 2e-3, "ns": 2e-3}[unit]
    count = np.arange(200) * round(step * {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit])
    stamps = (np.datetime64(f"{year:04d}-06-01", unit) + count).astype(f"datetime64[{unit}]")
    columns = {
        "time": arrow.array(stamps),
        **{f"{name} [1]": np.zeros(200) for name in ("duty_supply", "duty_exhaust")},
    }
    columns["position [m]"] = np.arange(200) * 1e-5
    path = tmp_path / "run.parquet"
    arrow_parquet.write_table(
        arrow.table(columns), path, store_schema=False, use_deprecated_int96_timestamps=stored == "int96"
    )
    log = cio.read(path)
    assert log.time == pytest.approx(np.arange(200) * step, abs=1e-9)
    assert log.metadata["start"] == f"{year:04d}-06-01 00:00:00"


def test_truth_values_of_a_valve_are_one_and_zero(parquet):
    log = cio.read(parquet(GOOD | {"duty_exhaust [1]": [True, False, None]}))
    np.testing.assert_array_equal(log["duty_exhaust"], [1, 0, np.nan])


@pytest.mark.parametrize(
    ("claim", "reason"),
    [
        ([0xFF, 127], ("the reader process crashed while reading it")),
        ([0xFE] * 4 + [15], "is not a complete Parquet file, or"),
    ],
)
def test_a_page_that_claims_more_samples_than_the_file_is_one_sentence(tmp_path, claim, reason):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"x": np.arange(300.0)}).write_parquet(path, compression="uncompressed", use_pyarrow=False)
    content = path.read_bytes()
    header = bytes([0x15, 0xD8, 4])  # 300 as a field of the header of a page
    assert header in content[:400]
    path.write_bytes(content.replace(header, bytes([0x15, *claim]), 1))
    with pytest.raises(DataError, match=reason):
        raise DataError(*next(open_source(path).tables(0, [0])).problems)


def test_columns_without_numbers_are_named_with_what_they_hold_and_not_loaded(tmp_path):
    path = tmp_path / "run.parquet"
    others = {"note": ["a", "b"], "raw": [b"a", b"b"], "pair": [[1, 2], [3]], "rec": [{"a": 1}, {"a": 2}]}
    pl.DataFrame({"x": [1.0, 2.0], **others, "day": [datetime.date(2024, 5, 1)] * 2}).write_parquet(path)
    source, _, columns = read(path)
    (raster,) = source.rasters
    assert [heading.text for heading in raster.headings] == ["x"]
    held = (("note", "text"), ("raw", "bytes"), ("pair", "lists"), ("rec", "structures"), ("day", "dates"))
    assert raster.others == held
    assert source.warnings == (
        "left out channels without numbers (5): 'note' (text), 'raw' (bytes), 'pair' (lists) and 2 more.",
    )
    np.testing.assert_array_equal(columns, [[1, 2]])


def test_a_file_without_numbers_says_what_it_holds(parquet):
    source = parquet_file.open_file(parquet({"note": ["a"], "raw": [b"b"]}))
    assert source.problems == ("holds no column of numbers; write the channels as Float64.",)
    assert source.warnings == ("left out channels without numbers (2): 'note' (text), 'raw' (bytes).",)


def test_damaged_pages_of_a_text_column_do_not_matter(data):
    source, tables, columns = read(data("foreign_files/parquet/data_nation.dict-malformed.parquet"))
    assert (source.problems, [table.problems for table in tables]) == ((), [()])
    np.testing.assert_array_equal(columns[0], np.arange(25))


@pytest.mark.parametrize("name", CASES["an_encrypted_file_is_refused_as_such"])
def test_an_encrypted_file_is_refused_as_such(data, name):
    source = parquet_file.open_file(data(f"foreign_files/parquet/{name}"))
    assert (source.problems or tables_of(source)[0].problems) == (
        "is encrypted; decrypt it with the program that wrote it, or write it again without encryption.",
    )


@pytest.mark.parametrize(("name", "words"), CASES["what_polars_does_not_read_is_refused"])
def test_what_polars_does_not_read_is_refused_with_its_reason(data, name, words):
    (problem,) = parquet_file.open_file(data(f"foreign_files/parquet/{name}")).problems
    assert problem == (
        f"is not a complete Parquet file, or has columns of a kind that polars cannot read ({words}); copy it again, "
        "or write its channels as Float64."
    )


def test_columns_of_one_name_are_refused_by_it(tmp_path):
    arrow, arrow_parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    arrays = [arrow.array(values) for values in ([1.0, 2.0], [0.1, 0.2], [4.0, 5.0])]
    arrow_parquet.write_table(arrow.Table.from_arrays(arrays, names=["p", "t", "p"]), tmp_path / "run.parquet")
    (problem,) = parquet_file.open_file(tmp_path / "run.parquet").problems
    assert "'p'" in problem


STAMPS = np.datetime64("2024-05-01T12", "us") + np.arange(3) * np.timedelta64(4000, "us")


@pytest.mark.parametrize(
    ("columns", "milliseconds"),
    [
        ({"__index_level_0__": STAMPS - STAMPS[0]}, 4),
        ({"__index_level_0__": STAMPS}, 4),
        ({"__index_level_0__": STAMPS, "time [ms]": [0, 1, 2]}, 1),
        ({"__index_level_0__": STAMPS, "Zeit [ms]": [0, 1, 2]}, 1),
        ({"__index_level_0__": [0, 2, 5]}, None),
        ({"day": STAMPS}, None),
    ],
    ids=["durations", "dates", "a named time", "a word for the time", "numbers of rows", "no index"],
)
def test_dates_and_durations_in_the_index_of_pandas_are_the_time(parquet, columns, milliseconds):
    path = parquet({name: values for name, values in GOOD.items() if name != "time [ms]"} | columns)
    if milliseconds is None:
        with pytest.raises(DataError, match="no column 'time'"):
            cio.read(path)
    else:
        assert cio.read(path).time == pytest.approx(np.arange(3) * 1e-3 * milliseconds, abs=1e-12)


@pytest.mark.slow
def test_a_small_file_with_sixty_million_rows_is_read_block_by_block(tmp_path):
    path = tmp_path / "bomb.parquet"
    pl.DataFrame({"x": pl.zeros(60_000_000, eager=True)}).write_parquet(path)
    assert path.stat().st_size < 1e6
    source = open_source(path)
    assert sum(table.size for table in source.tables(0, [0], 1 << 20)) == 60_000_000
