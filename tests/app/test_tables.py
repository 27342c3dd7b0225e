"""Results of track and fleet: what the page gets of their files, and which files it may read."""

import json
import shutil

import polars as pl
import pytest

from clutchid.app.session import Session
from clutchid.documents.json_text import json_text
from clutchid.errors import DataError
from clutchid.fleets.opened import MOST_LOADS, PLACES, files_of, opened_results
from fixtures.results import REPLACED, STEADY, UNREAD, lives, write_fleet, write_track


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a fleet."""
    return write_fleet(tmp_path_factory.mktemp("run").resolve())


@pytest.fixture(scope="module")
def track(tmp_path_factory):
    """The rows of a track, with the loads beside them."""
    return write_track(tmp_path_factory.mktemp("track").resolve())


def shown(path, vehicle=None):
    """What the page gets, as JSON that has no NaN and no infinity."""
    return json.loads(json_text(opened_results(path, path.parent, vehicle)))


def test_a_track_has_its_trend_its_forecast_and_its_loads(track):
    words, wear = shown(track), lives()[STEADY]
    trend = words["trend"]
    assert (words["kind"], words["vehicle"], trend["axis"], trend["counted"]) == ("vehicle", STEADY, "strokes", 19)
    assert trend["along"] == wear.s.tolist()
    assert [side[-1] for side in trend["bands"]["shift"]] == pytest.approx(wear.now["shift"].last, rel=1e-5)
    assert trend["now"]["shift"] == pytest.approx(wear.then["shift"].last, rel=1e-5)
    assert trend["left"] == pytest.approx([wear.left.median, wear.left.low, wear.left.high], rel=1e-5)
    assert trend["limit"] == {"of": "shift", "value": 5e-4}
    assert len(words["loads"]) == 20
    first = words["recordings"][0]
    assert [band[0] for band in first["at"]] == pytest.approx([4241.4, 4525.7, 4706.8, 4820.1], rel=1e-4)
    assert len(first["at"]) == len(PLACES)
    assert words["recordings"][7]["outcome"] == "left out"
    assert "the next recordings fit the trend without it" in words["recordings"][7]["said"]


def test_the_loads_of_a_track_lead_to_its_rows_and_without_them_the_trend_is_there(track, tmp_path):
    assert shown(track.with_name("wear.load.parquet"))["vehicle"] == STEADY
    (tmp_path / "alone.parquet").write_bytes(track.read_bytes())
    words = shown(tmp_path / "alone.parquet")
    assert (words["loads"], words["recordings"][0]["at"]) == ([], None)
    assert words["trend"]["limit"]["value"] == 5e-4


def test_a_trend_that_never_reaches_its_limit_has_no_end_in_sight(track, tmp_path):
    rows = pl.read_parquet(track).with_columns(
        pl.when(pl.col("left_strokes").is_not_null()).then(float("inf")).alias("left_strokes")
    )
    rows.write_parquet(tmp_path / "endless.parquet")
    assert shown(tmp_path / "endless.parquet")["trend"]["left"][0] == "inf"


def test_a_replaced_clutch_is_an_alarm_at_its_recording(run):
    words = shown(run / "vehicles.parquet", REPLACED)
    (alarm,) = words["trend"]["alarms"]
    assert (alarm["index"], alarm["kind"]) == (14, "replaced")
    assert alarm["words"] == "The clutch or its sensor was replaced between V 10 13 and V 10 14 on 2025-04-15."
    assert words["type"] == "A"
    assert words["recordings"][14]["outcome"] == "jump"
    assert [load["recording"] for load in words["loads"]] == [f"V 10 {k:02d}" for k in range(20)]


@pytest.mark.parametrize("name", ["vehicles.parquet", "results.parquet"])
def test_each_table_of_a_run_opens_the_same_fleet(run, name):
    words = shown(run / name)
    vehicles = words["vehicles"]
    assert (words["kind"], vehicles["vehicle"]) == ("fleet", [UNREAD, STEADY, REPLACED])  # V 2 before V 10
    assert vehicles["counted"] == [0, 19, 20]
    assert (vehicles["trust"], vehicles["shift"][0]) == (["none", "good", "good"], None)
    assert vehicles["peak"][1] == [4999.97, 4909.97, 5109.97]
    assert "was replaced between V 10 13 and V 10 14" in vehicles["alarms"][2]
    assert words["trends"]
    shares = vehicles["p_within_90_days"]
    assert shares[0] is None
    assert 0.0 <= shares[1] <= vehicles["p_within_365_days"][1] <= 1.0
    months, types = words["tables"]
    assert months["heads"][1:3] == ["month 1", "month 2"]
    assert [row[0] for row in months["rows"]] == ["expected", "95 % band, from", "to"]
    assert types["rows"][0][:3] == ["A", "2", "guessed"]


def test_the_file_of_a_vehicle_in_a_run_opens_it_alone(run):
    path = next(path for path in (run / "vehicles").glob("*.parquet") if path.name.startswith("V_10"))
    assert shown(path)["vehicle"] == REPLACED


def test_a_fleet_without_trends_has_loads_and_trust(run, tmp_path):
    (tmp_path / "results.parquet").write_bytes((run / "results.parquet").read_bytes())
    shutil.copytree(run / "recordings", tmp_path / "recordings")
    fleet = shown(tmp_path / "results.parquet")
    assert (fleet["trends"], fleet["vehicles"]["recordings"]) == (False, [2, 20, 20])
    assert fleet["tables"] == []
    words = shown(tmp_path / "results.parquet", STEADY)
    assert (words["trend"], len(words["loads"]), words["recordings"][0]["trust"]) == (None, 20, "good")


def test_of_many_loads_some_are_plotted_evenly_with_the_first_and_the_last(track, monkeypatch):
    monkeypatch.setattr("clutchid.fleets.opened.MOST_LOADS", 3)
    words = shown(track)
    assert [load["recording"] for load in words["loads"]] == ["V 2 00", "V 2 10", "V 2 19"]
    assert (words["load_count"], MOST_LOADS) == (20, 200)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (None, "a.parquet: cannot be read as a table"),
        ({"time [s]": [0.0]}, "a.parquet: is no result of `clutchid track`"),
        ({"recording": ["r"], "outcome": ["used"]}, "make it again with `clutchid track --out FILE.parquet`"),
    ],
)
def test_another_file_is_a_sentence(tmp_path, columns, said):
    if columns:
        pl.DataFrame(columns).write_parquet(tmp_path / "a.parquet")
    else:
        (tmp_path / "a.parquet").write_text("recording,outcome\n")
    with pytest.raises(DataError) as error:
        opened_results(tmp_path / "a.parquet", tmp_path, None)
    assert said in str(error.value)
    assert str(tmp_path) not in str(error.value)


def test_a_vehicle_that_is_not_there_is_a_sentence(run):
    with pytest.raises(DataError, match=r"V 9: results\.parquet has no recordings of it"):
        opened_results(run / "vehicles.parquet", run, "V 9")


def test_a_file_beside_the_opened_one_is_not_read_where_it_lies_elsewhere(run, tmp_path):
    below = (tmp_path / "below").resolve()
    below.mkdir()
    for name in ("results.parquet", "vehicles.parquet"):
        (below / name).write_bytes((run / name).read_bytes())
    for name in ("recordings", "vehicles"):
        (below / name).symlink_to(run / name)
    assert files_of(below / "results.parquet", below).loads == ()
    words = shown(below / "results.parquet", STEADY)
    assert (words["trend"], words["loads"]) == (None, [])
    own = next(path for path in (run / "vehicles").glob("V_2*.parquet") if ".load." not in path.name)
    (below / own.name).write_bytes(own.read_bytes())
    assert shown(below / "vehicles.parquet", STEADY)["trend"]["counted"] == 19, "as files that are sent lie"
    (below / own.name).unlink()
    (below / "vehicles").unlink()
    shutil.copytree(run / "vehicles", below / "own")
    (below / "vehicles").symlink_to(below / "own")
    assert len(shown(below / "results.parquet", STEADY)["loads"]) == 20


# requests


def test_a_result_below_the_folder_is_opened_by_its_path(idle, run):
    (idle.session.below / "wear.parquet").write_bytes(next((run / "vehicles").glob("*.parquet")).read_bytes())
    assert idle.ask("POST", "/api/tables", {"path": "wear.parquet"}).json == {"id": "table-1"}
    ((_, _, task, about),) = idle.submitted
    assert (task.below, about) == (idle.session.below, "table-1")
    listed = idle.ask("GET", "/api/files?under=&kind=tables").json["files"]
    assert [entry["name"] for entry in listed] == ["wear.parquet"]


@pytest.mark.parametrize("path", ["../secret.parquet", "/etc/passwd", "link.parquet", "a\x00b", "no.parquet"])
def test_a_result_elsewhere_is_refused(idle, tmp_path, path):
    (tmp_path / "secret.parquet").write_bytes(b"x")
    (idle.session.below / "link.parquet").symlink_to(tmp_path / "secret.parquet")
    assert idle.ask("POST", "/api/tables", {"path": path}).status == 422
    assert idle.submitted == []


def test_files_of_one_run_that_are_sent_lie_beside_each_other_and_are_forgotten_together(idle, track):
    first = idle.ask("PUT", "/api/tables?name=wear.parquet", body=[track.read_bytes()]).json["id"]
    loads = track.with_name("wear.load.parquet").read_bytes()
    for _ in range(2):  # once more is no error
        second = idle.ask("PUT", f"/api/tables?name=wear.load.parquet&beside={first}", body=[loads])
        assert second.json == {"id": first}
    task = idle.submitted[-1][2]
    path = idle.session.folder / "uploads" / first
    assert (task.path, task.below) == (path / "wear.parquet", path.resolve())
    assert len(shown(path.resolve() / "wear.parquet")["loads"]) == 20
    assert idle.ask("DELETE", f"/api/tables/{first}").status == 200
    assert not path.exists()
    assert idle.get(first) is None


@pytest.mark.parametrize("beside", ["table-9", "../..", "recording-1"])
def test_a_file_is_not_sent_beside_what_is_not_there(idle, beside):
    answer = idle.ask("PUT", f"/api/tables?name=wear.parquet&beside={beside}", body=[b"x"])
    assert "has been removed" in answer.message
    assert [path for path in idle.session.folder.rglob("*") if path.is_file()] == []


def test_a_vehicle_of_a_fleet_is_opened_once_and_no_other_name(idle, run):
    (idle.session.below / "vehicles.parquet").write_bytes((run / "vehicles.parquet").read_bytes())
    idle.ask("POST", "/api/tables", {"path": "vehicles.parquet"})
    assert "no such vehicle" in idle.ask("POST", "/api/tables/table-1/vehicles", {"vehicle": STEADY}).message
    idle.session.board.update("table-1", found=shown(run / "vehicles.parquet"), status="done")
    for _ in range(2):
        assert idle.ask("POST", "/api/tables/table-1/vehicles", {"vehicle": UNREAD}).json == {"id": "table-2"}
    assert idle.get("table-2")["vehicle"] == UNREAD
    assert idle.submitted[-1][2].vehicle == UNREAD
    for vehicle in ("V 9", "../x"):
        assert "no such vehicle" in idle.ask("POST", "/api/tables/table-1/vehicles", {"vehicle": vehicle}).message
    assert "no such vehicle" in idle.ask("POST", "/api/tables/table-2/vehicles", {"vehicle": STEADY}).message


@pytest.mark.slow
def test_a_job_reads_a_fleet_and_its_vehicles_and_says_what_is_none(working, run):
    below = working.session.below
    for path in run.rglob("*.parquet"):
        (below / "run" / path.parent.relative_to(run)).mkdir(parents=True, exist_ok=True)
        (below / "run" / path.relative_to(run)).write_bytes(path.read_bytes())
    fleet = working.ask("POST", "/api/tables", {"path": "run/results.parquet"}).json["id"]
    assert working.wait(fleet, "done", "failed")["found"]["count"] == 3
    vehicle = working.ask("POST", f"/api/tables/{fleet}/vehicles", {"vehicle": REPLACED}).json["id"]
    assert working.wait(vehicle, "done", "failed")["found"]["trend"]["alarms"][0]["kind"] == "replaced"
    part = next(below.rglob("part-*.parquet")).relative_to(below).as_posix()
    other = working.ask("POST", "/api/tables", {"path": part}).json["id"]
    said = working.wait(other, "done", "failed")
    assert (said["status"], said["bad_input"]) == ("failed", True)
    assert ".parquet: is no result of `clutchid track`" in said["message"]


def test_a_session_knows_the_name_of_a_file_as_text_only(tmp_path):
    (tmp_path / "below").mkdir()
    session = Session(tmp_path / "own", tmp_path / "below")
    session.jobs.submit = lambda *_: None
    id_ = session.open_table(tmp_path / "below" / "a\x1b[31m.parquet")
    assert "\x1b" not in session.board.item(id_).name
