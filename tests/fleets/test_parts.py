"""The table of recordings of a fleet: its columns, what is appended, what is folded, and the index made from it."""

import os
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import polars as pl
import pytest

from clutchid.errors import DataError
from clutchid.fleets.output import results_table
from clutchid.fleets.parts import adopt, append
from clutchid.fleets.plan import recording_states
from clutchid.fleets.storage import Folder
from clutchid.fleets.store import run_store, stored_row
from clutchid.processes import Timing
from clutchid.wear.history import Leak, RecordingJob
from clutchid.wear.tables import read_fleet_table
from fixtures.lives import reading
from fixtures.results import half_load, load, write_fleet, write_states

#: The columns of every table, as they are written; additions are made here, and renaming is an error.
GOLDEN = Path(__file__).with_name("schema.txt")

INPUTS = '["c0ffee", {"clutchid": "0.1.0", "source": "abc"}, "fit", "None", []]'


def row(name="r1", vehicle="V1", day=1, shift=1e-4, **place):
    """A row of the index of a recording that was read."""
    job = RecordingJob(
        name, vehicle, "T1", datetime(2026, 1, day, 8, 30, tzinfo=UTC), 1.5, inputs=INPUTS, file="12 34",
        start=Path("T1.toml"), **place,
    )  # fmt: skip
    read = reading(shift, 0.1 / 3, curve=load(shift), half_load=half_load(shift), leak=Leak(1e-11, 1e-12, 0.9))
    read = read._replace(sha256=f"{vehicle}{name}{shift}", message="“its” sentence")
    return stored_row(job, read, Timing(1.5, 1.25, "host", 7, 1), "2026-11-30T12:00:00.000001+00:00")


def parts_of(folder):
    return sorted(path.relative_to(folder).as_posix() for path in (folder / "recordings").rglob("*.parquet"))


def table_of(folder):
    """The table as anyone reads it."""
    return pl.read_parquet(folder / "recordings" / "**" / "*.parquet", hive_partitioning=True)


