"""CSV as it comes from everywhere: the content tells how it is written."""

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import clutchid.measurements as cio
from clutchid.errors import DataError
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.formats.csv import text as csv_text
from clutchid.measurements.formats.csv.cells import nanoseconds
from clutchid.measurements.formats.csv.cells import written as in_iso
from clutchid.measurements.formats.csv.file import open_file
from clutchid.measurements.grids import with_own_grids
from fixtures.cases import case_tables, cases
from fixtures.sources import everything

pytestmark = pytest.mark.slow


def read(path, rows=None):
    """The source, its tables, and the numbers of every column."""
    source, tables, columns = everything(open_file(path), rows)
    return source, tables, [column.tolist() for column in columns]


def heading(column):
    return f"{column.name or '-'} [{column.unit or '-'}]"


@pytest.mark.parametrize("table", cases(__file__, "csv_tables"))
def test_a_table_is_read_as_its_content_tells(save, parser, table):
    source, tables, columns = read(save(table["text"]))
    (raster,), (samples, *_) = source.rasters, tables
    seen = {
        "texts": [column.text for column in raster.headings],
        "headings": [heading(column) for column in raster.headings],
        "first": samples.places.number(0),
        "clock": raster.clock,
    }
    for name in seen.keys() & table.keys():
        values = seen[name][: len(table[name])] if isinstance(table[name], list) else seen[name]
        assert values == table[name], name
    for i, values in enumerate(table.get("columns", ())):
        np.testing.assert_array_equal(columns[i], values)
    sentences = {
        "dialect": source.metadata["dialect"], "unnamed": source.unnamed, "warning": "".join(source.warnings),
        "refused": "".join(source.problems), "problem": "".join(samples.problems),
    }  # fmt: skip
    for name, said in sentences.items():
        assert table.get(name, "") in said
        assert bool(said) == bool(table[name]) if name in table else not said or name not in ("problem", "refused")
    assert source.metadata.keys() <= {"dialect", "start"}


WORDS = ["-nan(ind)", "#DIV/0!", "NaN", "nan", "NA", "n/a", "-", "#N/A", "null", "", " ", "NULL", "None", "--",
         "1.#QNAN", " n/a "]  # fmt: skip


@pytest.mark.parametrize("word", WORDS)
def test_words_of_a_missing_sample(save, parser, word):
    _, tables, columns = read(save(f"time [s];position [mm]\n0;{word}\n{word};0.5\n1;1.5\n"))
    np.testing.assert_array_equal(columns, [[0, np.nan, 1], [np.nan, 0.5, 1.5]])
    assert tables[0].problems == ()


STAMPS = case_tables(__file__, "csv_stamps")


@pytest.mark.parametrize(("first", "second", "start"), STAMPS["pairs"])
@pytest.mark.parametrize("name", ["Time", "time [ms]", "Zeitstempel"])
def test_stamps_become_seconds_from_the_first(save, parser, first, second, start, name):
    source, tables, columns = read(save(f"{name};x\n{first};1,5\n{second};2,5\n-;3\n"))
    np.testing.assert_array_equal(columns[0], [0, 1.5, np.nan])
    assert source.metadata["start"] == start
    assert source.rasters[0].clock == 0
    assert source.rasters[0].headings[0].unit == "s"
    assert tables[0].problems == ()


def test_the_seconds_go_on_over_the_blocks(save, parser):
    path = save("Time;x\n" + "".join(f"12:00:{second:02}.5;{second},5\n" for second in range(60)))
    _, tables, columns = read(path, rows=7)
    assert columns == [list(range(60)), [second + 0.5 for second in range(60)]]
    assert [table.size for table in tables] == [7] * 8 + [4]
    assert [table.places.number(0) for table in tables] == [2 + 7 * block for block in range(9)]


