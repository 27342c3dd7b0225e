"""Files that are no recordings, beside those of a clutch: rows with a sentence, which change nothing of its wear."""

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import DataError, ParameterError
from clutchid.fleets import output
from clutchid.log import Log
from clutchid.verbs import wear_reading
from clutchid.verbs.tracking import write_tracked
from clutchid.wear.history import WearReading
from clutchid.wear.trend import LaterCalibration
from fixtures.commands import without_workers
from fixtures.lives import reading

#: The rows of the vehicle in the folder of a fleet.
OWN = "out/vehicles/V1.parquet"

#: Numbers of the recordings, and the shift in m from one to the next.
COUNT, SHIFT = 8, 5e-6


@pytest.fixture
def fleet(tmp_path, monkeypatch):
    """A vehicle with dated recordings of a healthy clutch, whose readings are known by the time in their files."""

    def fitted(log, _content, _zero):
        return reading(SHIFT * int(log.metadata["start"][8:10]))

    monkeypatch.setattr(wear_reading, "_fitted", fitted)
    folder, time = tmp_path / "fleet" / "V1", np.arange(0.0, 0.5, 0.001)
    folder.mkdir(parents=True)
    for k in range(COUNT):
        columns = {"position": 1e-4 * time * (k + 1), "duty_supply": np.zeros(500), "duty_exhaust": np.ones(500)}
        clutchid.write(Log(time, columns, metadata={"start": f"2026-01-{1 + k:02d}"}), folder / f"run_{k}.parquet")
    (tmp_path / "cal.toml").write_text("[parameters]\n")
    return tmp_path


def wear_by(verb, folder):
    """The rows of the wear of the vehicle."""
    with without_workers():
        if verb == "fleet":
            clutchid.fleet(folder / "fleet", folder / "cal.toml", folder / "out", verb="track", limit=1e-4)
        else:
            tracked = clutchid.track(folder / "fleet" / "V1", folder / "cal.toml", limit=1e-4)
            write_tracked(tracked, folder / "wear.parquet")
    return pl.read_parquet(folder / (OWN if verb == "fleet" else "wear.parquet"))


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["fleet", "track"])
def test_foreign_tables_and_a_file_that_was_cut_off_change_nothing(fleet, verb):
    before, folder = wear_by(verb, fleet), fleet / "fleet" / "V1"
    assert set(before["axis"]) == {"days"}
    assert before["left_days"][-1] > 0.0
    (folder / "run_9.parquet").write_bytes((folder / "run_0.parquet").read_bytes()[:1000])
    for k in range(25):
        (folder / f"sales_2026-02-{1 + k:02d}.csv").write_text("day;shop;sum\n1;7;12.5\n2;7;13.5\n")
    after = wear_by(verb, fleet)
    assert after[:COUNT].equals(before)
    beside = after[COUNT:]
    assert (beside.height, set(beside["status"]), set(beside["outcome"])) == (26, {"bad_input"}, {"missing"})
    for column in ("along", "shift_smoothed_mm", "left_days", "shift_mm"):
        assert beside[column].null_count() == 26
    if verb == "fleet":
        (vehicle,) = pl.read_parquet(fleet / "out" / "vehicles.parquet").to_dicts()
        assert (vehicle["recordings"], vehicle["counted"], vehicle["axis"]) == (COUNT, COUNT, "days")
        assert pl.read_parquet(fleet / "out" / "results.parquet")["is_recording"].sum() == COUNT


def run_of(folder, **options):
    with without_workers():
        return clutchid.fleet(folder / "fleet", options.pop("start", folder / "cal.toml"), folder / "out", **options)


@pytest.mark.slow
def test_a_run_fails_where_too_many_recordings_or_all_of_a_vehicle_have_no_reading(fleet, monkeypatch):
    assert run_of(fleet).failure == ""
    fitted = wear_reading._fitted

    def failing(log, *how):
        return WearReading("failed", "it failed.") if int(log.metadata["start"][8:10]) < 4 else fitted(log, *how)

    monkeypatch.setattr(wear_reading, "_fitted", failing)
    run = run_of(fleet, ambient=1e5)  # so that all are read again
    assert run.failure.startswith("3 of 8 recordings failed, more than --fail-share 0.2 allows: column `message` of")
    (fleet / "fleet" / "V2").mkdir()
    (fleet / "fleet" / "V2" / "sales.csv").write_text("day;shop;sum\n1;7;12.5\n2;7;13.5\n")
    run = run_of(fleet, fail_share=0.5, ambient=1e5)
    assert run.failure == "1 vehicle has no reading (V2): column `message` of results.parquet says why."
    with pytest.raises(ParameterError, match=r"--fail-share 20: is a share from 0 to 1"):
        run_of(fleet, fail_share=20)