def test_the_columns_of_every_table_are_those_that_were_promised(tmp_path):
    write_fleet(tmp_path)
    lines = []
    own = next(path for path in (tmp_path / "vehicles").glob("V_2*.parquet") if ".load." not in path.name)
    tables = {
        "recordings": tmp_path / parts_of(tmp_path)[0], "results": tmp_path / "results.parquet",
        "vehicles": tmp_path / "vehicles.parquet", "alarms": tmp_path / "alarms.parquet", "vehicle": own,
        "load": own.with_suffix(".load.parquet"), "types": tmp_path / "types.parquet",
        "replacements": tmp_path / "replacements.parquet",
    }  # fmt: skip
    for name, path in tables.items():
        lines += [f"{name}: {column} {kind}" for column, kind in pl.read_parquet_schema(path).items()]
        assert pl.read_parquet_metadata(path)["schema_version"] == "1", name
    text = "\n".join(lines) + "\n"
    if os.environ.get("CLUTCHID_WRITE_GOLDEN"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")
    assert all(re.fullmatch(r"\w+: \w+ .*", line) for line in lines), "names that every lake takes"


def filled(folder, *batches):
    """The parts of runs with these rows, and the states of the recordings after the last."""
    storage = Folder(folder)
    with run_store(folder, {}) as store:
        for batch in batches:
            adopt(store, storage)
            store.put(batch)
            append(store, storage)
        keys = store.keys()
        return results_table(recording_states([entry.job for entry in keys.values()], keys), store, storage)


def test_a_lost_index_is_made_again_from_the_parts_to_the_last_bit(tmp_path):
    rows = [row(f"r{k}", f"V{k % 2}", 1 + k % 3, 1e-4 / (k + 1), tags=(("depot", "Köln"),)) for k in range(7)]
    before = filled(tmp_path, rows)
    (tmp_path / "run.sqlite").unlink()
    assert filled(tmp_path, []).equals(before)
    with run_store(tmp_path, {}) as store:
        again = {entry.recording: entry for vehicle in ("V0", "V1") for entry in store.of_vehicle(vehicle).values()}
    assert {name: entry._replace(part="") for name, entry in again.items()} == {
        entry.recording: entry for entry in rows
    }


def test_a_run_appends_a_part_a_date_and_nothing_where_nothing_is_new(tmp_path):
    filled(tmp_path, [row("r1", day=1), row("r2", day=1), row("r3", day=2), replaced(row("r4"), date="")])
    parts = parts_of(tmp_path)
    assert [re.sub("part-.*", "", part) for part in parts] == [
        "recordings/date=2026-01-01/", "recordings/date=2026-01-02/", "recordings/date=__HIVE_DEFAULT_PARTITION__/",
    ]  # fmt: skip
    made = [(tmp_path / part).stat().st_mtime_ns for part in parts]
    filled(tmp_path, [], [row("r1", day=1)][:0])
    assert [(tmp_path / part).stat().st_mtime_ns for part in parts_of(tmp_path)] == made
    dates = table_of(tmp_path).sort("recording")["date"].to_list()
    assert [str(date)[:10] for date in dates] == ["2026-01-01", "2026-01-01", "2026-01-02", "None"]


def replaced(entry, **values):
    return entry._replace(**values).with_checksum()


def test_what_changes_is_another_row_and_the_newest_is_the_result(tmp_path):
    first = [row("r1"), row("r2", day=2)]
    changed = replaced(row("r1", shift=2e-4), read_at="2026-12-01T12:00:00.000000+00:00")
    results = filled(tmp_path, first, [changed])
    assert results["shift_mm"].to_list() == pytest.approx([0.2, 0.1])
    assert sorted(table_of(tmp_path)["shift_mm"]) == pytest.approx([0.1, 0.1, 0.2])
    (tmp_path / "run.sqlite").unlink()
    assert filled(tmp_path, []).equals(results), "the newest row counts without the index too"
    with run_store(tmp_path, {}) as store:
        assert store.keys()["V1", "r1"].read_at == changed.read_at


def test_small_parts_of_a_date_are_folded_and_a_kill_in_between_leaves_nothing_twice(tmp_path):
    (tmp_path / "killed").mkdir()
    filled(tmp_path / "killed", [row("r1")])
    filled(tmp_path / "one", [row("r1")])
    shutil.copytree(tmp_path / "one" / "recordings", tmp_path / "killed" / "recordings", dirs_exist_ok=True)
    results = filled(tmp_path / "killed", [row("r2", vehicle="V2")], [row("r3")])
    assert len(parts_of(tmp_path / "killed")) == 1
    assert sorted(table_of(tmp_path / "killed")["recording"]) == ["r1", "r2", "r3"]
    assert results["recording"].to_list() == ["r1", "r3", "r2"]


def test_parts_of_another_process_are_taken_in_and_a_part_that_is_lost_is_written_again(tmp_path):
    filled(tmp_path / "here", [row("r1"), row("r2", day=2)])
    newer = replaced(row("r2", day=2, shift=3e-4), read_at="2026-12-01T12:00:00.000000+00:00")
    filled(tmp_path / "there", [newer, row("r3", vehicle="V9", day=3)])
    shutil.copytree(tmp_path / "there" / "recordings", tmp_path / "here" / "recordings", dirs_exist_ok=True)
    results = filled(tmp_path / "here", [])
    assert results["shift_mm"].to_list() == pytest.approx([0.1, 0.3, 0.1])
    shutil.rmtree(tmp_path / "here" / "recordings" / "date=2026-01-01")
    assert filled(tmp_path / "here", []).drop("written_at").equals(results.drop("written_at"))
    assert len(parts_of(tmp_path / "here")) == 3


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:-900]), "cannot be read as a part of the table"),
        (lambda path: path.write_text("vehicle,recording"), "cannot be read as a part of the table"),
        (
            lambda path: pl.DataFrame({"vehicle": [1]}).write_parquet(path),
            "is no part of this table .vehicle, recording",
        ),
        (
            lambda path: pl.read_parquet(path).with_columns(written_at=pl.lit("today")).write_parquet(path),
            "is no part of this table .written_at is missing or of another type",
        ),
    ],
)
def test_a_part_that_is_damaged_or_foreign_is_one_sentence(tmp_path, spoil, said):
    filled(tmp_path, [row("r1"), row("r2", day=2)])
    (tmp_path / "run.sqlite").unlink()
    spoil(tmp_path / parts_of(tmp_path)[0])
    with pytest.raises(DataError, match=f"recordings/date=2026-01-01/part-.*{said}.*; move it away, so that"):
        filled(tmp_path, [])


