"""The list of the alarms of a fleet: the largest one, best first, of which at most a share is expected to be false."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents.fleet_tables import VehicleRow
from clutchid.documents.wear_rows import alarm_words
from clutchid.names import capital
from clutchid.wear import Alarm
from clutchid.wear.alarms import size_interval
from clutchid.wear.columns import SIDES, banded

if TYPE_CHECKING:
    import polars as pl

#: File of the list.
ALARM_LIST = "alarms.parquet"

#: Sizes with their units, and the kinds of alarms that have them.
_SIZES = {"shift": "_mm", "load_change": "_percent", "leak": "_m3_per_Pa_s", "rest_shift": "_mm"}


def alarm_list(rows: Sequence[VehicleRow], false_share: float) -> pl.DataFrame:
    """Every alarm of the vehicles as a row, the most probable first, and whether it is `listed`.

    The list is the largest one whose mean probability of a false alarm is at most `false_share`; alarms without a
    probability are listed, before the others.
    """
    import polars as pl

    alarms = [(row, alarm) for row in rows for alarm in row.events]
    table = pl.DataFrame([_columns(row, alarm) for row, alarm in alarms], _schema(), orient="row").fill_nan(None)
    table = table.sort("probability", "vehicle", "begin", "recording", descending=[True, False, False, False])
    false = 1.0 - table["probability"].drop_nulls().to_numpy()
    expected = np.cumsum(false) / np.arange(1, false.size + 1)
    listed = table.height - false.size + int(np.sum(expected <= false_share))
    return table.with_columns(listed=pl.int_range(pl.len()) < listed)


def list_words(table: pl.DataFrame) -> str:
    """How many alarms are listed, how many of them are expected to be false, and how many are not listed."""
    listed, probabilities = table.filter("listed"), table.filter("listed")["probability"].drop_nulls()
    without, rest = listed.height - len(probabilities), table.height - listed.height
    words = f"{listed.height:,} alarm{'' if listed.height == 1 else 's'} listed"
    if len(probabilities):
        words += f", {len(probabilities) - probabilities.sum():.1f} of them expected to be false"
    words += f", {without:,} without a probability" if without else ""
    return f"{words}; {rest:,} less probable, not listed" if rest else words


def _schema() -> dict[str, Any]:
    import polars as pl

    text = dict.fromkeys(("vehicle", "type", "kind", "recording", "after"), pl.String)
    sizes = dict.fromkeys((f"{name}{side}{unit}" for name, unit in _SIZES.items() for side in SIDES), pl.Float64)
    return {
        **text, "begin": pl.Datetime("us", "UTC"), **sizes, "probability": pl.Float64, "evidence": pl.String,
    }  # fmt: skip


def _columns(row: VehicleRow, alarm: Alarm) -> Mapping[str, object]:
    """An alarm as a row; a size that its kind does not have is left out."""
    departed = alarm.kind == "departed" and not alarm.after
    sizes = {
        "leak": banded("leak", alarm.leak_interval, _SIZES["leak"]),
        "sensor moved": banded("rest_shift", size_interval(alarm.rest, alarm.rest_std), "_mm", 1e3),
        "departed": {},
    }.get(
        alarm.kind,
        banded("shift", size_interval(alarm.shift, alarm.shift_std), "_mm", 1e3)
        | banded("load_change", size_interval(alarm.load, alarm.load_std), "_percent", 100.0),
    )
    return {
        "vehicle": row.name, "type": row.type or None, "kind": "wrong calibration" if departed else alarm.kind,
        "recording": alarm.before, "after": alarm.after or None, "begin": alarm.begin, **sizes,
        "probability": alarm.probability, "evidence": f"{capital(alarm_words(alarm))}.",
    }  # fmt: skip
