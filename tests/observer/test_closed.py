"""A piston that moves with closed valves: a sensor that creeps, or a supply valve that leaks."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.observer import observe_recording, observer, start
from clutchid.observer.flags import MOVES_CLOSED
from clutchid.observer.inputs import taken_in

TIME = 1e-3 * np.arange(70_000)


def flagged(plant, position, supply=0.0):
    """Samples with the flag, of a position in m, with a supply valve that is closed or not."""
    duties = {"duty_supply": np.full(TIME.size, supply), "duty_exhaust": np.zeros(TIME.size)}
    noise = 1e-5 * np.random.default_rng(0).standard_normal(TIME.size)
    log = Log(TIME, {"position": position + noise, **duties})
    joint = observer(plant)
    return np.flatnonzero(taken_in(joint, start(joint).inputs, np.nan, log)[0]["flags"] & MOVES_CLOSED)


@pytest.mark.parametrize("rate", [3e-5, 1e-4])
def test_a_position_that_creeps_out_is_found_as_soon_as_it_is_a_tenth_of_a_millimetre_off(plant, rate):
    first = TIME[flagged(plant, 8e-3 + rate * TIME)[0]]
    assert 1.0 + 1e-4 / rate < first < 2.5 + 1e-4 / rate


@pytest.mark.parametrize(
    ("position", "supply"),
    [
        (8e-3 - 1e-4 * TIME, 0.0),
        (8e-3 + 1e-3 * np.exp(-TIME / 0.2), 0.0),
        (8e-3 + 1e-6 * TIME, 0.0),
        (1e-4 * TIME, 0.1),
    ],
    ids=["falls", "settles", "drifts by less", "open valve"],
)
def test_what_falls_settles_or_moves_with_an_open_valve_is_none(plant, position, supply):
    assert flagged(plant, position, supply).size == 0


def test_no_stroke_of_a_sound_truck_has_it(plant, recorded_by):
    log = recorded_by(plant, driven=1)
    assert observe_recording(observer(plant), log).health["moves_closed"] == 0.0