@pytest.mark.parametrize("telling", ["0,5", "0,123", "12,25", "1,2345", "1234,567", "1,234e2"])
def test_one_cell_that_can_only_be_read_one_way_tells_the_decimal_mark_even_far_down(save, parser, telling):
    text = "time [s];position [mm]\n" + "1;1,234\n" * 5000 + f"2;{telling}\n"
    _, tables, columns = read(save(text))
    assert columns[1][0] == 1.234
    assert columns[1][-1] == float(telling.replace(",", "."))
    assert tables[0].problems == ()


def test_blocks_have_the_same_numbers_lines_and_problems_as_the_whole(save, parser, monkeypatch):
    monkeypatch.setattr(csv_text, "CHUNK", 64)
    text = "time [s],position [m],note\n" + "".join(f"{i},{i / 8},\n" for i in range(100))
    text = text.replace("\n50,6.25,", "\n50,x,").replace("\n70,8.75,\n", "\n70\n\n")
    source, (whole,), columns = read(save(text))
    _, tables, pieces = read(save(text), rows=9)
    np.testing.assert_array_equal(pieces, columns)
    assert max(table.size for table in tables) <= 9
    lines = [table.places.number(row) for table in tables for row in range(table.size)]
    assert lines == [whole.places.number(row) for row in range(whole.size)]
    assert [problem for table in tables for problem in table.problems] == list(reversed(whole.problems))
    assert source.rasters[0].size == 101


def test_only_the_asked_columns_are_read(save, parser):
    source = open_file(save("time [s];a;b\n0;low;0,5\n1;high;x\n"))
    (table,) = source.tables(0, [0])
    assert list(table.numbers) == [0]
    assert table.problems == ()


def numbers_of(generator, shape):
    """Any bits, few decimals, and numbers at the borders of a double."""
    bits = generator.integers(0, 2**64, shape, dtype=np.uint64).view(float)
    borders = [0.0, -0.0, 1.0, np.inf, -np.inf, 5e-324, 1e16, 2.0**53 + 2, np.finfo(float).max]
    kinds = np.nan_to_num(bits), generator.uniform(-100, 100, shape).round(3), generator.choice(borders, shape)
    return np.choose(generator.integers(0, 3, shape), kinds)


@st.composite
def written(draw):
    """A table of numbers, and its text in a dialect drawn at random."""
    width, height = draw(st.integers(2, 5)), draw(st.integers(1, 30))
    values = numbers_of(np.random.default_rng(draw(st.integers(0, 2**32))), (height, width)).tolist()
    values[-1] = [0.5] * width  # a cell that tells the decimal mark
    separator = draw(st.sampled_from([",", ";", "\t", "|", "  "]))
    decimal = draw(st.sampled_from([".", ","]))
    quoted = (separator == "," and decimal == ",") or (separator != "  " and draw(st.booleans()))
    lack = draw(st.sampled_from(["nan", "n/a", "NULL", "-"] + ["", " "] * (separator != "  ")))
    lacking = (
        draw(st.sets(st.tuples(st.integers(0, height - 2), st.integers(1, width - 1)), max_size=9))
        if height > 1
        else ()
    )
    rows = [[repr(value).replace(".", decimal) for value in row] for row in values]
    for row, column in lacking:
        rows[row][column], values[row][column] = lack, np.nan
    if quoted:
        rows = [[f'"{cell}"' for cell in row] for row in rows]
    labels = [["s", "mm", "bar(g)", "%", "rpm"][index] for index in range(width)]
    words = ["Zeit", "Weg A", "Druck", "Ventil", "Drehzahl"][:width]
    style = draw(st.sampled_from(["{} [{}]", "{} ({})", "{} / {}", "row"]))
    header = [words, labels] if style == "row" else [list(map(style.format, words, labels))]
    remarks = ["# comment", "Rig;7", "% more, of it", "// second line", "; an INI comment", "Datum: gestern", ""]
    above = draw(st.lists(st.sampled_from(remarks), max_size=4))
    below = draw(st.sampled_from(["", "\n", "\n\n \n"]))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = end.join([*above, *(separator.join(cells) for cells in header + rows)]) + below.replace("\n", end)
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "cp1252"]))
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    return np.array(values), labels, (mark + text).encode(encoding)


