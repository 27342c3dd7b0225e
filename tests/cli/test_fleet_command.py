"""The command ``fleet``: every recording is a row, runs go on where they ended, and workers do not matter."""

import json
import shutil
import signal
import subprocess
import sys

import polars as pl
import pytest

import clutchid
from clutchid.truck import drive, truck
from fixtures.commands import called, wait_for, without_workers
from fixtures.pages import blank_figures

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

#: Wear in mm of the recordings of the first vehicle.
WEAR = (0.4, 1.2, 2.0)

#: Why a run over these recordings fails.
NO_READING = (
    "3 of 6 recordings failed, more than --fail-share 0.2 allows, and 2 vehicles have no reading (V2, V3): column "
    "`message` of results.parquet says why."
)

#: Columns that differ from run to run.
COSTS = ("read_at", "written_at", "wall_s", "processor_s", "host", "worker", "attempt")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two types, of which one is calibrated, and recordings: one sent twice, one cut off, one of the other type."""
    out = tmp_path_factory.mktemp("fleet")
    log = drive(truck(0), seconds=4, seed=1, name="cal", conditions=True).log
    fit = clutchid.fit(log, measure=("position", "pressure_a"), free=("auto",))
    (out / "cals").mkdir()
    clutchid.write_parameters(clutchid.parameter_file(fit), out / "cals" / "T1.toml")
    for vehicle in ("V1", "V2", "V3"):
        (out / "trucks" / vehicle).mkdir(parents=True)
    for k, wear in enumerate(WEAR):
        worn = drive(truck(0), seconds=2.5, seed=k, wear=wear * 1e-3, pressure=False, conditions=True).log
        clutchid.write(worn, out / "trucks" / "V1" / f"r{k}.parquet")
    first = out / "trucks" / "V1" / "r0.parquet"
    shutil.copy(first, out / "trucks" / "V1" / "r0_again.parquet")
    (out / "trucks" / "V2" / "cut.parquet").write_bytes(first.read_bytes()[:5000])
    shutil.copy(out / "trucks" / "V1" / "r1.parquet", out / "trucks" / "V3" / "other.parquet")
    rows = [f"r{k},V1,T1,{2026 + k}-01-01,{200000 * k}" for k in range(len(WEAR))]
    rows += ["r0_again,V1,T1,2026-01-01,0", "cut,V2,T1,2026-01-01,0", "gone,V2,T1,2026-02-01,0"]
    rows += ["other,V3,T2,2026-01-01,0"]
    (out / "trucks" / "recordings.csv").write_text("\n".join(["recording,vehicle,type,date,strokes", *rows]) + "\n")
    return out


def arguments(folder, out, *options):
    start = ("--start", folder / "cals", "--out", out)
    return ["fleet", *map(str, (folder / "trucks", *start, *options))]


def run(folder, out, *options):
    return called(*arguments(folder, out, *options))


def content(out):
    """The tables of a run, without when and where recordings were read."""
    tables = [path for path in out.rglob("*.parquet") if not path.name.startswith("part-")]
    content = {str(path.relative_to(out)): pl.read_parquet(path).drop(COSTS, strict=False) for path in tables}
    parts = pl.scan_parquet(out / "recordings" / "**" / "*.parquet", hive_partitioning=True).drop(COSTS).collect()
    loads = parts.drop("record").sort("vehicle", "recording").unique(maintain_order=True)
    return {name: table.to_dicts() for name, table in content.items()} | {"recordings": loads.to_dicts()}


@pytest.fixture(scope="module")
def tracked(folder):
    out = folder / "one"
    with without_workers(), blank_figures():
        assert run(folder, out, "--verb", "track", "--limit", "0.2") == 1, "two vehicles have no reading"
    return out


@pytest.fixture(scope="module")
def observed(folder):
    out = folder / "observed"
    with without_workers():
        assert run(folder, out, "--verb", "observe") == 1
    return out


def test_every_recording_is_a_row_with_a_status_and_a_sentence(tracked):
    rows = pl.read_parquet(tracked / "results.parquet")
    by_name = {row["recording"]: row for row in rows.iter_rows(named=True)}
    assert list(by_name) == ["r0", "r0_again", "r1", "r2", "cut", "gone", "other"]
    assert {name: row["status"] for name, row in by_name.items() if row["status"] not in ("ok", "warning")} == {
        "cut": "bad_input", "gone": "bad_input", "other": "bad_input",
    }  # fmt: skip
    assert "the same recording as r0 of V1; it counts once" in by_name["r0_again"]["message"]
    assert "cut.parquet" in by_name["cut"]["message"]
    assert "its file is not there" in by_name["gone"]["message"]
    assert "no calibration of type 'T2'" in by_name["other"]["message"]
    assert {name: bool(row["reason"]) for name, row in by_name.items()} == {
        "r0": False, "r0_again": True, "r1": False, "r2": False, "cut": True, "gone": True, "other": True,
    }  # fmt: skip
    worn = pl.concat(map(pl.read_parquet, (tracked / "vehicles").glob("V?.parquet")), how="diagonal_relaxed")
    assert dict(worn.select("recording", "reason").rows()) == dict(rows.select("recording", "reason").rows())
    assert worn.filter(vehicle="V1")["along"].to_list()[:3] == [0.0, 200000.0, 400000.0]
    for frame in (rows, worn, pl.read_parquet(tracked / "vehicles.parquet")):
        assert not any(column.is_nan().any() for column in frame.select(pl.col(pl.Float64)))
    for k in range(len(WEAR)):
        row = by_name[f"r{k}"]
        assert row["status"] == "ok" or "standard deviation of the load" not in row["message"]
        assert row["peak_low_N"] < row["peak_N"] < row["peak_high_N"]
        assert row["half_load_low_mm"] < row["half_load_mm"] < row["half_load_high_mm"]
        assert len(row["sha256"]) == 64
    vehicles = {row["vehicle"]: row for row in pl.read_parquet(tracked / "vehicles.parquet").iter_rows(named=True)}
    assert (vehicles["V1"]["recordings"], vehicles["V1"]["counted"]) == (3, 3)
    assert (vehicles["V2"]["counted"], vehicles["V3"]["counted"]) == (0, 0)
    parts = pl.read_parquet(tracked / "recordings" / "**" / "*.parquet", hive_partitioning=True)
    assert set(parts.filter(pl.col("force_N").is_not_null())["recording"]) == {"r0", "r0_again", "r1", "r2"}
    assert parts["read_at"].null_count() == 0


def test_the_page_of_the_fleet_leads_to_those_of_its_vehicles_and_back(tracked):
    page = (tracked / "index.html").read_text()
    for vehicle in ("V1", "V2", "V3"):
        assert f'href="vehicles/{vehicle}.html"' in page
        assert 'href="../index.html"' in (tracked / "vehicles" / f"{vehicle}.html").read_text()
    assert "there is no calibration of type …" in page


def test_a_run_that_is_killed_goes_on_and_ends_with_the_same_bytes(blank, folder, observed):
    out = folder / "killed"
    command = [sys.executable, "-m", "clutchid", *arguments(folder, out, "--verb", "observe")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    store = out / "run.sqlite"
    wait_for(lambda: process.poll() is not None or (store.exists() and b"V1r0" in store.read_bytes()), 120.0)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (out / "results.parquet").exists()
    assert run(folder, out, "--verb", "observe", "--workers", "2") == 1
    assert content(out) == content(observed)
    costs = pl.read_parquet(out / "recordings" / "**" / "*.parquet", hive_partitioning=True)
    assert costs["wall_s"].min() > 0.0
    assert costs["host"].null_count() == 0


def test_what_is_done_is_not_done_again_and_what_has_changed_is(blank, folder, tracked, capsys):
    options = ("--verb", "track", "--limit", "0.2", "--json")
    before, pages = content(tracked), tracked / "vehicles"
    made = {name: (pages / name).stat().st_mtime_ns for name in ("V1.html", "V2.html")}

    def read_now():
        """How many recordings were read, and the object that says why the run has failed."""
        capsys.readouterr()
        with without_workers():
            assert run(folder, tracked, *options) == 1
        shown = json.loads(capsys.readouterr().out)
        assert (shown["status"], shown["message"]) == ("failed", NO_READING)
        return shown["read"]

    assert read_now() == 0
    again = folder / "trucks" / "V1" / "r0_again.parquet"
    again.touch()  # another time, the same content
    assert read_now() == 0
    assert content(tracked) == before
    assert {name: (pages / name).stat().st_mtime_ns for name in made} == made
    content_before = again.read_bytes()
    shutil.copy(folder / "trucks" / "V1" / "r2.parquet", again)
    assert read_now() == 0, "its samples have been read as r2"
    assert (pages / "V1.html").stat().st_mtime_ns > made["V1.html"]
    assert (pages / "V2.html").stat().st_mtime_ns == made["V2.html"]
    again.write_bytes(content_before)
    assert read_now() == 0
    assert {**content(tracked), "recordings": None} == {**before, "recordings": None}


def test_the_observer_reads_a_fleet_too(observed, tracked):
    rows = (pl.read_parquet(out / "results.parquet") for out in (observed, tracked))
    at_end, fitted = (frame.row(by_predicate=pl.col("recording") == "r1", named=True) for frame in rows)
    assert " stroke" in at_end["message"]
    assert at_end["peak_N"] == pytest.approx(fitted["peak_N"], rel=0.05)


def test_parts_of_a_fleet_are_read_apart_and_events_once_and_a_run_makes_the_tables_of_all(folder, tracked, capsys):
    out, lines = folder / "apart", []
    with without_workers(), blank_figures():
        for part in ("1/2", "2/2", "2/2"):
            capsys.readouterr()
            assert run(folder, out, "--verb", "track", "--part", part) == 0
            lines.append(capsys.readouterr().out.splitlines())
        assert {path.name for path in out.iterdir()} == {"recordings", "run-1-of-2.sqlite", "run-2-of-2.sqlite"}
        assert lines[0][1].endswith("part 1/2; a run without --part makes the tables")
        assert ", 0 read in this run: " in lines[2][0]
        assert run(folder, out, "--verb", "track", "--limit", "0.2", "--json") == 1
        shown = json.loads(capsys.readouterr().out)
        assert shown["read"] == 0
        assert {**content(out), "recordings": None} == {**content(tracked), "recordings": None}
        assert run(folder, out, "--part", "3/2") == 2
        assert "--part 3/2: is a part of the fleet, such as 3/64" in capsys.readouterr().err


def test_an_event_is_one_row_however_often_it_comes(folder, capsys):
    out, recording = folder / "events", folder / "trucks" / "V1" / "r1.parquet"
    with without_workers(), blank_figures():
        for _ in range(2):
            assert run(folder, out, "--once", str(recording)) == 0
        assert capsys.readouterr().out.splitlines()[0].startswith("V1, r1: ok.")
        (part,) = (out / "recordings").rglob("*.parquet")
        assert pl.read_parquet(part)["recording"].to_list() == ["r1"]
        assert run(folder, out, "--once", str(folder / "trucks" / "V3" / "other.parquet")) == 2
        assert "there is no calibration of type 'T2'" in capsys.readouterr().err
        assert run(folder, out, "--json") == 1
        assert json.loads(capsys.readouterr().out)["read"] == 4, "all but the one of the event"
