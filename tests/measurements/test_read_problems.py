"""Files that cannot be used: every problem, with its line and column, at once."""

import re
from pathlib import Path

import numpy as np
import pytest

import clutchid.measurements as cio
from clutchid.errors import DataError
from clutchid.files import atomic_write
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.map.channel_map import Channel, ChannelMap


def problems(path):
    """The problems that `read` reports, one a line, without the file name and bullets."""
    with pytest.raises(DataError) as caught:
        cio.read(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    text = text.removeprefix(f"{path}: ")
    return text.split("\n  - ")[1:] if "\n" in text else [text]


@pytest.mark.parametrize("text", ["", "\n\n", "# only\n# comments\n", "\ufeff"])
def test_an_empty_file(save, text):
    (problem,) = problems(save(text))
    assert problem.startswith("the file is empty; a header such as time [s],position [m],")


def test_a_header_without_samples(recording, save):
    assert problems(save("# rig\n" + recording(0))) == ["line 2: there is a header, but no samples below it."]


def test_samples_without_a_header(recording, save):
    (problem,) = problems(save(recording(3).split("\n", 1)[1]))
    assert problem.startswith("line 1: the first line contains numbers; a header such as")


def test_missing_columns_are_reported_in_one_sentence(save):
    (problem,) = problems(save("time [s],positon [mm],gear [1]\n0,0,0\n"))
    assert problem == (
        "no columns 'position' (write position [m]; is it 'positon [mm]'?), "
        "'duty_supply' (write duty_supply [1]), 'duty_exhaust' (write duty_exhaust [1]); "
        "its columns are 'time [s]', 'positon [mm]', 'gear [1]'."
    )


@pytest.mark.parametrize(
    ("heading", "lacking"),
    [
        ("Zeit;Weg [mm];Ventil Belueften [%];Ventil Entlueften [%]", {"time": "Zeit [s]"}),
        ("Zeit [s];Weg;Ventil Belueften [%];Ventil Entlueften [%]", {"position": "Weg [mm]"}),
        ("Zeit;Position [mm];Ventil Belueften [%];Ventil Entlueften [%]", {"time": "Zeit [s]"}),
        ("t;clutch_travel;pwm_inlet_valve [%];pwm_outlet_valve", {"time": "t [s]", "position": "clutch_travel [mm]",
                                                                  "duty_exhaust": "pwm_outlet_valve [%]"}),
    ],
)  # fmt: skip
def test_columns_of_other_names_that_lack_only_a_unit_are_named_with_what_to_write(save, heading, lacking):
    rows = [f"{k / 1000};{k * 0.5};{100 * (k % 2)};{100 * (k % 3 == 0)}" for k in range(9)]
    sentences = problems(save("\n".join([heading, *rows]).replace(".", ",")))
    units = [f"'{text}'" for text in lacking.values()]
    assert f"write units in brackets behind the names: {', '.join(units)}, if that is right." in sentences
    for name, text in lacking.items():
        assert any(sentence.startswith(f"{name}: '{text.partition(' [')[0]}' has no unit;") for sentence in sentences)
    assert not any("no column" in sentence for sentence in sentences)


def test_cells_that_are_no_numbers(recording, save):
    cells = {(i, 1): f"bad{i}" for i in range(2, 9)} | {(3, 4): "0,5 bar"[:3].replace(",", "_"), (4, 2): "١"}
    position, duty, pressure = problems(save(recording(10, cells)))
    assert position == (
        "column 'position [m]' contains cells that are not numbers: line 4 has 'bad2', line 5 has 'bad3', line 6 has "
        "'bad4', line 7 has 'bad5', line 8 has 'bad6' and 2 more; "
        "write a number like 0.0125, or leave the cell empty where the sample is missing."
    )
    assert "column 'duty_supply [1]' contains cells that are not numbers: line 6 has '١';" in duty
    assert "column 'pressure_a [Pa]' contains cells that are not numbers: line 5 has '0_5';" in pressure


def test_texts_that_are_no_numbers_are_short_and_a_decimal_comma_is_pointed_out(recording, save):
    text = recording(4, {(1, 1): "0,5"}).replace(",", ";").replace("0;5;", "0,5;")
    assert "line 3 has '0,5'; write a number with a decimal point" in problems(save(text))[0]
    (problem,) = problems(save(recording(3, {(1, 1): "x" * 5000})))
    assert len(problem) < 300


@pytest.mark.parametrize("small", [0, 1e9])
def test_lines_with_too_few_or_too_many_cells(recording, save, small, monkeypatch):
    monkeypatch.setattr(csv_file, "_SMALL", small)
    lines = recording(9).splitlines()
    lines[3] += ",1"
    for i in range(4, 9):
        lines[i] = lines[i].rsplit(",", 1)[0]
    assert "line 4 has 6, line 5 has 4;" in problems(save("\n".join(lines[:5]) + "\n"))[0], "they do not cancel out"
    (problem,) = problems(save("\n".join(lines) + "\n"))
    assert problem == (
        "the header has 5 cells, but line 4 has 6, line 5 has 4, line 6 has 4, line 7 has 4, line 8 has 4 and 1 more; "
        "give every line one cell for each column, empty where a sample is missing."
    )


def test_an_open_quotation_mark(recording, save):
    (problem,) = problems(save(recording(3) + '"' + "1,2,3\n" * 50000))
    assert problem.startswith("line 5: cannot be split into cells")
    assert "is a quotation mark left open?" in problem


def test_too_few_cells_far_down_are_not_taken_for_missing_samples(recording, save, monkeypatch):
    monkeypatch.setattr(csv_file, "_SMALL", 0)
    lines = recording(5000).splitlines()
    lines[4000] = lines[4000].rsplit(",", 1)[0]
    (problem,) = problems(save("\n".join(lines)))
    assert "line 4001 has 4;" in problem


def test_a_sample_without_a_time_is_dropped_and_counted(recording, save):
    log = cio.read(save(recording(9, {(3, 0): "", (4, 0): "nan", (7, 0): "inf"})))
    assert np.round(1e3 * log.time, 9).tolist() == [0, 1, 2, 5, 6, 8]
    assert log.warnings == ("3 samples without a time stamp (lines 5-6, 9) are dropped.",)


def test_a_time_that_is_no_number_is_a_problem(recording, save):
    (number,) = problems(save(recording(9, {(3, 0): "noon", (5, 0): ""})))
    assert "line 5 has 'noon';" in number


def test_time_that_goes_back_or_repeats_is_dropped_and_counted(recording, save):
    log = cio.read(save(recording(6, {(2, 0): "0.001", (4, 0): "0.0005"})))
    assert log.time.tolist() == [0, 0.001, 0.003, 0.005]
    assert log.warnings == (
        "1 sample repeats the time stamp of another (line 4); the later one is kept.",
        "1 sample out of order in time (line 6) is dropped.",
    )


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        (["" for _ in range(30)], r"places only 0 of 30 samples: .* \(lines 2-31\)"),
        (
            [str(i // 15) for i in range(30)],
            "only 2 of 30 samples: the others have no time stamp, repeat one or come late",
        ),
        ([str(30 - i) for i in range(30)], "only 1 of 30 samples: .*lines 3-31.*increasing time for every sample"),
    ],
)
def test_a_time_that_places_hardly_a_sample_is_a_problem(recording, save, stamps, words):
    (problem,) = problems(save(recording(30, {(i, 0): stamp for i, stamp in enumerate(stamps)})))
    assert re.search(words, problem)


def test_a_duty_cycle_outside_zero_to_one(recording, save):
    (problem,) = problems(save(recording(5, {(1, 2): "1.2", (2, 2): "-0.1", (3, 2): "1.0000000005"})))
    assert problem == (
        "column 'duty_supply [1]' is not a duty cycle: line 3 has 1.2, line 4 has -0.1; "
        "allowed is 0 to 1: correct the values or the unit."
    )


def test_a_duty_cycle_that_looks_like_per_cent(recording, save):
    (problem,) = problems(save(recording(3, {(1, 3): "85"})))
    assert problem == (
        "column 'duty_exhaust [1]' is not a duty cycle: line 3 has 85; looks like percent: write duty_exhaust [%]."
    )
    text = recording(3, {(0, 2): "0", (1, 2): "101", (2, 2): "0"}).replace("supply [1]", "supply [%]")
    assert "line 3 has 101 %; allowed is 0 to 100 %" in problems(save(text))[0]


@pytest.mark.parametrize("cells", [{(1, 2): "1.5"}, {(1, 2): "50", (2, 2): "-1"}, {(1, 2): "500"}])
def test_not_every_wrong_duty_cycle_looks_like_per_cent(recording, save, cells):
    (problem,) = problems(save(recording(3, cells)))
    assert problem.endswith("; allowed is 0 to 1: correct the values or the unit.")


def test_an_absolute_pressure_that_must_be_gauge(recording, save):
    (problem,) = problems(save(recording(3, {(0, 4): "0", (1, 4): "-0.02"}).replace("[Pa]", "[bar]")))
    assert problem == (
        "column 'pressure_a [bar]' is not above 0 as an absolute pressure: line 2 has 0 bar, line 3 has -0.02 bar; "
        "if it is gauge pressure, write pressure_a [bar(g)]."
    )


def test_a_gauge_pressure_below_vacuum(recording, save):
    (problem,) = problems(save(recording(3, {(i, 4): "-1.2" for i in range(3)}).replace("[Pa]", "[bar(g)]")))
    assert "line 2 has -1.2 bar(g)" in problem
    assert problem.endswith("check the unit and --ambient.")


def test_an_infinite_cell_is_a_problem(recording, save):
    cells = {(1, 1): "1e999", (2, 1): "-inf", (0, 2): "inf", (0, 4): "-inf"}
    position, duty, pressure = problems(save(recording(5, cells)))
    assert position.startswith("column 'position [m]' is infinite in lines 3-4; write a finite number")
    assert duty.startswith("column 'duty_supply [1]' is infinite in line 2;")
    assert pressure.startswith("column 'pressure_a [Pa]' is infinite in line 2;")


def test_all_problems_are_reported_at_once(save):
    text = "# rig\ntime [s],Time [ms],position [furlong],duty_supply [1],pressure_a\n0,0,x,0,0\n0,1,1,-5,1\n1,2\n"
    text_of_all = "\n".join(problems(save(text)))
    for part in (
        r"columns 1 and 2 \('time \[s\]', 'Time \[ms\]'\) all mean 'time'",
        r"unit \[furlong\] is not known",
        r"'pressure_a' has no unit",
        r"no column 'duty_exhaust'",
        r"line 5 has 2",
        r"line 3 has 'x'",
        r"line 4 has -5",
    ):
        assert re.search(part, text_of_all), part


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\xd8", b"time [s]\x00\xff\n0\n", "time [s]\n0\n".encode("utf-32")])
def test_bytes_that_are_no_text(save, content):
    assert problems(save(content)) == [
        "is not UTF-8, UTF-16 or Windows-1252 text; save it as 'CSV UTF-8', or as Parquet."
    ]


@pytest.mark.parametrize("tail", ["# fünf\n".encode("latin-1"), b"1,2\xc3"])
def test_text_in_windows_1252_below_the_samples(recording, save, tail):
    log = cio.read(save(recording(3).encode() + tail))
    assert len(log) == 3
    assert log.warnings == (
        "line 5 holds no sample: it repeats the names, is a remark, or was not written to the end.",
    )


NOT_SAMPLES = {
    "the names again": lambda names, _: names + "\n",
    "the names of another file behind its mark": lambda names, _: f"\ufeff{names}\n",
    "a remark": lambda *_: "# trigger 1, 12:00, by hand, late, again, or so\n",
    "the end in words": lambda *_: "EOF\n",
    "a place that was reserved and not written": lambda *_: "\0" * 4096 + "\n",
    "a sample that begins behind such a place": lambda _, row: "\0" * 512 + row + "\n",
}


@pytest.mark.parametrize("what", NOT_SAMPLES)
@pytest.mark.parametrize("small", [0, 1e9])
def test_a_line_that_holds_no_sample_is_left_out_and_said(recording, save, monkeypatch, what, small):
    monkeypatch.setattr(csv_file, "_SMALL", small)
    names, *rows = recording(9).splitlines()
    line = NOT_SAMPLES[what](names, rows[4])
    text = "\n".join([names, *rows[:4]]) + "\n" + line + "\n".join(rows[4:]) + "\n"
    log, whole = cio.read(save(text)), cio.read(save(recording(9), "whole.csv"))
    assert np.array_equal(log.time, whole.time)
    assert np.array_equal(log["position"], whole["position"])
    assert log.warnings == (
        "line 6 holds no sample: it repeats the names, is a remark, or was not written to the end.",
    )


@pytest.mark.parametrize("tail", ["0.009,0.0", "0.009,0.009,0.5,", "\0" * 5000, "0.009,0.0" + "\0" * 5000])
def test_a_last_line_that_was_not_written_to_its_end_is_left_out(recording, save, tail):
    log = cio.read(save(recording(9) + tail))
    assert len(log) == 9
    assert "line 11 holds no sample" in log.warnings[0]
    with pytest.raises(DataError, match="line 11 has "):  # it was written to its end
        cio.read(save(recording(9) + "0.009,0.0\n", "ended.csv"))


def test_what_is_no_file_is_no_recording(tmp_path):
    assert problems(tmp_path) == ["is a folder; name one recording in it."]
    assert problems(tmp_path / ("x" * 5000))[0].startswith("cannot be read (")
    assert problems(Path("/dev/null"))[0].startswith("is not a plain file")


def test_a_missing_file_names_the_nearest_one(recording, save, tmp_path):
    save(recording(), "run7.csv")
    assert problems(tmp_path / "rum7.csv") == ["there is no such file; did you mean 'run7.csv'?"]
    assert problems(tmp_path / "zzz") == ["there is no such file; check its name."]
    (problem,) = problems(tmp_path / "no" / "run7.csv")
    assert problem == f"there is no such file; the folder '{tmp_path / 'no'}' does not exist either."


def test_a_file_without_permission(recording, save, monkeypatch):
    path = save(recording())

    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert problems(path) == ["there is no permission to read it; change its owner or mode."]


@pytest.mark.parametrize("second", ["position [m]", "position [mm]", "Position [m]"])
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_two_columns_of_one_quantity_are_both_named_and_a_map_selects_one(tmp_path, suffix, second):
    path, same = tmp_path / f"run{suffix}", second == "position [m]"
    names = ["time [s]", "position [m]", second, "duty_supply [1]", "duty_exhaust [1]"]
    values = [[0.0, 1.0], [0.001, 0.002], [0.005, 0.006], [0.0, 1.0], [0.0, 0.0]]
    if suffix == ".csv":
        rows = [",".join(map(str, row)) for row in zip(*values, strict=True)]
        path.write_text("\n".join([",".join(names), *rows]) + "\n")
    else:
        arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        parquet.write_table(arrow.table([arrow.array(column) for column in values], names=names), path)
    shown = "position [m] (2)" if same else second
    with pytest.raises(DataError) as caught:
        cio.read(path)
    assert f"columns 2 and 3 ('position [m]', '{shown}') all mean 'position'; keep one" in str(caught.value)
    channels = {name: Channel(name) for name in ("duty_supply", "duty_exhaust")}
    for name in ("position [m]", shown):
        log = cio.read(path, channels=ChannelMap({"position": Channel(name, unit="m"), **channels}))
        assert log["position"][0] == (0.001 if name == "position [m]" else 0.005)
        named = f"position: the first channel '{name}' is read, not 'position [m] (2)'."
        assert (named in log.warnings) == (same and name == "position [m]")


def test_a_disk_that_does_not_give_samples_is_said_of_the_recording(recording, save, monkeypatch, tmp_path):
    def failing(*_):
        raise OSError(5, "Input/output error")

    path = save(recording())
    monkeypatch.setattr("clutchid.measurements.formats.csv.file.line_blocks", failing)
    words = r"run\.csv: cannot be read \(Input/output error\)"
    with pytest.raises(DataError, match=words), atomic_write(tmp_path / "other.csv"):
        cio.read(path)