@settings(max_examples=150, deadline=None)
@given(
    table=written(),
    way=st.sampled_from(["numpy", "polars", "csv"]),
    rows=st.sampled_from([None, 1, 7]),
    chunk=st.sampled_from([1, 7, 1 << 20]),
)
def test_whatever_table_in_whatever_dialect_is_read_back_exactly(tmp_path_factory, force, table, way, rows, chunk):
    values, labels, content = table
    path = tmp_path_factory.mktemp("dialect") / "run.csv"
    path.write_bytes(content)
    with pytest.MonkeyPatch.context() as patch:
        force(way, patch)
        patch.setattr(csv_text, "CHUNK", chunk)
        source, tables, columns = read(path, rows)
    np.testing.assert_array_equal(np.array(columns).T, values)
    assert [column.unit for column in source.rasters[0].headings] == labels
    assert [problem for table in tables for problem in table.problems] == []


@settings(max_examples=300, deadline=None)
@given(
    content=st.one_of(st.binary(max_size=80), st.text(alphabet="ab01.,;|\t \"'#%[]()/-:\n\r", max_size=80)),
    small=st.booleans(),
)
def test_whatever_bytes_give_tables_or_sentences(tmp_path_factory, content, small):
    path = tmp_path_factory.mktemp("bytes") / "run.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_file, "_SMALL", 1e9 * small)
        source = open_file(path)
        for raster in source.rasters:
            whole, *rest = source.tables(0, range(len(raster.headings)))
            assert rest == []
            pieces = list(source.tables(0, [0], 2))
            if not {'"', 34} & set(content):  # a quoted cell over several lines is only whole in the whole
                assert sum(table.size for table in pieces) == whole.size
            assert all(column.size == whole.size for column in whole.numbers.values())
    assert source.rasters or source.problems


def test_a_line_without_end_is_no_table(save):
    assert open_file(save("a," * (1 << 20))).problems[0].startswith("line 1 has more than 10,000 cells")
    assert open_file(save("a" * (1 << 21))).problems[0].startswith("the file has no table")


def test_a_table_on_its_side_is_refused(save):
    (problem,) = open_file(save("# rig\n" + "0;" * 20000 + "0\n")).problems
    assert problem == "line 2 has more than 10,000 cells; write one column per channel and one line per sample."


def test_every_recording_of_an_actuator_opens(shared):
    folder = shared / "data"
    # the test files of other readers are spoiled on purpose, and those of the hunt are hard to read
    files = [path for path in folder.rglob("*") if not {"foreign_files", "hunt"} & {*path.relative_to(folder).parts}]
    contents = {path.name: read(path) for path in files if path.suffix == ".csv" or path.stem == "test_data_2"}
    assert (
        contents["Circle_5bar.csv"][0].metadata["dialect"] == "UTF-8, tab, decimal point, no names, samples from line 1"
    )
    assert len(contents["Circle_5bar.csv"][2]) == 7
    headings = contents["test_data_2.txt"][0].rasters[0].headings
    assert list(map(heading, headings))[:3] == ["time [s]", "- [uN]", "position [mm]"]
    assert len(contents["test_data_2.txt"][2][0]) == 42579
    assert contents["cylinder_1kHz.csv"][2][3][0] == 100000.0
    assert contents["worn1.csv"][0].rasters[0].clock == 0
    assert "line 11 has '1.002.000'" in contents["Prusa.csv"][1][0].problems[0]
    with_problems = {name for name, (_, tables, _) in contents.items() if tables[0].problems}
    assert with_problems == {"Prusa.csv", "Formlabs.csv"}


@pytest.mark.parametrize(("cell", "stamp"), STAMPS["written"])
def test_dates_and_times_are_read_as_they_are_written(cell, stamp):
    assert in_iso(cell) == stamp
    assert nanoseconds(cell) == nanoseconds(stamp)
    assert nanoseconds(cell) is not None