@pytest.mark.slow
def test_a_table_of_wear_of_a_vehicle_its_type_or_beside_the_one_calibration_is_used(fleet):
    table = "wear [mm],half_load [mm],load [N]\n0,2.8,4000\n{},2.9,4400\n"
    for end, name in ((1.5, "cal"), (2.0, "cals/V1"), (3.0, "cals/T9")):
        (fleet / name).parent.mkdir(exist_ok=True)
        (fleet / f"{name}.toml").write_text("[parameters]\n")
        (fleet / f"{name}.wear.csv").write_text(table.format(end))
    for start, end in (("cal.toml", 1.5), ("cals", 2.0)):
        run = run_of(fleet, verb="track", start=fleet / start)
        assert set(pl.read_parquet(fleet / OWN)["limit_mm"]) == {end}
    assert run.warnings == ("T9.wear.csv: no vehicle and no type has that name, so that it is not used.",)


def away(paths, how):
    """Move the files of a vehicle away, as retention, a cold tier or a share that is down do."""
    for path in paths:
        path.rename(path.parents[2] / path.name)
        if how == "links":
            path.symlink_to(path.parents[2] / "share" / path.name)
        if how == "stubs":
            path.write_bytes(b"moved to the archive")
    folder = paths[0].parent
    if how in ("folder", "source") and not any(folder.iterdir()):
        folder.rmdir()
        if how == "source":
            folder.parent.rmdir()


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, COUNT])
@pytest.mark.parametrize("how", ["files", "folder", "source", "links", "stubs"])
def test_readings_are_kept_when_their_files_move_away_and_no_file_is_read_again(fleet, how, count):
    run_of(fleet, verb="track", limit=1e-4)
    tables = [fleet / name for name in (OWN, "out/vehicles.parquet", "out/vehicles/V1.load.parquet")]
    before, folder = [table.read_bytes() for table in tables], fleet / "fleet" / "V1"
    paths = sorted(folder.iterdir())[:count]
    away(paths, how)
    run = run_of(fleet, verb="track", limit=1e-4)
    assert (run.statuses, run.failure, [table.read_bytes() for table in tables]) == ({"ok": COUNT}, "", before)
    assert pl.read_parquet(fleet / "out" / "results.parquet")["file_gone"].sum() == count
    assert f"{count} of {COUNT} recordings: the file is gone, and the reading is kept" in run.warnings[0]
    folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        path.unlink(missing_ok=True)
        (fleet / path.name).rename(folder / f"again_{path.name}")
    run = run_of(fleet, verb="track", limit=1e-4)
    assert (run.read, run.statuses, run.warnings) == (0, {"ok": COUNT}, ()), "they have come back under other names"
    results = pl.read_parquet(fleet / "out" / "results.parquet")
    assert sum(name.startswith("again_") for name in results["recording"]) == count
    assert not results["file_gone"].any()


@pytest.mark.slow
def test_missing_recordings_are_forgotten_on_request_but_not_all_of_them(fleet):
    run_of(fleet, verb="track")
    paths = sorted((fleet / "fleet" / "V1").iterdir())
    away(paths[:3], "files")
    run = run_of(fleet, verb="track", forget_missing=True)
    assert (run.statuses, run.warnings) == ({"ok": COUNT - 3}, ())
    (fleet / "out" / "run.sqlite").unlink()
    run = run_of(fleet, verb="track")
    assert (run.read, run.statuses, run.warnings) == (0, {"ok": COUNT - 3}, ()), "the parts say that they are forgotten"
    table = pl.read_parquet(fleet / "out" / "recordings" / "**" / "*.parquet").sort("written_at")
    newest = table.unique("recording", keep="last").filter(pl.col("status") == "forgotten")
    assert sorted(newest["recording"]) == [path.stem for path in paths[:3]]
    paths[0].write_bytes((fleet / paths[0].name).read_bytes())
    run = run_of(fleet, verb="track")
    assert (run.read, run.statuses) == (1, {"ok": COUNT - 2}), "and are read again where they come back"
    away(paths[:1], "files")
    assert run_of(fleet, verb="track", forget_missing=True).statuses == {"ok": COUNT - 3}
    away(paths[3:], "files")
    with pytest.raises(DataError, match="has no recordings"):
        run_of(fleet, verb="track", forget_missing=True)
    assert run_of(fleet, verb="track").statuses == {"ok": COUNT - 3}


@pytest.mark.slow
def test_a_recording_that_moves_to_another_vehicle_or_is_copied_is_not_read_again(fleet):
    run_of(fleet, verb="track")
    paths = sorted((fleet / "fleet" / "V1").iterdir())
    (fleet / "fleet" / "V2").mkdir()
    paths[0].rename(fleet / "fleet" / "V2" / "other.parquet")
    (fleet / "fleet" / "V1" / "copy.parquet").write_bytes(paths[1].read_bytes())
    run = run_of(fleet, verb="track")
    assert run.read == 0
    rows = pl.read_parquet(fleet / "out" / "results.parquet").select("vehicle", "recording", "status").rows()
    assert ("V2", "other", "ok") in rows
    assert len(rows) == COUNT + 1
    assert [row for row in rows if row[2] == "warning"] == [("V1", "run_1", "warning")], "which is one recording"


