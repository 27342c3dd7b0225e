"""Files that cannot be used: every problem, with its line and column, at once."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import clutchid.measurements as cio
from clutchid.errors import DataError
from clutchid.files import atomic_write
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from fixtures.cases import cases


def problems(path):
    """The problems that `read` reports, one a line, without the file name and bullets."""
    with pytest.raises(DataError) as caught:
        cio.read(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    text = text.removeprefix(f"{path}: ")
    return text.split("\n  - ")[1:] if "\n" in text else [text]


@pytest.mark.parametrize("recording", cases(__file__, "csv_recordings"))
def test_a_recording_is_read_with_warnings_or_refused_with_all_problems(save, parser, recording):
    path = save(recording["text"])
    if expected := recording.get("problems"):
        sentences = problems(path)
        assert len(sentences) == len(expected)
        assert [part for part in expected if not any(part in sentence for sentence in sentences)] == []
        return
    log = cio.read(path)
    assert list(log.warnings) == recording["warnings"]
    for name in recording.keys() & {"time", *log.columns}:
        np.testing.assert_allclose(log.time if name == "time" else log[name], recording[name], rtol=0, atol=1e-12)


def test_a_text_that_is_no_number_is_shortened(recording, save):
    (problem,) = problems(save(recording(3, {(1, 1): "x" * 5000})))
    assert len(problem) < 300


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


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        (["" for _ in range(30)], r"gives only 0 of 30 samples a place: .* \(lines 2-31\)"),
        (
            [str(i // 15) for i in range(30)],
            "only 2 of 30 samples a place: the others have no time stamp, repeat one or go back",
        ),
        (
            [str(30 - i) for i in range(30)],
            ("only 1 of 30 samples a place: .*lines 3-31.*increasing time for every sample"),
        ),
    ],
)
def test_a_time_that_places_hardly_a_sample_is_a_problem(recording, save, stamps, words):
    (problem,) = problems(save(recording(30, {(i, 0): stamp for i, stamp in enumerate(stamps)})))
    assert re.search(words, problem)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\xd8", b"time [s]\x00\xff\n0\n", "time [s]\n0\n".encode("utf-32")])
def test_bytes_that_are_no_text(save, content):
    assert problems(save(content)) == [
        "is not UTF-8, UTF-16 or Windows-1252 text; save it as 'CSV UTF-8', or as Parquet."
    ]


@pytest.mark.parametrize("tail", ["# fünf\n".encode("latin-1"), b"1,2\xc3"])
def test_text_in_windows_1252_below_the_samples(recording, save, tail):
    log = cio.read(save(recording(3).encode() + tail))
    assert len(log) == 3
    assert log.warnings == ("left out line 5: repeated column names, a remark, or an incomplete line.",)


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
    assert log.warnings == ("left out line 6: repeated column names, a remark, or an incomplete line.",)


@pytest.mark.parametrize("tail", ["0.009,0.0", "0.009,0.009,0.5,", "\0" * 5000, "0.009,0.0" + "\0" * 5000])
def test_a_last_line_that_was_not_written_to_its_end_is_left_out(recording, save, tail):
    log = cio.read(save(recording(9) + tail))
    assert len(log) == 9
    assert "left out line 11" in log.warnings[0]
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
    elif same:
        return  # is refused by polars
    else:
        pl.DataFrame(dict(zip(names, values, strict=True))).write_parquet(path)
    shown = "position [m] (2)" if same else second
    with pytest.raises(DataError) as caught:
        cio.read(path)
    assert f"columns 2 and 3 ('position [m]', '{shown}') all mean 'position'; keep one" in str(caught.value)
    channels = {name: Channel(name) for name in ("duty_supply", "duty_exhaust")}
    for name in ("position [m]", shown):
        log = cio.read(path, channels=ChannelMap({"position": Channel(name, unit="m"), **channels}))
        assert log["position"][0] == (0.001 if name == "position [m]" else 0.005)
        named = f"position: the first channel '{name}' is used, not 'position [m] (2)'."
        assert (named in log.warnings) == (same and name == "position [m]")


def test_a_disk_that_does_not_give_samples_is_said_of_the_recording(recording, save, monkeypatch, tmp_path):
    def failing(*_):
        raise OSError(5, "Input/output error")

    path = save(recording())
    monkeypatch.setattr("clutchid.measurements.formats.csv.text.TextFile.blocks", failing)
    words = r"run\.csv: cannot be read \(Input/output error\)"
    with pytest.raises(DataError, match=words), atomic_write(tmp_path / "other.csv"):
        cio.read(path)
