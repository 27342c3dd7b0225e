"""What a run keeps: whole after any end, for one run at a time, and only for what it is about."""

import resource
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from clutchid.assess.half_load import HalfLoad
from clutchid.errors import ExportError
from clutchid.fleet.reading import Read
from clutchid.fleet.store import Kept, store
from clutchid.wear.life import Curve
from clutchid.wear.measurement import Measurement, Reading

ABOUT = {"source": "/fleet", "verb": "fit"}


def kept(name, vehicle="V1", status="ok"):
    y = np.linspace(0.0, 0.02, 5)
    read = Read(
        Path(name),
        Reading(status, "ü’s “sentence”", "good", Measurement(1e-4, 2e-5, 0.01, 0.005, float("nan"))),
        "2026-01-02T03:04:05+00:00", "abc",
        Curve(y, y * 1e5, y, y * np.pi), HalfLoad(1e-3, 9e-4, float("nan")), ("a", "b"),
    )  # fmt: skip
    return Kept(vehicle, name, "inputs", "12 34", read, 1.5)


def test_a_result_comes_back_as_it_was(tmp_path):
    with store(tmp_path / "out", ABOUT) as one:
        one.put(kept("r2"))
        one.put(kept("r1", "V2"))
        one.put(kept("r1"))
    with store(tmp_path / "out", ABOUT) as one:
        found = list(one.results())
        assert one.keys()["V1", "r2"] == ("inputs", "12 34", "abc", "ok")
    assert [(k.vehicle, k.recording) for k in found] == [("V1", "r1"), ("V1", "r2"), ("V2", "r1")]
    before, after = kept("r1").read, found[0].read
    assert after.reading[:3] == before.reading[:3]
    assert (after.clock, after.sha256, after.changes) == (before.clock, before.sha256, before.changes)
    np.testing.assert_array_equal(after.reading.measurement, before.reading.measurement)
    np.testing.assert_array_equal(after.half_load, before.half_load)
    np.testing.assert_array_equal(after.curve, before.curve)


def test_a_folder_of_something_else_is_refused_unchanged(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(ExportError, match="is not empty and has no run of a fleet"), store(tmp_path / "mine", ABOUT):
        pass
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]
    with store(tmp_path / "out", ABOUT) as one:
        one.put(kept("r1"))
    with (
        pytest.raises(ExportError, match="has a run whose verb is fit, not track; name another folder"),
        store(tmp_path / "out", {**ABOUT, "verb": "track"}),
    ):
        pass


def test_only_one_run_at_a_time_works_in_a_folder(tmp_path):
    with (
        store(tmp_path, ABOUT),
        pytest.raises(ExportError, match="another run is going on in this folder"),
        store(tmp_path, ABOUT),
    ):
        pass


def test_a_full_disk_is_a_sentence_and_what_was_written_before_is_whole(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with store(tmp_path, ABOUT) as one:
        one.put(kept("first"))

    def fill(one):
        for k in range(2000):
            one.put(kept(f"r{k}"))
            one.saved()

    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
        with pytest.raises(ExportError, match="Make room on the disk"), store(tmp_path, ABOUT) as one:
            fill(one)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    with store(tmp_path, ABOUT) as one:
        names = [k.recording for k in one.results()]
        assert "first" in names
        fill(one)
    with store(tmp_path, ABOUT) as one:
        assert len(list(one.results())) == 2001


def test_a_file_that_is_no_store_of_this_version_is_refused(tmp_path):
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "run.sqlite").write_text("no database, but a text that is long enough to be told from one")
    with pytest.raises(ExportError, match="is not the file of a run, or was damaged"), store(tmp_path / "text", ABOUT):
        pass
    (tmp_path / "other").mkdir()
    with closing(sqlite3.connect(tmp_path / "other" / "run.sqlite")) as base:
        base.execute("CREATE TABLE done (vehicle TEXT, name TEXT)")
    with pytest.raises(ExportError, match="is not from this version of clutchid"), store(tmp_path / "other", ABOUT):
        pass


def test_a_run_that_has_done_nothing_may_become_another(tmp_path):
    with store(tmp_path, ABOUT):
        pass
    with store(tmp_path, {**ABOUT, "verb": "track"}) as one:
        one.put(kept("r1"))
    with pytest.raises(ExportError, match="has a run whose verb is track, not fit"), store(tmp_path, ABOUT):
        pass
