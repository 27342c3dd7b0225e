"""What a folder and a table of recordings hold: every name that is read is found, and what is left out is said."""

import gzip
from collections import Counter

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.app.uploads import folder_listing
from clutchid.errors import DataError
from clutchid.fleets.jobs import fleet_of
from clutchid.log import Log
from clutchid.measurements.formats.kinds import is_recording
from clutchid.measurements.look import look
from clutchid.measurements.suffixes import FORMATS, SUFFIXES, split_name
from clutchid.verbs.folders import folder_content, left_out, name_of
from clutchid.verbs.tracking import recordings_of
from clutchid.wear.tables import read_table
from fixtures.commands import without_workers
from fixtures.forms import NAMES, kind_in, write_forms
from fixtures.lives import reading


@pytest.fixture(scope="module")
def still():
    """Half a second without a stroke, which a fit refuses at once."""
    time = np.arange(0.0, 0.5, 0.001)
    return Log(time, {"position": 1e-4 * time, "duty_supply": np.zeros(500), "duty_exhaust": 1.0 * (time > 0.2)})


@pytest.fixture(scope="module")
def forms(still, tmp_path_factory):
    """A vehicle with a recording under every name, and its bus."""
    folder = tmp_path_factory.mktemp("forms") / "V1"
    folder.mkdir()
    return folder, write_forms(still, folder)


@pytest.fixture
def cal(tmp_path):
    path = tmp_path / "cal.toml"
    path.write_text("[parameters]\n")
    return path


def test_every_suffix_is_a_row_of_a_format_and_stands_in_the_documentation(source):
    assert len(set(SUFFIXES)) == len(SUFFIXES)
    text = (source.parents[1] / "docs" / "recordings.md").read_text()
    assert [suffix for suffix in SUFFIXES if f"`{suffix}`" not in text] == []
    assert all(suffix.islower() for row in FORMATS for suffix in row.suffixes)


#: Formats of frames, which a DBC decodes.
BUS = ("blf", "asc", "trc", "candump")


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_is_found_under_every_name_that_is_read(forms, still, name):
    folder, dbc = forms
    stem = split_name(name)[0]
    databases = [dbc] if kind_in(name) in BUS else []
    assert look(folder / name, dbc=databases).problems == ()
    log = clutchid.read(folder / name, dbc=databases)
    assert (log.name, len(log)) == (stem, len(still))
    assert is_recording(folder / name)
    assert name_of(folder / name) == stem
    assert name in [file["name"] for file in folder_listing("", folder.resolve())["files"]]


def one_of_each(forms, to, names=NAMES):
    """The recordings under names of their own, as those of one vehicle."""
    folder, _ = forms
    to.mkdir(parents=True)
    for number, name in enumerate(names):
        (to / f"{number:03d} {name}").symlink_to(folder / name)
    return to


def test_fleet_and_track_find_all_of_them_in_folders_and_in_tables(forms, tmp_path, cal):
    vehicle = one_of_each(forms, tmp_path / "fleet" / "V1")
    assert {job.path.name for job in fleet_of(tmp_path / "fleet", cal).jobs} == {
        path.name for path in vehicle.iterdir()
    }
    assert len(recordings_of([vehicle])[0]) == len(NAMES)
    for named in (lambda path: path.name, name_of):
        rows = [f"{named(path)},V1" for path in sorted(vehicle.iterdir())]
        (tmp_path / "fleet" / "recordings.csv").write_text("\n".join(["recording,vehicle", *rows]))
        jobs = fleet_of(tmp_path / "fleet", cal).jobs
        assert [job.problem for job in jobs] == [""] * len(NAMES)


