"""Which recordings a fleet has, from folders and from tables, and what contradicts."""

import os
from types import SimpleNamespace

import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.fleets import verbs
from clutchid.fleets.cluster import Workers
from clutchid.fleets.jobs import fleet_of
from clutchid.fleets.plan import ReadingPlan
from clutchid.verbs.tracking import recordings_of


@pytest.fixture
def depot(tmp_path):
    """Two vehicles with recordings of the same names, and a calibration."""
    for vehicle in ("V1", "V2"):
        (tmp_path / "fleet" / vehicle).mkdir(parents=True)
        for name in ("a.parquet", "b.mf4", "notes.txt"):
            (tmp_path / "fleet" / vehicle / name).touch()
    (tmp_path / "cal.toml").touch()
    return tmp_path


def table(folder, *rows, head="recording,vehicle,type"):
    path = folder / "fleet" / "recordings.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def calibrations(folder, *names):
    for name in names:
        (folder / "cals").mkdir(exist_ok=True)
        (folder / "cals" / f"{name}.toml").touch()
    return folder / "cals"


def keys(fleet):
    return [(job.vehicle, job.recording) for job in fleet.jobs]


def test_each_folder_of_recordings_is_a_vehicle(depot):
    fleet = fleet_of(depot / "fleet", depot / "cal.toml")
    assert keys(fleet) == [("V1", "a"), ("V1", "b"), ("V2", "a"), ("V2", "b")]
    assert {job.start for job in fleet.jobs} == {depot / "cal.toml"}
    assert fleet.jobs[2].path == depot / "fleet" / "V2" / "a.parquet"


def test_a_table_says_vehicle_and_type_and_finds_the_files_below_it(depot):
    path = table(depot, "a,V1,T1", "a,V2,T2", "b.mf4,V2,T2", "c,V2,T2", "d,V3,T3")
    cals = calibrations(depot, "T1", "V2")
    for source in (path, depot / "fleet"):
        jobs = {(job.vehicle, job.recording): job for job in fleet_of(source, cals).jobs}
        assert jobs["V1", "a"].path == depot / "fleet" / "V1" / "a.parquet"
        assert (jobs["V1", "a"].start, jobs["V2", "a"].start) == (cals / "T1.toml", cals / "V2.toml")
        assert jobs["V2", "b"].path == depot / "fleet" / "V2" / "b.mf4"
        assert "its file is not there" in jobs["V2", "c"].problem
    (depot / "fleet" / "d.csv").touch()
    job = fleet_of(path, cals).jobs[-1]
    assert job.start is None
    assert job.problem.startswith("there is no calibration of type 'T3'")


def test_a_table_names_files_by_their_path_from_its_folder_or_from_the_root(depot):
    beside = depot / "beside" / "c.csv"
    beside.parent.mkdir()
    for path in (beside, depot / "fleet" / "V1" / "c.csv"):
        path.touch()
    path = table(
        depot, "../beside/c.csv,V1,", f"{depot}/beside/c.csv,V2,", "V1/a.parquet,V2,", "../V2/b.mf4,V2,", "../d,V2,"
    )
    jobs = {(job.vehicle, job.recording): job for job in fleet_of(path, depot / "cal.toml").jobs}
    assert [jobs[vehicle, "c"].path.resolve() for vehicle in ("V1", "V2")] == [beside, beside]
    assert jobs["V2", "a"].path == depot / "fleet" / "V1" / "a.parquet", "not the one in the folder of its name"
    assert jobs["V2", "b"].path == depot / "fleet" / "V2" / "b.mf4", "by its name, where the path leads nowhere"
    assert (jobs["V2", "d"].path, jobs["V2", "d"].problem) == (None, "the table names it, but its file is not there.")


def test_what_cannot_be_a_fleet_is_refused_in_a_sentence(depot, tmp_path):
    cal = depot / "cal.toml"
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="empty: has no recordings"):
        fleet_of(tmp_path / "empty", cal)
    for name in ("nowhere", "n" * 300):
        with pytest.raises(DataError, match=f"{name}: there is no such folder or table"):
            fleet_of(tmp_path / name, cal)
    for rows, said in (
        (("a,,T1,",), "'a' has no vehicle"),
        (("a,V1,T1,", "a,V1,T1,", "x,V9,T1,1", "x,V9,T1,2"), "'x' is listed twice, with different values"),
        (("y,V1,T1,", "z,V1,T1,"), "none of the files of its 2 recordings exists"),
    ):
        with pytest.raises(DataError, match=said):
            fleet_of(table(depot, *rows, head="recording,vehicle,type,strokes"), cal)
    path = table(depot, "a,V1,T1")
    with pytest.raises(ParameterError, match="there is no calibration of type 'T1'"):
        fleet_of(path, calibrations(depot, "T7"))
    with pytest.raises(ParameterError, match="no such file or folder"):
        fleet_of(path, tmp_path / "nothing.toml")
    (tmp_path / "none").mkdir()
    with pytest.raises(ParameterError, match="has no calibrations"):
        fleet_of(path, tmp_path / "none")