@pytest.mark.slow
def test_the_place_in_a_table_that_is_gone_is_known_and_another_calibration_ends_the_comparison(fleet):
    folder = fleet / "fleet"
    rows = [f"run_{k},V1,T1,{1000 * k}" for k in range(COUNT)]
    (folder / "recordings.csv").write_text("\n".join(["recording,vehicle,type,strokes", *rows]) + "\n")
    run_of(fleet, verb="track")
    before = (fleet / OWN).read_bytes()
    (folder / "recordings.csv").unlink()
    away(sorted((folder / "V1").iterdir()), "source")
    assert run_of(fleet, verb="track").statuses == {"ok": COUNT}
    assert (fleet / OWN).read_bytes() == before
    assert set(pl.read_parquet(fleet / OWN)["axis"]) == {"strokes"}
    (fleet / "cal.toml").write_text("[parameters]\nM = 9.0\n")
    run = run_of(fleet, verb="track")
    assert run.statuses == {"warning": COUNT}
    assert run.failure.startswith("1 vehicle has no reading (V1)")
    assert "was read from another calibration" in pl.read_parquet(fleet / "out" / "results.parquet")["reason"][0]


@pytest.mark.slow
def test_a_fleet_by_auto_observes_first_and_estimates_what_the_trend_does_not_expect(fleet, monkeypatch):
    fitted, days = wear_reading._fitted, []

    def observed(log, *_how, **_options):
        day = int(log.metadata["start"][8:10])
        days.append(day)
        return reading(SHIFT * day + (2e-3 if day == 5 else 0.0))._replace(by="observe")

    monkeypatch.setattr(wear_reading, "_observed", observed)
    monkeypatch.setattr(wear_reading, "_fitted", lambda log, *how: fitted(log, *how)._replace(by="estimate"))
    run = run_of(fleet, verb="track", by="auto")
    by = dict(pl.read_parquet(fleet / "out" / "results.parquet").select("recording", "by").rows())
    assert by == {f"run_{k}": "estimate" if k == 4 else "observe" for k in range(COUNT)}
    assert (run.read, sorted(days)) == (COUNT + 1, [*range(1, COUNT + 1)])
    assert set(pl.read_parquet(fleet / OWN)["outcome"]) == {"used"}
    assert run_of(fleet, verb="track", by="auto").read == 0
    with pytest.raises(ParameterError, match="--by auto: belongs to --verb track; for --verb fit leave it out"):
        run_of(fleet, by="auto")


@pytest.mark.slow
def test_a_calibration_that_holds_from_a_date_reads_what_is_later_and_is_no_new_clutch(fleet, monkeypatch):
    def fitted(log, content, _zero):
        day = int(log.metadata["start"][8:10])
        return reading(SHIFT * day - (2e-4 if content.actuator.parameters.M == 9.0 else 0.0))

    monkeypatch.setattr(wear_reading, "_fitted", fitted)
    offset = LaterCalibration(2e-4, 1e-5, 0.0, 0.01)
    monkeypatch.setattr(output, "later_calibrations", lambda starts: {starts[1]: offset})
    (fleet / "cals").mkdir()
    (fleet / "cals" / "V1.toml").write_text("[parameters]\n")
    (fleet / "cals" / "V1@2026-01-05.toml").write_text("[parameters]\nM = 9.0\n")
    run = run_of(fleet, verb="track", start=fleet / "cals")
    results = pl.read_parquet(fleet / "out" / "results.parquet")
    assert results["calibration"].to_list() == ["V1.toml"] * 4 + ["V1@2026-01-05.toml"] * 4
    assert (run.read, run.alarms) == (COUNT + 4, "0 alarms listed"), "the days are known when the files have been read"
    trend = pl.read_parquet(fleet / OWN)
    assert set(trend["outcome"]) == {"used"}
    assert trend["alarm"].null_count() == COUNT
    assert 0.0 < trend["shift_smoothed_mm"][-1] < 0.08, "0.04 are true, and -0.16 without the offset"
    assert run_of(fleet, verb="track", start=fleet / "cals").read == 0
    (fleet / "cals" / "V1.toml").rename(fleet / "cals" / "V1@2026-01-03.toml")
    run = run_of(fleet, verb="track", start=fleet / "cals")
    assert run.statuses == {"ok": 6, "bad_input": 2}
    messages = pl.read_parquet(fleet / "out" / "results.parquet")["message"]
    assert messages[0] == "no calibration of vehicle 'V1' holds on 2026-01-01: the first one is of 2026-01-03."
    (fleet / "cals" / "V1@20260105.toml").write_text("[parameters]\nM = 8.0\n")
    run_of(fleet, verb="track", start=fleet / "cals")
    message = pl.read_parquet(fleet / "out" / "results.parquet")["message"][-1]
    assert message == "V1@2026-01-05.toml and V1@20260105.toml hold from the same date; keep one of them."
