"""The tables and pages of the vehicles of a fleet, whatever their names are."""

import os
from functools import partial

import polars as pl
import pytest

from clutchid.fleets.jobs import Fleet, fleet_of
from clutchid.systems import is_device
from clutchid.verbs.reading import Reading
from clutchid.verbs.tracking import track, write_tracked
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.history import RecordingJob, WearReading
from fixtures.commands import without_workers
from fixtures.results import write_states

pytestmark = pytest.mark.slow


def written(out, fleet, read):
    """The files of a run in which every recording was read by a function; vehicles with their pages."""
    write_states(out, [(job, read(job)) for job in fleet.jobs])
    rows = pl.read_parquet(out / "vehicles.parquet")["vehicle"].to_list()
    return rows, [path.name for path in (out / "vehicles").iterdir()]


@pytest.mark.parametrize(
    ("vehicles", "plain"),
    [
        (("A0", "a0"), "A0.html"),
        (("n" * 300, "n" * 299 + "m"), ""),
        (("ü" * 200, "x/y", "x_y"), "x_y.html"),
        (("aux", "COM1.7"), ""),
    ],
)
def test_every_vehicle_has_a_page_that_any_system_can_have(tmp_path, vehicles, plain):
    jobs = tuple(
        RecordingJob("r", vehicle, path=tmp_path / "r.parquet", start=tmp_path) for vehicle in sorted(vehicles)
    )
    rows, pages = written(tmp_path / "out", Fleet(jobs), lambda _: WearReading("bad_input", "its sentence."))
    assert sorted(rows) == sorted(vehicles)
    pages = [page for page in pages if page.endswith(".html")]
    assert len({page.casefold() for page in pages}) == len(vehicles)
    assert max(len(page.encode()) for page in pages) < 200
    assert not plain or plain in pages
    assert not any(map(is_device, pages))


def test_a_file_whose_name_is_no_text_is_a_row_and_the_others_go_on(tmp_path):
    vehicle = tmp_path / "fleet" / "V1"
    vehicle.mkdir(parents=True)
    spoiled = vehicle / os.fsdecode(b"\xff\xfe.parquet")
    for path in (spoiled, vehicle / "other.parquet"):
        path.write_text("no table")
    start = tmp_path / "cal.toml"
    start.touch()
    fleet = fleet_of(tmp_path / "fleet", start)
    spoiled.unlink()  # so that the sentence names the file
    rows, _ = written(tmp_path / "out", fleet, partial(read_recording, Reading(ambient=1e5), "fit"))
    assert rows == ["V1"]
    results = pl.read_parquet(tmp_path / "out" / "results.parquet")
    assert results["recording"].to_list() == [r"\xff\xfe", "other"]
    assert r"\xff\xfe.parquet: there is no such file" in results["message"][0]


def test_track_takes_a_file_whose_name_is_no_text(tmp_path):
    path = tmp_path / os.fsdecode(b"\xff\xfe.parquet")
    path.write_text("no table")
    (tmp_path / "cal.toml").touch()
    with without_workers():
        write_tracked(track([path], tmp_path / "cal.toml"), tmp_path / "wear.parquet")
    assert pl.read_parquet(tmp_path / "wear.parquet")["recording"].to_list() == [r"\xff\xfe"]
