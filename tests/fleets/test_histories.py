"""Files that are no recordings, beside those of a clutch: rows with a sentence, which change nothing of its wear."""

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import ParameterError
from clutchid.log import Log
from clutchid.verbs import wear_reading
from clutchid.verbs.tracking import write_tracked
from clutchid.wear.history import WearReading
from fixtures.commands import without_workers
from fixtures.lives import reading

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
    return pl.read_parquet(folder / ("out/wear.parquet" if verb == "fleet" else "wear.parquet"))


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["fleet", "track"])
def test_foreign_tables_and_a_file_that_was_cut_off_change_nothing(fleet, verb):
    before, folder = wear_by(verb, fleet), fleet / "fleet" / "V1"
    assert set(before["axis"]) == {"days"}
    assert before["left"][-1] > 0.0
    (folder / "run_9.parquet").write_bytes((folder / "run_0.parquet").read_bytes()[:1000])
    for k in range(25):
        (folder / f"sales_2026-02-{1 + k:02d}.csv").write_text("day;shop;sum\n1;7;12.5\n2;7;13.5\n")
    after = wear_by(verb, fleet)
    assert after[:COUNT].equals(before)
    beside = after[COUNT:]
    assert (beside.height, set(beside["status"]), set(beside["outcome"])) == (26, {"bad_input"}, {"missing"})
    for column in ("along", "shift smoothed [m]", "left", "shift measured [m]"):
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
    for start, end in (("cal.toml", 1.5e-3), ("cals", 2e-3)):
        run = run_of(fleet, verb="track", start=fleet / start)
        assert set(pl.read_parquet(fleet / "out" / "wear.parquet")["limit [m]"]) == {end}
    assert run.warnings == ("T9.wear.csv: no vehicle and no type has that name, so that it is not used.",)