@pytest.mark.parametrize("form", ["12:00:{:02d}.{}", "12:00:{:02d}:{}", "{}.{}", "2024-05-01T12:00:{:02d}.{}"])
@pytest.mark.parametrize("interval", [2, 10])
def test_milliseconds_without_their_zeros_are_refused(save, form, interval):
    rows = [f"{form.format(*divmod(k * interval, 1000))},{k / 100},0,0\n" for k in range(400)]
    path = save("time [s],position [mm],duty_supply [1],duty_exhaust [1]\n" + "".join(rows))
    with pytest.raises(DataError, match=r"the fraction \d+ is followed by 1\d+, so they lack zeros"):
        cio.read(path)


@pytest.mark.parametrize("form", ["{:.3f}", "{:g}", "{:.1f}", "12:00:{:06.3f}"])
def test_fractions_of_any_length_are_read(save, form):
    rows = [f"{form.format(k / 500)},{k / 100},0,0\n" for k in range(400)]
    source = open_file(save("time [s],position [mm],duty_supply [1],duty_exhaust [1]\n" + "".join(rows)))
    assert source.problems == ()


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_truth_under_percent_is_a_valve_that_is_open_or_closed(tmp_path, suffix):
    k = np.arange(60)
    table = pl.DataFrame(
        {"time [s]": k / 10, "position [mm]": k / 10, "duty_supply [%]": k % 2 > 0, "duty_exhaust [%]": k < 5}
    )
    path = tmp_path / f"run.{suffix}"
    table.write_csv(path) if suffix == "csv" else table.write_parquet(path)
    log = cio.read(path)
    assert log["duty_supply"].tolist() == (k % 2).tolist()
    assert log["duty_exhaust"].tolist() == (k < 5).tolist()


@pytest.mark.parametrize("second", ["time [ms] (2)", "time [ms].1", "time_2"])
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_second_time_has_the_unit_of_the_first(tmp_path, suffix, second):
    k = np.arange(60)
    columns = {
        "time [ms]": 10.0 * k,
        "position [mm]": k,
        second: 10.0 * k,
        "duty_supply [%]": k,
        "duty_exhaust [%]": 60 - k,
    }
    path = tmp_path / f"run.{suffix}"
    table = pl.DataFrame(columns)
    table.write_csv(path) if suffix == "csv" else table.write_parquet(path)
    log = cio.read(path)
    np.testing.assert_allclose(log["duty_supply"], log["position"] * 10.0)
    guessed = "has no unit; [ms], the unit of the other times of the table, is guessed"
    assert any(guessed in text for text in log.warnings) == (second == "time_2")


def test_a_second_time_that_spans_a_thousandth_of_the_first_is_not_in_its_unit(tmp_path):
    k = np.arange(60)
    columns = {"time [ms]": 10 * k, "position [mm]": k, "time": 0.01 * k, "duty_supply [%]": k, "duty_exhaust [%]": k}
    path = tmp_path / "run.csv"
    pl.DataFrame(columns).write_csv(path)
    _, second = with_own_grids(open_file(path)).rasters
    assert [heading.unit for heading in second.headings if heading.name == "time"] == [None]


@pytest.mark.parametrize("cell", STAMPS["none"])
def test_times_that_are_not_read_are_named_with_how_to_write_them(save, cell):
    rows = "".join(f"{cell};{i};{i % 2};{(i + 1) % 2}\n" for i in range(9))
    with pytest.raises(DataError, match="time: 'Zeit' holds text; write seconds, or times such as 2024-05-01T12:00:00"):
        cio.read(save("Zeit;Weg [mm];Ventil_Be [%];Ventil_Ent [%]\n" + rows))


def test_a_time_that_counts_down_does_not_lack_zeros(save):
    rows = "".join(f"{k / 100},{k},{k % 2},{k % 2},{12.9 - k / 20:.6g}\n" for k in range(250))
    names = "time [s],position [mm],duty_supply [%],duty_exhaust [%],remaining time"
    assert open_file(save(f"{names}\n{rows}")).problems == ()
