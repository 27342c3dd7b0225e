"""Recordings of a vehicle in the order of its life."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.wear.history import RecordingJob, WearReading, arranged
from clutchid.wear.tables import read_table, read_wear_table
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

WEAR = "wear [mm],half_load [mm],load [N]\n"


def history_of(clocks, *jobs):
    """The order of recordings, by their names or as a table has them, with their clocks."""
    readings = [WearReading("ok", "", clock=clock) for clock in clocks]
    return arranged([job if isinstance(job, RecordingJob) else RecordingJob(job) for job in jobs], readings)


def test_the_clock_of_the_file_counts_before_the_table_and_the_name():
    listed = RecordingJob("b_2026-03-01", begin=datetime(2026, 1, 5, tzinfo=UTC))
    history = history_of(["", "2026-02-03T04:05:06+00:00", "2025-12-31T00:00:00"], "a_20260101", listed, "c")
    assert history.order == (2, 0, 1)
    assert [f"{job.begin:%m-%d %H:%M}" for job in history.dated] == ["01-01 00:00", "02-03 04:05", "12-31 00:00"]
    assert history.axis == "days"
    assert history.s == pytest.approx([0.0, 1.0, 34.17021], abs=1e-4)
    assert history.warnings == (
        "b_2026-03-01: the file is dated 2026-02-03 04:05 and the table says 2026-01-05 00:00; the date of the file "
        "is used.",
        "b_2026-03-01: its name says 2026-03-01 and the file says 2026-02-03; the date of the file is used.",
    )


def test_a_name_that_agrees_to_a_day_is_no_contradiction():
    for clock in ("2026-03-01T23:59:00+00:00", "2026-02-28T11:00:00+00:00", "2026-03-02T20:00:00+00:00"):
        assert not history_of([clock], "b_2026-03-01").warnings
    (warning,) = history_of([""], RecordingJob("b_2026-03-01", begin=datetime(2026, 3, 9, tzinfo=UTC))).warnings
    assert warning == (
        "b_2026-03-01: its name says 2026-03-01 and the table says 2026-03-09; the date of the table is used."
    )


def test_a_clock_that_restarted_is_not_used():
    may, april = (RecordingJob(name, begin=datetime(2026, k, 1, tzinfo=UTC)) for name, k in (("a", 5), ("b", 4)))
    history = history_of(["1970-01-01T03:00:00", ""], may, april)
    assert history.order == (1, 0)
    assert history.warnings == ("a: its clock shows 1970-01-01: it was reset, so its date is not used.",)


def test_strokes_are_the_axis_before_distance_and_time():
    days, job = ["2026-01-01", "2026-01-02"], RecordingJob
    history = history_of(days, job("a", odometer=100.0, strokes=5e3), job("b", odometer=50.0, strokes=9e3))
    assert (history.axis, list(history.s)) == ("strokes", [5e3, 9e3])
    assert history_of(days, job("a", odometer=100.0), job("b", odometer=150.0)).axis == "km"
    back = history_of(days, job("a", strokes=9.0), job("b", strokes=5.0))
    assert back.axis == "days"
    assert back.warnings == ("strokes decreases at b and is not used for the trend.",)


def test_without_any_time_the_names_are_sorted_as_people_count():
    history = history_of(["", ""], "run10", "run9")
    assert (history.order, history.axis) == ((1, 0), "recordings")
    assert history.warnings == ("no recording has a time; they are taken in the order of their names.",)
    some = history_of(["", ""], "a", "b_20260102")
    assert some.order == (1, 0)
    assert "placed after the others" in some.warnings[0]


def test_a_table_is_read_by_stem_and_says_all_that_is_wrong(tmp_path):
    path = tmp_path / "recordings.csv"
    path.write_text("recording,vehicle,date,odometer_km,strokes\nx/a.parquet,V1,2026-01-02,12.5,\nb,V1,,,700\n")
    rows = read_table(path)
    assert rows["a"].begin == datetime(2026, 1, 2, tzinfo=UTC)
    assert (rows["a"].odometer, rows["b"].strokes) == (12.5, 700.0)
    assert np.isnan(rows["a"].strokes)
    path.write_text("recording,date,strokes\na,yesterday,1\nb,,many\nc,,1\nc,,2\n")
    with pytest.raises(DataError) as error:
        read_table(path)
    for text in (
        ("line 2: date 'yesterday' is not an ISO date"),
        "line 3: strokes 'many'",
        "line 5: 'c' is listed twice",
    ):
        assert text in str(error.value)
    path.write_text("name\na\n")
    with pytest.raises(DataError, match="has no column 'recording', only 'name'"):
        read_table(path)


def test_names_with_other_digits_than_ours_are_in_order_too():
    assert [job.recording for job in history_of([""] * 3, "r²", "r10", "r9").dated] == ["r²", "r10", "r9"]
    assert history_of([""] * 3, "²", "r10", "r9").order == (2, 1, 0)


def test_a_table_of_wear_starts_at_the_new_clutch(tmp_path):
    path = tmp_path / "wear.csv"
    path.write_text(f"{WEAR}0,2.8,4000\n1,2.9,4400\n")
    table = read_wear_table(path)
    assert table.wear == pytest.approx([0.0, 1e-3])
    assert table.shift == pytest.approx([0.0, 0.1e-3])
    assert table.load == pytest.approx([0.0, 0.1])


@pytest.mark.parametrize(("cell", "reason"), CASES["counts"])
@pytest.mark.parametrize("column", ["odometer_km", "strokes"])
def test_a_count_that_no_truck_has_is_a_sentence(tmp_path, column, cell, reason):
    path = tmp_path / "recordings.csv"
    path.write_text(f"recording,{column}\na,1\nb,{cell}\n")
    with pytest.raises(DataError) as error:
        read_table(path)
    assert f"line 3: {column} '{cell}' {reason}" in str(error.value)


@pytest.mark.parametrize(("text", "reason"), CASES["tables"])
def test_a_table_of_wear_that_no_clutch_has_is_a_sentence(tmp_path, text, reason):
    path = tmp_path / "wear.csv"
    path.write_text(text)
    with pytest.raises(DataError, match=reason):
        read_wear_table(path)


def test_a_heading_that_stands_twice_is_a_sentence(tmp_path):
    path = tmp_path / "recordings.csv"
    path.write_text("recording,vehicle, vehicle\na,V1,V2\n")
    with pytest.raises(DataError, match="has the column 'vehicle' twice"):
        read_table(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a FIFO is a file of POSIX")
@pytest.mark.parametrize("read", [read_table, read_wear_table])
def test_a_table_is_a_plain_file_of_limited_size(tmp_path, monkeypatch, read):
    os.mkfifo(tmp_path / "fifo")
    for path in (tmp_path / "fifo", Path("/dev/zero")):
        with pytest.raises(DataError, match="is not a plain file; save the table to a file first"):
            read(path)
    monkeypatch.setattr("clutchid.wear.tables._LARGEST", 100)
    (tmp_path / "large.csv").write_text("recording\n" + "a\n" * 100)
    with pytest.raises(DataError, match=r"is not a table: it has more than 0\.0001 MB"):
        read(tmp_path / "large.csv")
