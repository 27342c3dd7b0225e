"""The files of a virtual fleet."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid.errors import DataError, ExportError
from clutchid.truck import aged, truck
from clutchid.truck.service import visits
from clutchid.verbs.virtual_fleet import LOAD_POSITIONS, load_at_positions, write_fleet
from fixtures.commands import backwards, called, without_workers


def rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def plan():
    """Two vehicles with two recordings each, one of them sent twice, one cut off, one with a restarted clock."""
    first, second = (vehicle[:2] for vehicle in visits(2, 3, days=20.0, types=2, seed=5000))
    clock = visits(1, 1).__next__()[0].begin.replace(year=1970)
    return [
        (replace(first[0], fault="twice"), replace(first[1], fault="cut off")),
        (replace(second[0], clock=clock, fault="clock"), second[1]),
    ]


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    out = tmp_path_factory.mktemp("fleets") / "fleet"
    with without_workers():
        assert write_fleet(out, plan, seconds=2.0) == 4
    return out


@pytest.mark.slow
def test_a_fleet_has_recordings_calibrations_a_table_and_the_truth(plan, folder):
    listed, truth = rows(folder / "recordings.csv"), rows(folder / "truth.csv")
    assert [row["recording"] for row in truth] == [visit.recording for vehicle in plan for visit in vehicle]
    assert len(listed) == 5, "one was sent twice"
    for row in listed:
        assert (folder / "recordings" / row["vehicle"] / f"{row['recording']}.parquet").exists()
        assert (folder / "calibrations" / f"{row['type']}.parquet").exists()
    log = clutchid.read(folder / "recordings" / "A00001" / "A00001_0001.parquet")
    assert {"temperature_ambient", "pressure_supply"} <= log.columns.keys()
    assert "pressure_a" not in log
    assert log.metadata["start"] == plan[1][1].begin.isoformat()
    assert "pressure_a" in clutchid.read(folder / "calibrations" / f"{listed[0]['type']}.parquet")


def test_the_faults_of_files_are_real(plan, folder):
    with pytest.raises(DataError):
        clutchid.read(folder / "recordings" / "A00000" / "A00000_0001.parquet")
    once, again = (folder / "recordings" / "A00000" / f"A00000_0000{mark}.parquet" for mark in ("", "_again"))
    assert once.read_bytes() == again.read_bytes()
    assert clutchid.read(folder / "recordings" / "A00001" / "A00001_0000.parquet").metadata["start"].startswith("1970")


def test_the_truth_is_that_of_the_truck_at_its_wear(plan, folder):
    row, visit = rows(folder / "truth.csv")[3], plan[1][1]
    load = load_at_positions(aged(truck(visit.number), visit.wear, visit.cycles))
    assert float(row["peak [N]"]) == pytest.approx(load.max())
    half = np.interp(float(row["half_load [mm]"]) * 1e-3, LOAD_POSITIONS, load)
    assert half == pytest.approx(load.max() / 2, rel=1e-6)
    table = rows(folder / "calibrations" / f"{row['type']}.wear.csv")
    by_wear = np.array([[float(cell) for cell in line.values()] for line in table])
    assert float(row["half_load [mm]"]) == pytest.approx(np.interp(visit.wear * 1e3, *by_wear.T[:2]), abs=2e-3)
    assert float(row["limit [mm]"]) == pytest.approx(by_wear[-1, 1] - by_wear[0, 1], abs=1e-6)


@pytest.mark.slow
def test_the_number_of_workers_does_not_matter(plan, folder, tmp_path):
    with backwards("clutchid.verbs.virtual_fleet.results") as workers:
        write_fleet(tmp_path / "fleet", plan, seconds=2.0, workers=2)
    assert workers == [2]
    for path in folder.rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "fleet" / path.relative_to(folder)).read_bytes(), path.name


def test_a_folder_with_files_is_left_alone(plan, tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(ExportError, match="exists already; name a new folder"):
        write_fleet(tmp_path, plan, seconds=2.0)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_the_command_drives_a_fleet(tmp_path, capsys):
    options = ("--fleet", "1", "--months", "0.6", "--seconds", "1", "--no-supply", "1", "--events", "leak,sensor")
    with without_workers():
        assert called("drive", *options, "--out", tmp_path / "fleet") == 0
    truth = rows(tmp_path / "fleet" / "truth.csv")
    assert len(truth) in (2, 3)
    assert {row["supply_recorded"] for row in truth} == {"False"}
    (path, *_) = (tmp_path / "fleet" / "recordings").rglob("*.parquet")
    assert "pressure_supply" not in clutchid.read(path)
    assert called("drive", *options, "--out", tmp_path / "other", "--wear", "1") == 2
    assert "--wear is for a single recording" in capsys.readouterr().err
