"""The gate of a `Log`: its arrays are its own, and hold real numbers in SI."""

import pickle
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from clutchid.errors import DataError
from clutchid.log import Log

TIME = 1e-3 * np.arange(4)
VALUES = np.array([0.0, 1e-4, 2e-4, 3e-4])


def made(values, time=TIME, name="position") -> Log:
    return Log(time, {name: values}, "run")


@pytest.mark.parametrize("part", [lambda a: a, lambda a: a[:], lambda a: a.reshape(2, 2).ravel(), lambda a: a[::1]])
def test_a_buffer_that_is_used_again_changes_no_log(part):
    buffer = np.zeros(4)
    log = made(part(buffer))
    buffer[:] = 7.0
    assert log["position"].tolist() == [0.0] * 4
    assert buffer.flags.writeable


def test_a_read_only_view_of_what_can_be_written_to_is_copied():
    for buffer in (np.zeros(4), bytearray(32)):
        view = np.frombuffer(buffer)
        view.flags.writeable = False
        log = made(view)
        buffer[0] = 1
        assert log["position"][0] == 0.0


def test_what_nobody_can_write_to_is_taken_as_it_is():
    values = VALUES.copy()
    values.flags.writeable = False
    log = made(values)
    assert log["position"] is values
    assert np.shares_memory(made(log.slice(1, 4)["position"], TIME[1:])["position"], values)
    assert not pickle.loads(pickle.dumps(log))["position"].flags.writeable


def test_what_a_mask_hides_is_missing():
    masked = np.ma.masked_array(VALUES, mask=[0, 1, 0, 0])
    edges = {"duty_supply": (TIME, masked)}
    for log in (made(masked, name="duty_supply"), made(VALUES).with_columns(duty_supply=masked)):
        assert np.isnan(log["duty_supply"]).tolist() == [False, True, False, False]
    assert np.isnan(Log(TIME, {"duty_supply": VALUES}, edges=edges).edges["duty_supply"][1][1])
    assert np.isnan(made(np.ma.masked_array([1, 2, 3, 4], mask=[0, 1, 0, 0]))["position"][1])
    with pytest.raises(DataError, match="strictly increasing values"):
        made(VALUES, np.ma.masked_array(TIME, mask=[0, 1, 0, 0]))


@pytest.mark.parametrize(("unit", "second"), [("ns", 1_000_000_000), ("us", 1_000_000), ("ms", 1000), ("s", 1)])
def test_dates_and_durations_are_seconds_whatever_their_unit(unit, second):
    steps = np.array([0, 1, 2, 3]) * second
    dates = np.datetime64("2026-05-01T12:00:00").astype(f"M8[{unit}]") + steps.astype(f"m8[{unit}]")
    for time in (dates, pl.Series(dates) if unit != "s" else dates, list(dates)):
        log = made(VALUES, time)
        assert log.time.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert log.metadata["start"].startswith("2026-05-01T12:00:00")
    assert made(VALUES, (steps + second).astype(f"m8[{unit}]")).time.tolist() == [1.0, 2.0, 3.0, 4.0]
    edges = {"duty_supply": (dates + np.timedelta64(1, "s"), VALUES)}
    assert Log(dates, {"duty_supply": VALUES}, edges=edges).edges["duty_supply"][0].tolist() == [1.0, 2.0, 3.0, 4.0]
    with pytest.raises(
        DataError, match="time of the edges of 'duty_supply' and of the columns: both must be dates, or neither"
    ):
        Log(TIME, {"duty_supply": VALUES}, edges=edges)


def test_a_date_that_is_missing_is_refused():
    with pytest.raises(DataError, match="strictly increasing values"):
        made(VALUES[:3], np.array(["2026-05-01", "NaT", "2026-05-03"], dtype="M8[s]"))


def quantity(unit: str) -> SimpleNamespace:
    """What pint and astropy have in common."""
    return SimpleNamespace(units=unit, magnitude=VALUES, to=lambda unit: VALUES)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (quantity("mm"), "is a quantity in mm: take q.m_as('m') of pint, or q.to_value('m') of astropy"),
        ([quantity("mm")] * 4, "is a quantity in mm"),
        (VALUES + 0j, "holds complex numbers: real numbers in m are needed, NaN where a sample is missing"),
        (["0", "1", "2", "3"], "holds text"),
        ([b"0", b"1", b"2", b"3"], "holds text"),
        ([0.0, None, 1.0, 2.0], "holds objects: real numbers in m are needed"),
        (None, "holds objects: real numbers in m are needed"),
        (iter(VALUES), "holds objects"),
        (VALUES > 0.0, "holds truth values"),
        ((1e9 * TIME).astype("m8[ns]"), "holds durations"),
        ([[0.0], [1.0, 2.0], 3.0, 4.0], "is not an array (setting an array element with a sequence"),
        (VALUES[:, np.newaxis], "has (4, 1) samples, time has 4"),
    ],
)
def test_what_is_no_column_of_real_numbers_is_refused_in_one_sentence(values, words):
    with pytest.raises(DataError) as caught:
        made(values)
    assert str(caught.value).startswith(f"run: column 'position' {words}")
    assert len(str(caught.value).splitlines()) == 1


def test_all_columns_and_edges_that_are_refused_are_named():
    with pytest.raises(DataError) as caught:
        Log(quantity("ms"), {"duty_supply": VALUES + 0j}, edges={"duty_supply": (quantity("ms"), ["a"] * 4)})
    assert "log: 4 problems" in str(caught.value)
    for place in ("time is", "column 'duty_supply'", "time of the edges of 'duty_supply'", "duty cycle of the edges"):
        assert place in str(caught.value)


def test_numbers_of_any_kind_are_taken():
    for values in ([0, 1, 2, 3], range(4), np.arange(4, dtype="f4")):
        assert made(values)["position"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.isnan(made(pl.Series([0, None, 2, 3]))["position"][1])
    for name in ("duty_supply", "gear [1]"):
        assert made(VALUES > 1e-4, name=name)[name].tolist() == [0.0, 0.0, 1.0, 1.0]


def test_series_of_pandas_are_taken():
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    dates = pandas.date_range("2026", periods=4, freq="1ms")
    log = made(pandas.Series([0, 1, 2, None], dtype="Float64"), dates)
    assert log.time.tolist() == pytest.approx(TIME.tolist(), abs=1e-12)
    assert np.isnan(log["position"]).tolist() == [False, False, False, True]


def test_a_data_frame_in_place_of_columns_is_refused_with_the_way_out():
    with pytest.raises(
        DataError, match=r"columns are a mapping, not a DataFrame; see clutchid\.Log\.from_frame\(frame\)"
    ):
        Log(TIME, pl.DataFrame({"position": VALUES}))