def test_further_columns_of_a_table_are_tags_of_its_rows(tmp_path):
    (tmp_path / "recordings.csv").write_text("recording,vehicle,Depot (city),contract no\nr1,V1,Ulm,7\nr2,V1,,8\n")
    tags = {job.recording: job.tags for job in read_fleet_table(tmp_path / "recordings.csv").values()}
    assert tags == {"r1": (("depot_city", "Ulm"), ("contract_no", "7")), "r2": (("contract_no", "8"),)}
    results = filled(tmp_path / "out", [row("r1", tags=tags["r1"]), row("r2", day=2, tags=tags["r2"]), row("r3")])
    assert results.select("tag_depot_city", "tag_contract_no").rows() == [("Ulm", "7"), (None, "8"), (None, None)]
    assert results.columns[:3] == ["vehicle", "type", "recording"]


def test_the_last_tags_of_a_vehicle_are_in_its_row_also_where_nothing_is_new(tmp_path):
    depots = {2: ("depot", "Bonn"), 1: ("depot", "Ulm"), 3: ("contract", "7"), 4: ("depot", "unread")}
    rows = [
        (RecordingJob(f"r{day}", "V1", begin=datetime(2026, 1, day, tzinfo=UTC), tags=(tag,)), reading(1e-4 * day))
        for day, tag in depots.items()
    ]
    rows[3] = rows[3][0], rows[3][1]._replace(status="failed")
    for _ in range(2):
        write_states(tmp_path, [*rows, (RecordingJob("r", "V2"), reading(0.0))])
        table = pl.read_parquet(tmp_path / "vehicles.parquet").select("vehicle", "tag_contract", "tag_depot")
        assert table.rows() == [("V1", "7", "Bonn"), ("V2", None, None)]


def test_duckdb_reads_every_table_as_it_was_written(tmp_path):
    duckdb = pytest.importorskip("duckdb", reason="DuckDB is not installed")
    write_fleet(tmp_path)
    parts = f"read_parquet('{tmp_path}/recordings/**/*.parquet', hive_partitioning=true)"
    newest = f"SELECT *, row_number() OVER (PARTITION BY vehicle, recording ORDER BY written_at DESC) AS n FROM {parts}"
    ((count, peak),) = duckdb.sql(f"SELECT count(*), max(peak_N) FROM ({newest}) WHERE n = 1").fetchall()
    assert (count, peak) == (42, table_of(tmp_path)["peak_N"].max())
    for name in ("results", "vehicles", "types", "replacements"):
        rows = duckdb.sql(f"SELECT * FROM '{tmp_path / name}.parquet'")
        assert rows.columns == pl.read_parquet(tmp_path / f"{name}.parquet").columns


def test_delta_takes_every_table_as_it_was_written(tmp_path):
    deltalake = pytest.importorskip("deltalake", reason="deltalake is not installed")
    write_fleet(tmp_path)
    for name, table in (
        ("recordings", table_of(tmp_path)),
        *(
            (name, pl.read_parquet(tmp_path / f"{name}.parquet"))
            for name in ("results", "vehicles", "types", "replacements")
        ),
    ):
        deltalake.write_deltalake(str(tmp_path / "lake" / name), table.to_arrow(), mode="append")
        stored = pl.from_arrow(deltalake.DeltaTable(str(tmp_path / "lake" / name)).to_pyarrow_table())
        assert stored.columns == table.columns
        assert stored.height == table.height
