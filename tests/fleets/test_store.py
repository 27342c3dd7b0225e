"""What a run keeps: whole after any end, for one run at a time, and only for what it is about."""

import resource
import sqlite3
from contextlib import closing
from datetime import UTC, datetime

import numpy as np
import pytest

from clutchid.errors import ExportError
from clutchid.estimation.assess.comparison import HalfLoad, Measurement
from clutchid.fleets.store import run_store, stored_row
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.processes import Timing
from clutchid.wear.history import RecordingJob, WearReading

ABOUT = {"source": "/fleet", "verb": "fit"}


_Y = np.linspace(0.0, 0.02, 5)

READING = WearReading(
    "ok", "ü’s “sentence”", "good", Measurement(1e-4, 2e-5, 0.01, 0.005, float("nan")),
    clock="2026-01-02T03:04:05+00:00", sha256="abc", half_load=HalfLoad(1e-3, 9e-4, float("nan")),
    changes=("a", "b"), curve=LoadCurve(_Y, _Y * 1e5, _Y, _Y * np.pi),
)  # fmt: skip


def kept(name, vehicle="V1", status="ok"):
    reading = READING._replace(status=status)
    place = {"type": "T1", "begin": datetime(2026, 1, 2, tzinfo=UTC), "odometer": 1.5, "strokes": float("nan")}
    job = RecordingJob(name, vehicle, **place, inputs="inputs", file="12 34")
    return stored_row(job, reading, Timing(1.5, float("nan"), "host", 12, 1), "2026-11-30T12:00:00+00:00")


def rows_in(stored):
    """The rows of an index by name, as text."""
    return {row.recording: repr(row) for row in stored._rows("")}


def test_a_result_comes_back_as_it_was(tmp_path):
    with run_store(tmp_path / "out", ABOUT) as stored:
        stored.put([kept("r2")])
        stored.put([kept("r1", "V2")])
        stored.put([kept("r1")])
    with run_store(tmp_path / "out", ABOUT) as stored:
        rows = [row for vehicle in ("V1", "V2") for row in stored.of_vehicle(vehicle).values()]
        entry = stored.keys()["V1", "r2"]
        assert (entry.inputs, entry.file, entry.sha256, entry.has_result) == ("inputs", "12 34", "abc", True)
    assert {row[:2] for row in rows} == {("V1", "r1"), ("V1", "r2"), ("V2", "r1")}
    (row,) = (row for row in rows if row[:2] == ("V1", "r1"))
    assert row == kept("r1")
    reading, before = row.result, READING
    assert (repr(reading._replace(curve=None)), row.date) == (repr(before._replace(curve=None)), "2026-01-02")
    for side in ("position", "force", "low", "high"):
        np.testing.assert_array_equal(getattr(reading.curve, side), getattr(before.curve, side))


def test_a_folder_of_something_else_is_refused_unchanged(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    refused(tmp_path / "mine", "is not empty and has no run of a fleet")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]
    with run_store(tmp_path / "out", ABOUT) as stored:
        stored.put([kept("r1")])
    words = "has a run whose verb is fit, not track; name another folder"
    refused(tmp_path / "out", words, {**ABOUT, "verb": "track"})


@pytest.mark.slow
def test_only_one_run_at_a_time_works_in_a_folder(tmp_path):
    with run_store(tmp_path, ABOUT):
        refused(tmp_path, "another run is going on in this folder")


