"""The list of the alarms of a fleet."""

from datetime import UTC, datetime
from math import nan

import polars as pl
import pytest

from clutchid.arguments import check_share
from clutchid.documents.fleet_tables import VehicleRow
from clutchid.errors import ParameterError
from clutchid.fleets.alarm_table import alarm_list, list_words
from clutchid.wear import Alarm, Interval
from fixtures.results import REPLACED, write_fleet

DAY = datetime(2026, 1, 5, tzinfo=UTC)

UNKNOWN = Interval(nan, nan, nan)


def vehicle(name, *alarms):
    return VehicleRow(name, "", 9, 9, {}, None, UNKNOWN, UNKNOWN, UNKNOWN, nan, UNKNOWN, "km", events=alarms)


def change(probability, kind="replaced"):
    return Alarm("r1", "r2", DAY, kind, 1e-4, 0.02, probability=probability, shift_std=1e-5)


ROWS = [
    vehicle("V1", change(0.6), change(0.98), change(nan, "departed")),
    vehicle("V2", change(0.9), Alarm("", "r1", None, "departed", 0.0, 0.0)),
]


@pytest.mark.parametrize(
    ("share", "listed", "words"),
    [
        (0.0, 2, "2 alarms listed, 2 without a probability; 3 less probable, not listed"),
        (
            0.1,
            4,
            "4 alarms listed, 0.1 of them expected to be false, 2 without a probability; 1 less probable, not listed",
        ),
        (0.2, 5, "5 alarms listed, 0.5 of them expected to be false, 2 without a probability"),
    ],
)
def test_the_list_is_the_largest_one_whose_expected_share_of_false_alarms_is_allowed(share, listed, words):
    table = alarm_list(ROWS, share)
    assert table["listed"].to_list() == [k < listed for k in range(5)]
    assert table["probability"].to_list() == [None, None, 0.98, 0.9, 0.6]
    assert list_words(table) == words


def test_an_alarm_has_the_sizes_of_its_kind_with_their_intervals_and_what_is_unknown_is_null():
    leak = Alarm("r1", "r2", DAY, "leak", 0.0, 0.0, leak=2e-11, leak_std=1e-12)
    moved = Alarm("r1", "r2", DAY, "sensor moved", 0.0, 0.0, rest=4e-4, rest_std=1e-5)
    rows = {row["kind"]: row for row in alarm_list([*ROWS, vehicle("V3", leak, moved)], 0.1).to_dicts()}
    replaced = rows["replaced"]
    assert replaced["begin"] == DAY
    assert (replaced["shift_mm"], replaced["shift_low_mm"]) == pytest.approx((0.1, 0.0804), abs=1e-4)
    assert (replaced["load_change_percent"], replaced["load_change_low_percent"]) == (2.0, None)
    assert rows["leak"]["leak_low_m3_per_Pa_s"] < 7e-12 < 2e-11 < rows["leak"]["leak_high_m3_per_Pa_s"]
    assert rows["sensor moved"]["rest_shift_high_mm"] == pytest.approx(0.4196, abs=1e-4)
    assert (rows["leak"]["shift_mm"], rows["sensor moved"]["leak_m3_per_Pa_s"]) == (None, None)
    assert rows["wrong calibration"]["after"] is None, "it departs from its first recording on"
    assert rows["departed"]["evidence"].startswith("The actuator deviated from its calibration")


def test_a_run_with_nothing_new_writes_the_same_list_from_its_index(tmp_path):
    write_fleet(tmp_path)
    before, path = (tmp_path / "alarms.parquet").read_bytes(), tmp_path / "alarms.parquet"
    table = pl.read_parquet(path)
    assert (REPLACED, "replaced", True) in table.select("vehicle", "kind", "listed").rows()
    path.unlink()
    write_fleet(tmp_path)
    assert path.read_bytes() == before
    assert alarm_list([], 0.1).schema == table.schema


def test_a_share_of_false_alarms_is_a_share():
    with pytest.raises(ParameterError, match=r"--false-share 20: is a share from 0 to 1, such as 0.1"):
        check_share("--false-share", 20, 0.1)