def test_vehicles_of_one_name_are_apart_by_their_folder_and_stop_no_others(depot):
    root = depot / "fleet"
    for path in ("north/V1/a.csv", "a/south/V1/a.csv", "fleet/x.csv", "x.csv", "V2/a.csv", "V2/a.csv.csv"):
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).touch()
    cals = calibrations(depot, "V1", "V2")
    (cals / "north").mkdir()
    (cals / "north" / "V1.toml").touch()
    fleet = fleet_of(root, cals)
    jobs = {(job.vehicle, job.recording): job for job in fleet.jobs}
    assert len(jobs) == len(fleet.jobs) == 10
    assert jobs.keys() >= {("V1", "a"), ("north/V1", "a"), ("a/south/V1", "a"), ("fleet", "x"), ("fleet/.", "x")}
    assert {name for vehicle, name in jobs if vehicle == "V2"} == {"a.csv", "a.csv.csv", "a.parquet", "b"}
    assert [jobs[name, "a"].start for name in ("V1", "north/V1")] == [cals / "V1.toml", cals / "north" / "V1.toml"]
    assert "no calibration of vehicle 'a/south/V1'" in jobs["a/south/V1", "a"].problem
    assert "have one name, and are named by their folder or type: V1, a/south/V1, fleet and 2 more" in fleet.renamed
    assert fleet_of(depot / "fleet" / "V2", depot / "cal.toml").renamed == ""


def test_a_vehicle_of_two_types_in_a_table_is_two(depot):
    fleet = fleet_of(table(depot, "a,V1,T1", "a,V1,T2", "b,V1,", "a,V2,T1"), calibrations(depot, "T1", "V1"))
    assert keys(fleet) == [("T1/V1", "a"), ("T2/V1", "a"), ("V2", "a"), ("no type/V1", "b")]
    assert [bool(job.start) for job in fleet.jobs] == [True, False, True, False], "V1.toml may be that of either"
    assert "T1/V1, T2/V1, no type/V1; give each a name" in fleet.renamed


@pytest.mark.parametrize("strokes", ["", "nan", "700"])
def test_a_row_that_stands_twice_with_the_same_values_counts_once(depot, strokes):
    path = table(depot, *[f"a,V1,T1,{strokes}"] * 2, head="recording,vehicle,type,strokes")
    assert keys(fleet_of(path, depot / "cal.toml")) == [("V1", "a")]


def test_results_of_a_run_are_no_recordings_and_a_link_to_a_file_that_is_gone_is_one(depot):
    results = depot / "fleet" / "result"
    (results / "curves").mkdir(parents=True)
    for name in ("run.sqlite", "results.parquet", "curves/part-00000.parquet"):
        (results / name).touch()
    (depot / "fleet" / "V2" / "c.parquet").symlink_to(depot / "share" / "c.parquet")
    names = keys(fleet_of(depot / "fleet", depot / "cal.toml"))
    assert names == [("V1", "a"), ("V1", "b"), ("V2", "a"), ("V2", "b"), ("V2", "c")]


def test_hidden_files_and_folders_are_no_recordings(depot):
    """As a write that was cut off leaves them, the system of a share, or another program."""
    hidden = depot / "fleet" / "V1" / ".trash"
    hidden.mkdir()
    for path in (hidden / "a.parquet", hidden.parent / ".clutchid-0123456789ab.parquet", hidden.parent / "._a.parquet"):
        path.touch()
    assert keys(fleet_of(depot / "fleet", depot / "cal.toml")) == [("V1", "a"), ("V1", "b"), ("V2", "a"), ("V2", "b")]
    assert keys(fleet_of(table(depot, "a,V1,"), depot / "cal.toml")) == [("V1", "a")]
    assert [job.path.name for job in recordings_of([depot / "fleet" / "V1"])[0]] == ["a.parquet", "b.mf4"]


def test_names_that_are_no_text_are_shown_by_their_bytes(depot):
    folder = depot / "fleet" / os.fsdecode(b"V\xfc3")
    folder.mkdir()
    for name in (b"\xff\xfe.parquet", b"\xff\xff.parquet"):
        (folder / os.fsdecode(name)).touch()
    fleet = fleet_of(depot / "fleet", depot / "cal.toml")
    assert keys(fleet)[-2:] == [(r"V\xfc3", r"\xff\xfe"), (r"V\xfc3", r"\xff\xff")]
    (depot / "cals").mkdir()
    (depot / "cals" / "V1.toml").touch()
    problems = [job.problem for job in fleet_of(depot / "fleet", depot / "cals").jobs]
    assert any(problem.startswith(r"there is no calibration of vehicle 'V\xfc3'") for problem in problems)


@pytest.mark.parametrize(("seconds", "is_first"), [(0.0, False), (10.0, True), (3600.0, False)])
def test_compilation_does_not_count_in_a_short_time_limit(depot, monkeypatch, seconds, is_first):
    order = []
    monkeypatch.setattr(verbs, "content_of", lambda _: None)
    plan = ReadingPlan([SimpleNamespace(start=depot / "cal.toml")], [], frozenset())
    monkeypatch.setattr(verbs, "planned", lambda *_, **__: plan)
    monkeypatch.setattr(verbs, "compile_first", lambda _, starts: order.append(starts), raising=False)
    monkeypatch.setattr(verbs, "read_all", lambda *_: order.append("read"))
    verbs.fleet(depot / "fleet", depot / "cal.toml", depot / "out", place=Workers(seconds=seconds))
    assert order == [{depot / "cal.toml"}] * is_first + ["read"]
