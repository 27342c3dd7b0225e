"""`Log.from_frame`: a data frame is read as a file with the same columns."""

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import DataError, ParameterError

COLUMNS = {
    "time [ms]": [0.0, 1.0, 2.0, 3.0],
    "position [mm]": [0.0, 0.5, None, 1.5],
    "duty_supply [%]": [0.0, 100.0, 100.0, 0.0],
    "duty_exhaust [1]": [0.0, 0.0, 0.0, 1.0],
    "pressure_a [bar(g)]": [0.0, 1.0, 2.0, 3.0],
}
KINDS = {
    "polars": pl.DataFrame,
    "arrow": lambda columns: pytest.importorskip("pyarrow").table(columns),
    "pandas": lambda columns: pytest.importorskip("pandas", reason="pandas is not installed").DataFrame(columns),
    "mapping": lambda columns: columns,
}

from_frame = clutchid.Log.from_frame


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_is_read_as_a_file_with_its_columns(kind, tmp_path):
    pl.DataFrame(COLUMNS).write_parquet(tmp_path / "run.parquet")
    for ambient in (None, 0.9e5):
        log = from_frame(KINDS[kind](COLUMNS), "run", ambient=ambient)
        file = clutchid.read(tmp_path / "run.parquet", ambient=ambient)
        assert log.name == file.name == "run"
        assert log.warnings == file.warnings
        assert {**log.metadata, "source": "run.parquet", "sha256": file.metadata["sha256"]} == dict(file.metadata)
        for name in ("time", *file.columns):
            values, read = (log.time, file.time) if name == "time" else (log[name], file[name])
            assert np.array_equal(values, read, equal_nan=True), name


def test_dates_durations_and_a_named_index_are_the_time():
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    frame = pandas.DataFrame(COLUMNS)
    assert from_frame(frame.set_index("time [ms]")).time.tolist() == [0.0, 1e-3, 2e-3, 3e-3]
    dates = pandas.date_range("2026-05-01", periods=4, freq="1ms", tz="UTC", name="time")
    log = from_frame(frame.drop(columns="time [ms]").set_index(dates))
    assert log.time.tolist() == [0.0, 1e-3, 2e-3, 3e-3]
    assert log.metadata["start"].startswith("2026-05-01 00:00:00")
    durations = pandas.to_timedelta([0, 2, 4, 6], unit="ms")
    assert from_frame(frame.drop(columns="time [ms]").set_index(durations)).time.tolist() == [0.0, 2e-3, 4e-3, 6e-3]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time [ms]": None}, "no column 'time' (write time [s]"),
        (
            {"position [mm]": None, "positon [mm]": [0.0] * 4},
            "no column 'position' (write position [m]; is it 'positon [mm]'?); its columns are 'time [ms]'",
        ),
        ({"duty_supply [%]": None, "duty_supply [1]": [0, 50, 100, 0]}, "looks like percent: write duty_supply [%]"),
        ({"position [mm]": ["a", "b", "c", "d"]}, "column 'position [mm]' holds text; write numbers"),
        ({"position [mm]": None, "position": [1.0, 2.0, 3.0, 4.0]}, "has no unit in brackets; write position [m]"),
        ({"time [ms]": [0, 1]}, "a table of pandas, polars or Arrow is needed, a lazy one collected ("),
    ],
)
def test_what_a_file_is_refused_for_a_frame_is_refused_for(change, words):
    columns = {name: values for name, values in {**COLUMNS, **change}.items() if values is not None}
    with pytest.raises(DataError) as caught:
        from_frame(columns, "run 7")
    assert str(caught.value).startswith("run 7: ")
    assert words in str(caught.value)


@pytest.mark.parametrize("frame", [pl.LazyFrame(COLUMNS), 3, "run.csv", None, np.zeros((4, 3))])
def test_what_is_no_table_is_refused(frame):
    with pytest.raises(DataError, match="frame: "):
        from_frame(frame)


def test_a_frame_of_duty_cycles_can_be_simulated_and_a_wrong_ambient_pressure_is_refused():
    duties = {name: COLUMNS[name] for name in ("time [ms]", "duty_supply [%]", "duty_exhaust [1]")}
    log = from_frame(duties, required=("time", "duty_supply", "duty_exhaust"))
    assert log["duty_supply"].tolist() == [0, 1, 1, 0]
    assert clutchid.simulate(clutchid.Actuator(), log).status == "ok"
    with pytest.raises(ParameterError, match="ambient = -1 Pa"):
        from_frame(COLUMNS, ambient=-1.0)


@pytest.mark.parametrize("verb", ["fit", "calibrate", "estimate", "observe", "simulate", "simulate_many", "cut"])
@pytest.mark.parametrize("several", [False, True])
def test_a_verb_refuses_a_frame_with_the_way_out(verb, several):
    frame = pl.DataFrame(COLUMNS)
    logs = [frame] if several else frame
    first = (clutchid.Actuator(), logs) if verb.startswith("simulate") else (logs,)
    others = ("calibration.toml",) if verb in ("estimate", "observe") else ()
    with pytest.raises(DataError, match=r"a recording is a clutchid\.Log or the path of a file, not a ") as caught:
        getattr(clutchid, verb)(*first, *others)
    if not several or verb in ("fit", "calibrate", "estimate", "simulate_many"):
        assert str(caught.value).endswith("not a DataFrame; clutchid.Log.from_frame(frame) makes one of a data frame.")


def test_duty_cycles_may_be_rounded_to_just_outside_their_range():
    rounded = [0.0, 1.0 + 1e-7, 1.0 + 9e-4, -9e-4]
    columns = {name: values for name, values in COLUMNS.items() if name != "duty_supply [%]"}
    log = from_frame({**columns, "duty_supply [1]": rounded})
    assert log["duty_supply"].tolist() == rounded
    assert clutchid.simulate(clutchid.Actuator(), log).status == "ok"
    with pytest.raises(DataError, match=r"'duty_supply .1.' is not a duty cycle: row 4 has -0.002; allowed is 0 to 1"):
        from_frame({**columns, "duty_supply [1]": [*rounded[:3], -2e-3]})
