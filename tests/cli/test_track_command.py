"""The command ``track``: files, order, faults, and bad input in one sentence."""

import csv
import json
import shutil
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.truck import drive, truck
from fixtures.commands import backwards, called, without_workers
from fixtures.pages import blank_figures

pytestmark = pytest.mark.slow

#: Wear in mm of the recordings, of which the last is like new again, twice.
WEAR = (0.4, 1.2, 2.0, 2.8, 0.1, 0.15)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A calibration, and recordings of a clutch that wears and is replaced: one cut off, one sent twice."""
    out = tmp_path_factory.mktemp("track")
    log = drive(truck(0), seconds=4, seed=1, name="cal", conditions=True).log
    calibration = clutchid.fit(log, measure=("position", "pressure_a"), free=("auto",))
    clutchid.write_parameters(clutchid.parameter_file(calibration), out / "cal.toml")
    (out / "V1").mkdir()
    rows = []
    for k, wear in enumerate(WEAR):
        worn = drive(truck(0), seconds=2.5, seed=k, wear=wear * 1e-3, pressure=False, conditions=True).log
        clutchid.write(worn, out / "V1" / f"r{k}.parquet")
        rows.append({"recording": f"r{k}", "vehicle": "V1", "date": f"2026-0{k + 1}-01", "strokes": 200000 * k})
    shutil.copy(out / "V1" / "r1.parquet", out / "V1" / "r1_again.parquet")
    (out / "V1" / "r9.parquet").write_bytes((out / "V1" / "r0.parquet").read_bytes()[:5000])
    rows += [{**rows[1], "recording": "r1_again"}, {**rows[-1], "recording": "r9", "strokes": 1100000}]
    rows += [{**rows[3], "recording": "r3_gone"}]
    with (out / "table.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return out


def run(folder, *options, recordings="V1"):
    return called("track", folder / recordings, "--start", folder / "cal.toml", *options)


@pytest.fixture(scope="module")
def told(folder):
    """What a run in this process prints on standard output."""
    files = ("--out", folder / "wear.parquet", "--report", folder / "wear.html", "--table", folder / "table.csv")
    shown = StringIO()
    with without_workers(), blank_figures(), redirect_stdout(shown):
        assert run(folder, *files, "--limit", "0.2") == 0
    return shown.getvalue()


def test_the_life_of_a_clutch_is_tracked(folder, told):
    assert "6 of 6 count, over 1,000,000 strokes; 3 other files, not a recording or a copy of one" in told
    assert "the clutch or its sensor was replaced between r3 and r4 on 2026-05-01" in told
    rows = pl.read_parquet(folder / "wear.parquet")
    assert rows["recording"].to_list() == ["r0", "r1", "r2", "r3", "r4", "r5", "r1_again", "r3_gone", "r9"]
    assert rows["outcome"].to_list() == [*["used"] * 4, "jump", "used", *["missing"] * 3]
    assert "the same recording as r1.parquet" in rows["message"][6]
    assert "its file is not there" in rows["message"][7]
    assert [bool(reason) for reason in rows["reason"]] == [outcome == "missing" for outcome in rows["outcome"]]
    assert rows["reason"].to_list()[6:] == rows["message"].to_list()[6:]
    # the sensor of this truck learns its zero
    rests = rows.filter(pl.col("outcome") != "missing")["rest_shift_mm"].fill_null(1.0)
    assert rests.is_between(-0.1, 0.1).all()
    assert rows["alarm"].to_list() == [None] * 4 + ["replaced"] + [None] * 4
    new = drive(truck(0), seconds=1).truth
    y = np.linspace(0.0, 0.02, 4001)
    for k, wear in ((3, 2.8e-3), (5, 0.15e-3)):
        worn = drive(truck(0), seconds=1, wear=wear).truth
        at = [y[np.argmax(truth.load(y) >= truth.load(y).max() / 2)] for truth in (new, worn)]
        assert rows["shift_filtered_low_mm"][k] < 1e3 * (at[1] - at[0]) < rows["shift_filtered_high_mm"][k]
    loads = pl.read_parquet(folder / "wear.load.parquet")
    assert loads["recording"].n_unique() == 7
    page = (folder / "wear.html").read_text(encoding="utf-8")
    assert "Wear of the clutch of V1" in page
    assert "http" not in page.replace("http://www.w3.org", "").replace("http-equiv", "")


def test_the_object_has_the_keys_of_every_result_and_two_workers_write_the_same_table(folder, told, capsys):
    with backwards() as workers:
        options = ("--table", folder / "table.csv", "--limit", "0.2", "--json", "--workers", 2)
        assert run(folder, "--out", folder / "again.parquet", *options) == 0
    content = json.loads(capsys.readouterr().out)
    assert workers == [2]
    assert content["status"] == "warning"
    assert content["wear"]["vehicle"] == "V1"
    assert content["wear"]["alarms"][0]["kind"] == "replaced"
    assert content["logs"]["r9"]["status"] == "bad_input"
    assert (folder / "again.parquet").read_bytes() == (folder / "wear.parquet").read_bytes()