@pytest.mark.slow
def test_a_full_disk_is_a_sentence_and_what_was_written_before_is_whole(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with run_store(tmp_path, ABOUT) as stored:
        stored.put([kept("first")])

    def fill(stored, count):
        for k in range(count):
            stored.put([kept(f"r{k}")])
            stored.saved()

    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
        with pytest.raises(ExportError, match="Make room on the disk"), run_store(tmp_path, ABOUT) as stored:
            fill(stored, 2000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    with run_store(tmp_path, ABOUT) as stored:
        names = [*rows_in(stored)]
        assert "first" in names
        fill(stored, 50)
    with run_store(tmp_path, ABOUT) as stored:
        assert {*names, *(f"r{k}" for k in range(50))} == rows_in(stored).keys()


def test_a_file_that_is_no_store_of_this_version_is_refused(tmp_path):
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "run.sqlite").write_text("no database, but a text that is long enough to be told from one")
    refused(tmp_path / "text", "is not the file of a run, or was damaged")
    (tmp_path / "other").mkdir()
    edited(tmp_path / "other" / "run.sqlite", "CREATE TABLE done (vehicle TEXT, name TEXT)")
    refused(tmp_path / "other", "is not from this version of clutchid")


def test_a_run_that_has_done_nothing_may_become_another(tmp_path):
    with run_store(tmp_path, ABOUT):
        pass
    with run_store(tmp_path, {**ABOUT, "verb": "track"}) as stored:
        stored.put([kept("r1")])
    refused(tmp_path, "has a run whose verb is track, not fit")


def refused(folder, words, about=ABOUT):
    """A store that cannot be opened, with the sentence."""
    with pytest.raises(ExportError, match=words), run_store(folder, about):
        pass


def edited(path, *statements):
    """What somebody does to the file of a run."""
    with closing(sqlite3.connect(path)) as base:
        for statement in statements:
            base.execute(statement)
        base.commit()


def filled(folder, count=60):
    """The file of a run with results, and these by recording, as text."""
    with run_store(folder, ABOUT) as stored:
        for k in range(count):
            stored.put([kept(f"r{k:02d}", f"V{k % 3}")])
        results = rows_in(stored)
    return folder / "run.sqlite", results


def resumed(folder, before):
    """Recordings that are not in the index after a damage; all others are as they were, and then all are again."""
    with run_store(folder, ABOUT) as stored:
        left = rows_in(stored)
        assert {name for _, name in stored.keys()} == left.keys()  # noqa: SIM118
        assert left.items() <= before.items()
        lost = before.keys() - left.keys()
        for name in lost:
            stored.put([kept(name, f"V{int(name[1:]) % 3}")])
    with run_store(folder, ABOUT) as stored:
        assert rows_in(stored) == before
    return lost


@pytest.mark.parametrize(
    "edit",
    [
        "status = 'warning'", "sha256 = 'xyz'", "inputs = 'other'", "file = '12 35'", "timing = '[]'", "place = '[]'",
        "reading = replace(reading, '0.0001', '0.0002')", "reading = '{}'", "reading = 'no JSON'", "reading = x'ff'",
        "curve = NULL", "curve = x'00'", "checksum = ''", "recording = 'r99'",
    ],
)  # fmt: skip
def test_a_row_that_was_spoiled_is_read_again(tmp_path, edit):
    path, before = filled(tmp_path / "out", 3)
    edited(path, f"UPDATE done SET {edit} WHERE recording = 'r01'")
    assert resumed(tmp_path / "out", before) == {"r01"}


def test_what_a_run_is_about_may_be_spoiled_too(tmp_path):
    path, before = filled(tmp_path / "out", 3)
    edited(path, "UPDATE about SET value = 'fjt' WHERE what = 'verb'")
    assert not resumed(tmp_path / "out", before)


@pytest.mark.slow
def test_a_file_that_is_damaged_anywhere_gives_whole_rows_or_none_and_never_others(tmp_path):
    path, before = filled(tmp_path / "out")
    whole, page, rng = path.read_bytes(), 4096, np.random.default_rng(7)
    assert len(whole) > 8 * page
    lost = []
    for k in range(30):
        content = bytearray(whole)
        at = int(rng.integers(page, len(whole)))
        if k % 3 == 0:  # bytes
            content[at : at + 1 + k] = rng.bytes(1 + k)
        elif k % 3 == 1:  # a page that the disk lost
            content[at // page * page : (at // page + 1) * page] = bytes(page)
        else:  # a copy that was cut off
            del content[at:]
        path.write_bytes(content)
        lost.append(len(resumed(tmp_path / "out", before)))
    assert {0, len(before)} <= {*lost}, "a damage in a row leaves the others, one of the file none"


@pytest.mark.slow
def test_a_damage_of_the_first_page_is_a_sentence_or_is_mended(tmp_path):
    path, before = filled(tmp_path / "out")
    whole = path.read_bytes()
    mended = 0
    for at in range(0, 4096, 256):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1 :])
        try:
            resumed(tmp_path / "out", before)
            mended += 1
        except ExportError as error:
            assert "name another folder" in str(error)  # noqa: PT017
    assert mended > 8


def test_a_folder_that_cannot_be_made_or_written_is_a_sentence(tmp_path):
    (tmp_path / "closed" / "run.sqlite").mkdir(parents=True)  # as good as a folder without permission, also for root
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").touch()
    for out, said in (
        (tmp_path / ("n" * 300), "the folder cannot be created .File name too long"),
        (tmp_path / "file" / "out", "the folder cannot be created .Not a directory"),
        (tmp_path / "loop", "the folder cannot be created"),
        (tmp_path / "closed", "cannot be written .unable to open database file.; allow writing in it"),
    ):
        refused(out, f"^--out .*{said}")
