"""`Log`: valid from birth, read-only, and every problem named at once."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log import COLUMNS, Log


def log(n: int = 5, **columns) -> Log:
    return Log(np.arange(n) * 1e-3, {"position": np.arange(n) * 1e-4, **columns}, "run")


def test_a_column_is_read_by_name_and_an_absent_one_is_refused_with_those_there_are():
    assert log()["position"][2] == pytest.approx(2e-4)
    with pytest.raises(DataError, match="run: no column 'pressure_a'; it has position"):
        log()["pressure_a"]
    with pytest.raises(DataError, match="it has none"):
        Log(np.arange(2.0), {})["position"]


def test_a_log_knows_what_it_has_and_how_long_it_is():
    assert "position" in log()
    assert "pressure_a" not in log()
    assert len(log(7)) == 7


def test_arrays_are_read_only_and_the_original_stays_writable():
    values = np.zeros(5)
    made = log(duty_supply=values)
    with pytest.raises(ValueError, match="read-only"):
        made["duty_supply"][0] = 1.0
    with pytest.raises(TypeError):
        made.columns["position"] = values
    values[0] = 1.0
    assert values.flags.writeable


def test_missing_samples_are_nan_and_stay():
    assert np.isnan(log(pressure_a=np.full(5, np.nan))["pressure_a"]).all()


@pytest.mark.parametrize(
    "time", [[0, 1, 1, 2], [0, 2, 1, 3], [0, 1, np.nan, 3], [0, 1, 2, np.inf]], ids=["repeated", "back", "nan", "inf"]
)
def test_time_must_be_finite_and_strictly_increasing(time):
    with pytest.raises(DataError, match="strictly increasing"):
        Log(np.array(time, dtype=float), {})


def test_all_problems_are_named_at_once():
    with pytest.raises(DataError) as caught:
        Log(np.array([0.0, 0.0]), {"posiiton": np.zeros(2), "position": np.zeros(3)}, "run")
    text = str(caught.value)
    assert "run: 3 problems" in text
    assert "'posiiton' is not known" in text
    assert "'position' has 3 samples, time has 2" in text
    assert "strictly increasing" in text


def test_a_slice_keeps_name_and_columns_and_shares_memory():
    whole = log(10)
    part = whole.slice(2, 5)
    assert part.time.tolist() == whole.time[2:5].tolist()
    assert part.name == "run"
    assert np.shares_memory(part["position"], whole["position"])


def test_columns_are_added_and_replaced_in_a_copy():
    whole = log()
    more = whole.with_columns(position=np.ones(5), duty_supply=np.zeros(5))
    assert more["position"].tolist() == [1] * 5
    assert "duty_supply" not in whole


def test_integers_become_floats():
    assert Log(np.arange(3), {"duty_supply": np.array([0, 1, 0])})["duty_supply"].dtype == np.float64


def test_columns_and_units_are_those_of_the_contract():
    expected = {
        "position": "m", "duty_supply": "1", "duty_exhaust": "1", "pressure_a": "Pa", "velocity": "m/s",
        "pressure_b": "Pa", "deflection": "m", "temperature_a": "K", "pressure_a low": "Pa", "pressure_a high": "Pa",
    }  # fmt: skip
    assert expected.items() <= dict(COLUMNS).items()


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        ([0.0, 0.002, 0.001], "edges of 'duty_supply' go from 0.002 s to 0.001 s"),
        ([0.0, 0.001, 0.001], "must increase strictly"),
        ([0.0, 0.001], "2 time stamps and 3 values"),
        ([0.0, 0.001, np.inf], "a time stamp is not finite"),
    ],
)
def test_wrong_edges_are_refused_in_one_sentence(stamps, words):
    with pytest.raises(DataError) as caught:
        replace(log(duty_supply=np.zeros(5)), edges={"duty_supply": (np.array(stamps), np.zeros(3))})
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_edges_belong_to_a_column_of_a_duty_cycle_and_go_with_it():
    edges = {"duty_supply": (np.array([5e-4, 1.5e-3]), np.array([0.1, 0.2]))}
    made = replace(log(duty_supply=np.zeros(5)), edges=edges)
    assert made.slice(1, 3).edges["duty_supply"][1].tolist() == [0.1, 0.2]
    assert made.with_columns(position=np.zeros(5)).edges.keys() == {"duty_supply"}
    assert not made.with_columns(duty_supply=np.ones(5)).edges
    assert not made.without("duty_supply").edges
    for name in ("position", "duty_exhaust"):
        with pytest.raises(DataError, match=f"edges of '{name}': only the columns duty_supply and duty_exhaust"):
            replace(made, edges={name: edges["duty_supply"]})
