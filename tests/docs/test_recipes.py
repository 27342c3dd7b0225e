"""The recipes for fleets on other systems run as their pages show them."""

import importlib.util
import pickle
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.log import Log
from clutchid.verbs import wear_reading
from fixtures.lives import reading
from fixtures.results import STEADY, write_fleet

RECIPES = Path(__file__).resolve().parents[2] / "docs" / "recipes"

pytestmark = pytest.mark.slow


def recipe(name):
    spec = importlib.util.spec_from_file_location(f"recipe_{name}", RECIPES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def recording(tmp_path, monkeypatch):
    """A recording of a vehicle, whose reading is known, and a calibration."""
    monkeypatch.setattr(wear_reading, "_fitted", lambda *_: reading(1e-4))
    time = np.arange(0.0, 0.5, 0.001)
    columns = {"position": 1e-4 * time, "duty_supply": np.zeros(500), "duty_exhaust": np.ones(500)}
    (tmp_path / "V1").mkdir()
    clutchid.write(Log(time, columns, metadata={"start": "2026-01-02"}), tmp_path / "V1" / "run.parquet")
    (tmp_path / "cal.toml").write_text("[parameters]\n")
    return tmp_path / "V1" / "run.parquet"


def test_a_run_is_appended_to_delta_once_also_after_a_kill_and_after_parts_were_folded(tmp_path):
    pytest.importorskip("deltalake", reason="deltalake is not installed")
    delta, run, table = recipe("append_to_delta"), write_fleet(tmp_path / "run"), str(tmp_path / "lake")
    parts = sorted(run.rglob("part-*.parquet"))
    late = [(part, part.read_bytes()) for part in parts[:7]]
    for part, _ in late:
        part.unlink()
    first = delta.append(run, table)
    for part, content in late:
        part.write_bytes(content)
    assert first + delta.append(run, table) == 42
    assert delta.append(run, table) == 0
    folded = pl.read_parquet(parts[0])
    folded.write_parquet(parts[0].with_name("part-00ff.parquet"))
    parts[0].unlink()
    assert delta.append(run, table) == 0
    rows = pl.scan_delta(table).filter(vehicle=STEADY).collect()
    assert rows["recording"].n_unique() == rows.height == 20


def test_spark_gets_rows_for_the_bytes_of_files(recording, tmp_path, monkeypatch):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    spark = recipe("spark")
    monkeypatch.setattr(spark, "CALIBRATION", str(tmp_path / "cal.toml"))
    content = {"s3://bucket/fleet/V1/run.parquet": recording.read_bytes(), "s3://bucket/fleet/V2/x.csv": b"no table"}
    batch = pandas.DataFrame({"path": list(content), "content": list(content.values())})
    (rows,) = spark.rows(iter([batch]))
    assert rows["vehicle"].to_list() == ["V1", "V2"]
    assert rows["status"].to_list() == ["ok", "bad_input"]
    assert rows["shift_mm"][0] == pytest.approx(0.1)
    assert pickle.loads(pickle.dumps(clutchid.recording_row)) is clutchid.recording_row


def test_spark_itself_maps_the_same_rows(recording, tmp_path, monkeypatch):
    sql = pytest.importorskip("pyspark.sql", reason="PySpark is not installed")
    spark = recipe("spark")
    monkeypatch.setattr(spark, "CALIBRATION", str(tmp_path / "cal.toml"))
    session = sql.SparkSession.builder.master("local[1]").getOrCreate()
    files = session.read.format("binaryFile").load(str(recording))
    rows = files.select("path", "content").mapInPandas(spark.rows, spark.SCHEMA).collect()
    assert [row["vehicle"] for row in rows] == ["V1"]


def test_an_event_is_a_row_and_coming_again_it_is_the_same(recording, tmp_path, monkeypatch):
    events = recipe("events")
    monkeypatch.setattr(events, "CALIBRATIONS", str(tmp_path / "cal.toml"))
    monkeypatch.setattr(events, "WEAR", str(tmp_path / "wear"))
    assert [events.read_event(str(recording)) for _ in range(2)] == ["V1, run: ok"] * 2
    assert pl.read_parquet(tmp_path / "wear" / "recordings" / "date=2026-01-02" / "*.parquet").height == 1


def test_a_container_of_impulse_is_a_recording(tmp_path):
    edges = np.array([0, 500, 700, 1000]) * 1_000_000 + 5
    names = {1: "ClutchPos", 2: "DutySupply", 3: "DutyExhaust"}
    channels = [
        {"container_id": 9, "channel_id": channel, "tstart": int(begin), "tend": int(end), "value": 10.0 * channel * k}
        for channel in names for k, (begin, end) in enumerate(pairwise(edges))
    ]  # fmt: skip
    tags = [{"container_id": 9, "channel_id": c, "key": "channel_name", "value": name} for c, name in names.items()]
    pl.DataFrame(channels).write_parquet(tmp_path / "channels.parquet")
    pl.DataFrame(tags).write_parquet(tmp_path / "channel_tags.parquet")
    metrics = pl.DataFrame({"container_id": [9], "start_ts": [datetime(2026, 1, 2)]})
    metrics.write_parquet(tmp_path / "container_metrics.parquet")
    log = recipe("impulse").recording(tmp_path, 9)
    assert log.time.size == 1000
    assert log["position"][[0, 499, 500, 999]] == pytest.approx([0.0, 0.0, 0.01, 0.02])
    assert log["duty_exhaust"][[499, 500, 700]] == pytest.approx([0.0, 0.3, 0.6])
    assert log.metadata["start"] == "2026-01-02T00:00:00"


@pytest.mark.parametrize("framework", ["jax", "casadi"])
def test_the_equations_in_another_framework_make_the_steps_of_the_simulation(framework):
    module = pytest.importorskip(framework, reason=f"{framework} is not installed")
    if framework == "jax":
        module.config.update("jax_enable_x64", True)
    other = recipe("other_frameworks")
    actuator, log = clutchid.Actuator(), clutchid.bundled_recording().slice(0, 700)
    rate = getattr(other, f"rate_in_{framework}")(actuator)
    parameters = np.array([actuator.value(name) for name in other.PARAMETERS])
    run = clutchid.simulate(actuator, log).log
    states = np.column_stack([run[row.column] for row in actuator.state_rows.values()])

    def f(x, u):
        return np.asarray(rate(x, u, parameters)).ravel()

    scale = np.abs(states).max(axis=0)
    for k in range(450, 650, 20):  # in a stroke
        x, u, h = states[k], np.array([log["duty_supply"][k], log["duty_exhaust"][k]]), log.time[k + 1] - log.time[k]
        first = f(x, u)
        second = f(x + h / 2 * first, u)
        third = f(x + h / 2 * second, u)
        step = h / 6 * (first + 2 * second + 2 * third + f(x + h * third, u))
        assert (x + step) / scale == pytest.approx(states[k + 1] / scale, abs=1e-9)
