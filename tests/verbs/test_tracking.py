"""The two passes of `track --by auto`: observed recordings, and those that are estimated after all."""

import json

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.log import Log
from clutchid.verbs import wear_reading
from clutchid.verbs.tracking import write_tracked
from fixtures.commands import backwards, called, without_workers
from fixtures.lives import reading

#: Shift in m of a recording after the one before, and the recordings whose observer misses.
SHIFT, COUNT, ODD = 4e-6, 10, (3, 6)


@pytest.fixture
def vehicle(tmp_path, monkeypatch):
    """A folder with dated recordings and a calibration; what was read, in order, by what and when."""
    asked, time = [], np.arange(0.0, 0.5, 0.001)

    def day(log):
        return int(log.metadata["start"][8:10])

    def observed(log, _content, _zero, *, screened):
        read = reading(SHIFT * day(log) + (0.4e-3 if day(log) in ODD else 0.0), by="observe")
        asked.append(("auto" if screened else "observe", day(log)))
        return read._replace(measurement=read.measurement._replace(by="observe"))

    def fitted(log, _content, _zero):
        asked.append(("estimate", day(log)))
        return reading(SHIFT * day(log), by="estimate")

    monkeypatch.setattr(wear_reading, "_observed", observed)
    monkeypatch.setattr(wear_reading, "_fitted", fitted)
    (tmp_path / "V1").mkdir()
    for k in range(1, COUNT + 1):
        columns = {"position": 1e-4 * time * k, "duty_supply": np.zeros(500), "duty_exhaust": np.ones(500)}
        log = Log(time, columns, metadata={"start": f"2026-01-{k:02d}"})
        clutchid.write(log, tmp_path / "V1" / f"run_{k:02d}.parquet")
    (tmp_path / "cal.toml").write_text("[parameters]\n")
    return tmp_path, asked


def tracked(vehicle, by, **options):
    folder, asked = vehicle
    asked.clear()
    wear = clutchid.track(folder / "V1", folder / "cal.toml", by=by, **options)
    write_tracked(wear, folder / "wear.parquet")
    return pl.read_parquet(folder / "wear.parquet"), list(asked)


def test_the_recordings_that_the_trend_does_not_expect_are_estimated_in_their_order(vehicle):
    counts = []
    with without_workers():
        rows, asked = tracked(vehicle, "auto", progress=lambda *numbers: counts.append(numbers))
    assert asked == [*(("auto", k) for k in range(1, COUNT + 1)), *(("estimate", k) for k in ODD)]
    assert counts[-1] == (COUNT + len(ODD),) * 2
    assert rows["by"].to_list() == ["estimate" if k in ODD else "observe" for k in range(1, COUNT + 1)]
    assert set(rows["outcome"]) == {"used"}


def test_the_number_of_workers_does_not_matter(vehicle):
    with without_workers():
        alone, _ = tracked(vehicle, "auto")
    with backwards("clutchid.verbs.tracking.processes.results"):
        several, asked = tracked(vehicle, "auto", workers=2)
    assert asked[0] == ("auto", COUNT)
    assert several.equals(alone)


@pytest.mark.parametrize("by", ["observe", "estimate"])
def test_what_reads_all_recordings_reads_each_of_them_once(vehicle, by):
    with without_workers():
        rows, asked = tracked(vehicle, by)
    assert asked == [(by, k) for k in range(1, COUNT + 1)]
    assert set(rows["by"]) == {by}
    assert rows["outcome"].to_list().count("left out") == (len(ODD) if by == "observe" else 0)


def test_the_command_estimates_by_default(vehicle, capsys):
    folder, asked = vehicle
    words = ("track", folder / "V1", "--start", folder / "cal.toml", "--out", folder / "w.parquet", "--json")
    for options, first in (((), "estimate"), (("--by", "auto"), "auto")):
        asked.clear()
        with without_workers():
            assert called(*words, *options) == 0
        assert asked[0][0] == first
        assert json.loads(capsys.readouterr().out)["status"] == "ok"


def test_a_table_of_wear_beside_the_calibration_is_used(vehicle):
    folder, _ = vehicle
    with without_workers():
        assert "wear" not in clutchid.track(folder / "V1", folder / "cal.toml").wear.now
        for name, end in (("cal", 1.5), ("other", 2.0)):
            (folder / f"{name}.wear.csv").write_text(f"wear [mm],half_load [mm],load [N]\n0,2.8,4000\n{end},2.9,4400\n")
        beside = clutchid.track(folder / "V1", folder / "cal.toml").wear
        other = clutchid.track(folder / "V1", folder / "cal.toml", wear_table=folder / "other.wear.csv").wear
    assert (beside.end_of_table, other.end_of_table) == (1.5e-3, 2e-3)