@pytest.mark.slow
@without_workers()
def test_fleet_and_track_read_all_of_them(forms, tmp_path, cal):
    names = [*{(kind_in(name), name[-3:].lower() == ".gz"): name for name in NAMES}.values()]
    vehicle = one_of_each(forms, tmp_path / "fleet" / "V1", names)
    run = clutchid.fleet(tmp_path / "fleet", cal, tmp_path / "out", dbc=[forms[1]])
    said = pl.read_parquet(tmp_path / "out" / "results.parquet")["message"].to_list()
    read = clutchid.track(vehicle, cal, dbc=[forms[1]]).wear.rows
    for sentences in (said, [row.reading.message for row in read]):
        ends = Counter(sentence.partition(": ")[2] for sentence in sentences)
        assert len(sentences) == len(names) == 2 * sum(bool(row.suffixes) for row in FORMATS)
        assert len(ends) == 1, "every one is refused for the same reason, which stands in its samples"
    assert (run.vehicles, run.warnings) == (1, ()), "without a trend times do not matter"


OTHERS = {
    "map.toml": "[position]\n", "truth.json": "{}", "trip.log": "started at noon\n", "notes.txt": "12 drives",
    "README": "read me", "backup.tar.gz": "", "photo.JPG": "", "b.jpg": "",
}  # fmt: skip


def test_what_else_a_folder_holds_is_counted_by_suffix(tmp_path, cal, still):
    vehicle = tmp_path / "fleet" / "V1"
    vehicle.mkdir(parents=True)
    for name, text in OTHERS.items():
        (vehicle / name).write_text(text)
    (vehicle / "._run.csv").touch()
    (vehicle / "folder").symlink_to(tmp_path)
    counted = "2 .jpg, 1 .json, 1 .log, 1 .tar.gz, 1 .toml, 1 .txt, 1 without a suffix"
    said = f"has no recordings; they are files with .parquet.* {counted}.*clutchid look"
    for find in (lambda: fleet_of(tmp_path / "fleet", cal), lambda: recordings_of([vehicle])):
        with pytest.raises(DataError, match=said):
            find()
    clutchid.write(still, vehicle / "run.csv")
    sentence = f"8 files are not read as recordings: {counted}."
    assert fleet_of(tmp_path / "fleet", cal).left_out == recordings_of([vehicle])[1] == sentence
    below = vehicle.resolve()
    assert folder_listing("", below)["others"] == "Not listed: 2 .jpg, 1 .json, 1 .tar.gz, 1 without a suffix."
    assert left_out([], 0) == ""


@pytest.mark.parametrize(
    ("text", "table"),
    [("Zeit [s]\tWeg [mm]\n0,001\t0,5\n", True), ("t;y\n2026-11-23 14:05:01.2;0.5;1\n", True), ("0 1\n", True),
     ("2026-11-23 14:05 clutch replaced\n", False), ("1. start\n2. stop\n", False), ("", False)],
)  # fmt: skip
def test_a_text_is_a_recording_where_it_has_a_line_of_numbers(tmp_path, text, table):
    for path, content in (("a.txt", text.encode()), ("b.TXT", b"a" * 200 + b"\n" + text.encode())):
        (tmp_path / path).write_bytes(content)
        assert is_recording(tmp_path / path) is table
    (tmp_path / "c.txt").write_bytes("t\ty\n0\t1\n".encode("utf-16"))
    assert is_recording(tmp_path / "c.txt")


def test_results_of_clutchid_are_no_recordings_and_counted(tmp_path, still):
    for name in ("run.csv", "est.parquet", "est.load.parquet", "live.csv", "live.load.csv", "alone.load.parquet"):
        (tmp_path / name).touch()
    (tmp_path / "out" / "curves").mkdir(parents=True)
    for name in ("run.sqlite", "results.parquet", "curves/part-00000.parquet", "index.html"):
        (tmp_path / "out" / name).touch()
    content = folder_content(tmp_path)
    assert [path.name for path in content.recordings] == ["alone.load.parquet", "run.csv"]
    assert (content.others, content.results) == ((), 8)
    assert recordings_of([tmp_path])[1] == "8 files are not read as recordings: 8 results of clutchid."


