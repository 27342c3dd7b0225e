"""Forecasts of a fleet: types, replacements, and the vehicles that are due first."""

import json
from datetime import UTC, date, datetime

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.documents.fleet_tables import VehicleRow
from clutchid.fleets import verbs
from clutchid.fleets.forecasts import DueVehicle, Horizon, forecast_of, horizon_of
from clutchid.wear.trend import Interval
from fixtures.commands import called
from fixtures.results import write_fleet
from wear.test_due import steady, vehicle

NAN = Interval(*[float("nan")] * 3)


def row(name, rate, count=20, kind="T1"):
    """A vehicle that wears at a rate in m a stroke, with 0.4 km a stroke."""
    strokes, shifts, _ = steady(np.random.default_rng(abs(hash(name)) % 1000), rate, count)
    wear = vehicle(strokes, shifts, km=0.4 * strokes)
    last = datetime(2026, 3, 1, tzinfo=UTC)
    return VehicleRow(
        name, kind, count, count, {"ok": count}, last, NAN, NAN, NAN, rate, NAN, "strokes", pool=kind,
        evidence=wear.evidence.packed,
    )  # fmt: skip


ROWS = [row(f"V{k}", rate) for k, rate in enumerate((1.5e-10, 2e-10, 2.5e-10, 3e-10, 3.5e-10))]


def test_the_vehicles_that_wear_fastest_are_due_first():
    fleet = forecast_of(ROWS, horizon=horizon_of("100000km"))
    assert [due.vehicle for due in fleet.due] == ["V4", "V3", "V2", "V1", "V0"]
    (kind,) = fleet.types
    assert (kind.name, kind.vehicles, kind.learnt, kind.axis) == ("T1", 5, True, "strokes")
    assert kind.rate.low < 2.5e-10 < kind.rate.high
    assert 1 / kind.per_km.value == pytest.approx(0.4, rel=0.05)
    assert [due.probability for due in fleet.due] == pytest.approx([row.within[2] for row in fleet.rows][::-1])


def test_a_vehicle_without_a_limit_is_in_no_forecast():
    fleet = forecast_of([*ROWS, row("V9", 2e-10)._replace(evidence="")], horizon=Horizon(days=90.0))
    assert len(fleet.due) == 5
    assert fleet.rows[-1].within == ()
    assert fleet.types[0].vehicles == 5


def test_replacements_are_counted_by_month_and_by_tag():
    depots = ("north", "south", "", "north", "south")
    fleet = forecast_of(
        [row._replace(tags=(("depot", at),) if at else ()) for row, at in zip(ROWS, depots, strict=True)]
    )
    table = pl.DataFrame(fleet.replacements, orient="row", schema=list(fleet.replacements[0]._fields))
    every = table.filter(pl.col("name") == "")
    assert every["expected"].sum() == pytest.approx(sum(row.by_month[-1] for row in fleet.rows))
    south = table.filter(pl.col("value") == "south")["expected"].sum()
    assert south == pytest.approx(fleet.rows[1].by_month[-1] + fleet.rows[4].by_month[-1])
    assert (every["low"] <= every["expected"]).all()
    assert (every["expected"] <= every["high"]).all()


def test_types_are_forecast_apart():
    fleet = forecast_of([*ROWS, row("W", 1e-9, 12, kind="T2")])
    assert [(kind.name, kind.learnt) for kind in fleet.types] == [("T1", True), ("T2", False)]


def test_a_day_is_so_many_days_from_the_last_recording_of_each():
    by_day = forecast_of(ROWS, horizon=horizon_of("2026-08-28")).due
    by_days = forecast_of(ROWS, horizon=horizon_of("180d")).due
    assert by_day == by_days
    assert horizon_of("2026-08-28") == Horizon(day=date(2026, 8, 28))
    assert horizon_of("") is None


@pytest.mark.parametrize("text", ["20000", "0km", "-5d", "3 weeks", "2026-13-01"])
def test_a_horizon_that_is_none_is_one_sentence(text):
    with pytest.raises(clutchid.ParameterError, match="is a distance, a time or a day"):
        horizon_of(text)


def test_the_tables_of_a_fleet_have_the_forecast(tmp_path):
    write_fleet(tmp_path)
    vehicles = pl.read_parquet(tmp_path / "vehicles.parquet")
    steady_one = next(row for row in vehicles.to_dicts() if row["p_within_90_days"] is not None)
    assert steady_one["left_strokes_low"] < steady_one["left_strokes"] < steady_one["left_strokes_high"]
    assert 0.0 <= steady_one["p_within_90_days"] <= steady_one["p_within_365_days"] <= 1.0
    assert steady_one["left_km"] > 0.0
    assert pl.read_parquet(tmp_path / "types.parquet")["vehicles"].sum() == 2
    assert pl.read_parquet(tmp_path / "replacements.parquet").height == 12


@pytest.mark.parametrize("as_json", [False, True])
def test_the_list_of_what_is_due_is_printed(monkeypatch, capsys, tmp_path, as_json):
    bands = Interval(30e3, 12e3, 55e3), Interval(80.0, 30.0, 140.0)
    due = tuple(DueVehicle(f"V{k:02d}", "T1", 0.9 - 0.07 * k, *bands) for k in range(13))
    run = verbs.FleetRun({"ok": 26}, 13, 26, tmp_path, due=due)
    monkeypatch.setattr(verbs, "fleet", lambda *_, within, **__: run if within else None)
    options = ["--start", "cal.toml", "--out", str(tmp_path), "--verb", "track", "--within", "20000km"]
    assert called("fleet", "trucks", *options, *(["--json"] if as_json else [])) == 0
    text = capsys.readouterr().out
    if as_json:
        assert json.loads(text)["due"][0]["vehicle"] == "V00"
        return
    assert "due within 20000km: 6.2 of 13 vehicles expected" in text
    assert "   90 %  V00 (T1): 12,000 to 55,000 km or 30 to 140 days left" in text
    assert "and 3 more with at least 1 %" in text
