"""The rows of a run: what counts once, and what is no result."""

import resource
from dataclasses import replace

import polars as pl
import pytest

from clutchid import Log, bundled_recording, write
from clutchid.errors import ExportError
from clutchid.files import write_frame
from clutchid.fleets.jobs import Fleet, with_dependencies
from clutchid.fleets.plan import planned, readings_of, recording_states
from clutchid.fleets.store import run_store, stored_row
from clutchid.verbs.reading import Reading
from clutchid.verbs.tracking import track
from clutchid.verbs.wear_reading import checksum_of, read_recording
from clutchid.wear.history import RecordingJob, WearReading
from fixtures.commands import without_workers


def statuses(tmp_path, status):
    """What becomes of one file under two vehicles that ended with a status."""
    jobs = tuple(RecordingJob("r", vehicle, path=tmp_path, start=tmp_path) for vehicle in ("V1", "V2"))
    with run_store(tmp_path / status, {}) as stored:
        for job in jobs:
            stored.put([stored_row(job, WearReading(status, "its sentence", sha256="same"))])
        states = recording_states(jobs, stored.keys())
        return [reading[:2] for state in states for reading in readings_of([state], stored)]


def tasks(fleet, reading, verb, stored, *, retry=False):
    """What a run over a fleet is to read."""
    return planned(with_dependencies(fleet, reading, verb).jobs, stored.keys(), retry=retry, forget=False).todo


def test_the_same_recording_counts_once_but_the_same_broken_file_is_broken_twice(tmp_path):
    assert statuses(tmp_path, "ok")[1] == ("warning", "the same recording as r of V1; it counts once.")
    for status in ("bad_input", "failed", "killed", "timed_out"):
        assert statuses(tmp_path, status) == [(status, "its sentence")] * 2


def test_a_file_that_goes_before_it_is_read_is_a_row(tmp_path):
    gone, start = tmp_path / "gone.parquet", tmp_path / "cal.toml"
    start.touch()
    fleet = Fleet((RecordingJob("gone", "V1", path=gone, start=start),))
    with run_store(tmp_path / "out", {}) as stored:
        (task,) = tasks(fleet, Reading(), "fit", stored)
        reading = read_recording(Reading(), "fit", task)
        assert reading.status == "bad_input"
        assert "gone.parquet: there is no such file" in reading.message
        stored.put([stored_row(task, reading)])
        assert not tasks(fleet, Reading(), "fit", stored)
        gone.touch()
        assert tasks(fleet, Reading(), "fit", stored), "it has come back"


def test_what_a_result_was_made_from_is_read_again_when_it_changes(tmp_path, monkeypatch):
    recording, start, channels = tmp_path / "r.parquet", tmp_path / "cal.toml", tmp_path / "map.toml"
    for path in (recording, start, channels):
        path.write_text("before")
    fleet = Fleet((RecordingJob("r", "V1", path=recording, start=start),))
    reading = Reading(channels=channels)
    with run_store(tmp_path / "out", {}) as stored:

        def is_read(reading=reading, verb="fit", **retry):
            """Whether the recording is read now; then it is done."""
            todo = tasks(fleet, reading, verb, stored, **retry)
            for task in todo:
                stored.put([stored_row(task, WearReading("killed", "lost", sha256=checksum_of(recording)))])
            return bool(todo)

        assert is_read()
        assert not is_read()
        for path in (start, channels, recording):
            path.write_text(f"{path.read_text()}, and after")
            assert is_read(), path.name
            assert not is_read()
        assert is_read(replace(reading, ambient=1e5))
        assert is_read(verb="observe")
        assert is_read()
        monkeypatch.setattr("clutchid.fleets.jobs.version_and_source", lambda: {"clutchid": "9", "source": "other"})
        assert is_read()
        assert not is_read()
        assert is_read(retry=True), "it ended its worker"


def test_a_file_that_could_not_be_read_is_tried_again_without_a_change(tmp_path):
    recording, start = tmp_path / "r.parquet", tmp_path / "cal.toml"
    recording.touch()
    start.touch()
    fleet = Fleet((RecordingJob("r", "V1", path=recording, start=start),))
    with run_store(tmp_path / "out", {}) as stored:
        (task,) = tasks(fleet, Reading(), "fit", stored)
        for checksum, again in (("", 1), (checksum_of(recording), 0)):
            stored.put([stored_row(task, WearReading("bad_input", "cannot be read.", sha256=checksum))])
            assert len(tasks(fleet, Reading(), "fit", stored)) == again


def test_a_calibration_that_changes_while_a_worker_lives_is_read_again(tmp_path):
    start, recording = tmp_path / "cal.toml", tmp_path / "r.csv"
    job = RecordingJob("r", path=recording, start=start)
    recording.touch()
    start.write_text("[parameters]\n")
    assert "r.csv" in read_recording(Reading(ambient=1e5), "fit", job).message
    start.write_text("no calibration any more")
    assert "cal.toml" in read_recording(Reading(ambient=1e5), "fit", job).message


def test_a_full_disk_under_a_table_is_a_sentence_and_the_table_before_is_whole(tmp_path):
    path, limits = tmp_path / "results.parquet", resource.getrlimit(resource.RLIMIT_FSIZE)
    write_frame(pl.DataFrame({"a": [1]}), path)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
        with pytest.raises(ExportError, match=r"results.parquet: cannot be written .* no file was changed"):
            write_frame(pl.DataFrame({"a": pl.int_range(100_000, eager=True)}).sample(fraction=1.0, shuffle=True), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert pl.read_parquet(path)["a"].to_list() == [1]
    assert [path_left.name for path_left in tmp_path.iterdir()] == ["results.parquet"]


@without_workers()
def test_recordings_of_several_folders_without_a_table_are_warned_of(tmp_path):
    paths = [tmp_path / vehicle / f"{vehicle}.csv" for vehicle in ("V1", "V2")]
    for path in paths:
        path.parent.mkdir()
        path.touch()
    (tmp_path / "cal.toml").touch()
    tracked = track(paths, tmp_path / "cal.toml")
    assert "the recordings lie in 2 folders (V1, V2) and are treated as recordings of one" in tracked.wear.warnings[0]
    assert not any("folders" in warning for warning in track(paths[:1], tmp_path / "cal.toml").wear.warnings)


def test_a_refused_recording_is_one_line_that_says_which_command_has_force(tmp_path):
    start, recording = tmp_path / "cal.toml", tmp_path / "r.csv"
    start.write_text("[parameters]\n")
    log = bundled_recording()
    write(Log(log.time[::100], {name: column[::100] for name, column in log.columns.items()}), recording)
    reading = read_recording(Reading(), "fit", RecordingJob("r", path=recording, start=start))
    assert reading.status == "bad_input"
    assert "fast strokes have too few samples" in reading.message
    assert reading.message.endswith(" or estimate this recording alone with --force.")
    assert "\n" not in reading.message
