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


def test_a_recording_of_a_three_way_valve_is_read_with_its_one_column(tmp_path):
    t = np.arange(50) * 1e-3
    file = tmp_path / "lift.csv"
    write(Log(t, {"position": 0.1 * t, "duty_supply": 1.0 * (t > 0.02)}), file)
    (log,) = Reading((file,), ambient=1e5).read(Actuator(equipment=Equipment(valves="3/2")))
    assert np.array_equal(log["duty_exhaust"], 1.0 - log["duty_supply"])
    for actuator in (None, Actuator(), Actuator(equipment=Equipment(valves="exhaust"))):
        with pytest.raises(DataError, match="duty_exhaust"):
            Reading((file,), ambient=1e5).read(actuator)