def test_a_file_that_a_table_names_is_read_whatever_its_suffix_is(tmp_path, cal, still):
    folder = tmp_path / "fleet"
    folder.mkdir()
    clutchid.write(still, folder / "a.csv")
    (folder / "a.csv").rename(folder / "a.2026")
    (folder / "b.bin").write_bytes(gzip.compress((folder / "a.2026").read_bytes()))
    for name in ("b.toml", "c.toml", "c.json", "2026.11.23.csv", "e.mf4", "e.csv"):
        (folder / name).touch()
    names = ("a.2026", "b.bin", "c", "2026.11.23", "d", "e")
    (folder / "recordings.csv").write_text("\n".join(["recording,vehicle", *(f"{name},V1" for name in names)]))
    fleet = fleet_of(folder, cal)
    jobs = {job.recording: (job.path and job.path.name, job.problem) for job in fleet.jobs}
    assert jobs["a.2026"] == ("a.2026", "")
    assert jobs["b.bin"] == ("b.bin", "")
    assert jobs["2026.11.23"] == ("2026.11.23.csv", "")
    assert jobs["d"] == (None, "the table names it, but its file is not there.")
    assert jobs["c"][1].startswith("several files have its name: ")
    assert jobs["e"][1].endswith(f"e.csv', '{folder}/e.mf4'; rename all but one.")
    assert fleet.left_out == "not read, because the table does not name them: 1 .csv, 1 .mf4."
    assert fleet_of(folder / "recordings.csv", cal).left_out == "", "the user has named the table"


@pytest.mark.slow
@without_workers()
def test_track_reads_what_its_table_names_and_no_table_as_a_recording(tmp_path, cal, still):
    for name in ("a", "b"):
        clutchid.write(still, tmp_path / f"{name}.csv")
    (tmp_path / "b.csv").rename(tmp_path / "b.bin")
    (tmp_path / "b.toml").touch()
    table = tmp_path / "trips.csv"
    table.write_text("recording,vehicle,strokes\na.csv,V1,1\nb.bin,V1,2\nc,V1,3\n")
    tracked = clutchid.track(tmp_path, cal, table=table)
    assert [row.job.recording for row in tracked.wear.rows] == ["a", "b.bin", "c"]
    messages = [row.reading.message for row in tracked.wear.rows]
    assert messages[0].partition(": ")[2] == messages[1].partition(": ")[2]
    assert messages[2] == "the table names it, but its file is not there."
    assert tracked.left_out == "2 files are not read as recordings: 2 .toml."
    problems = {job.recording: job.problem for job in recordings_of([tmp_path / "a.csv"], read_table(table))[0]}
    assert problems["b.bin"] == "the table names it, but it is not among the recordings of this command."


@pytest.mark.slow
@without_workers()
def test_warnings_about_times_reach_the_rows_of_a_fleet(tmp_path, cal, still, monkeypatch):
    monkeypatch.setattr("clutchid.verbs.wear_reading._fitted", lambda *_: reading(0.0))
    clocks = {"a": "1970-01-01T00:00:10", "b": "2026-05-01T10:00:00", "c": ""}
    (tmp_path / "fleet" / "V1").mkdir(parents=True)
    for k, (name, clock) in enumerate(clocks.items()):
        log = Log(still.time, {**still.columns, "position": (k + 1) * still["position"]}, metadata={"start": clock})
        clutchid.write(log, tmp_path / "fleet" / "V1" / f"{name}.parquet")
    run = clutchid.fleet(tmp_path / "fleet", cal, tmp_path / "out", verb="track")
    rows = pl.read_parquet(tmp_path / "out" / "vehicles" / "V1.parquet")
    restarted = "its clock shows 1970-01-01: it was reset, so its date is not used."
    unknown = "no time in the file, the table or the name; placed after the others."
    assert dict(rows.select("recording", "warnings").rows()) == {"a": f"{restarted} {unknown}", "b": "", "c": unknown}
    wear = clutchid.track(tmp_path / "fleet" / "V1", cal).wear
    assert pl.read_parquet(tmp_path / "out" / "vehicles.parquet")["warnings"].to_list() == [" ".join(wear.warnings)]
    (warning,) = run.warnings
    assert warning.startswith("times of recordings of 1 vehicle are missing or contradict")
    assert warning.endswith(f"V1: {wear.warnings[0]}")
