"""Recordings of other actuators, as every verb reads them."""

from __future__ import annotations

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.measurements import write
from clutchid.model import Actuator
from clutchid.model.equipment import Equipment
from clutchid.verbs.reading import Reading
from fixtures.forms import NAMES, kind_in, write_forms


def test_a_recording_of_a_three_way_valve_is_read_with_its_one_column(tmp_path):
    t = np.arange(50) * 1e-3
    file = tmp_path / "lift.csv"
    write(Log(t, {"position": 0.1 * t, "duty_supply": 1.0 * (t > 0.02)}), file)
    (log,) = Reading((file,), ambient=1e5).read(Actuator(equipment=Equipment(valves="3/2")))
    assert np.array_equal(log["duty_exhaust"], 1.0 - log["duty_supply"])
    for actuator in (None, Actuator(), Actuator(equipment=Equipment(valves="exhaust"))):
        with pytest.raises(DataError, match="duty_exhaust"):
            Reading((file,), ambient=1e5).read(actuator)


def test_a_dbc_is_for_the_bus_logs_of_a_reading_and_none_is_an_error(tmp_path):
    t = np.arange(500) * 1e-3
    still = Log(
        t, {"position": 1e-5 * np.sin(9.0 * t), "duty_supply": 1.0 * (t > 0.3), "duty_exhaust": 1.0 * (t < 0.2)}
    )
    dbc, names = write_forms(still, tmp_path), [name for name in NAMES if kind_in(name) in ("csv", "candump")]
    table, bus = (next(tmp_path / name for name in names if kind_in(name) == kind) for kind in ("csv", "candump"))
    both = Reading((table, bus), dbc=(dbc,)).read()
    assert [len(log) for log in both] == [len(still)] * 2
    for logs in ((table,), (table, table)):
        with pytest.raises(DataError, match="leave --dbc out"):
            Reading(logs, dbc=(dbc,)).read()
