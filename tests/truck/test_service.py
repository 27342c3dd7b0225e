"""Vehicles in service: what happens to them, before any of it is driven."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.truck import truck
from clutchid.truck.service import WORN_OUT, visits


@pytest.fixture(scope="module")
def fleet():
    return list(visits(40, 36, family="B", first=5, types=3, seed=5000))


def test_a_vehicle_does_not_depend_on_how_many_there_are(fleet):
    assert list(visits(2, 36, family="B", first=5, types=3, seed=5000)) == fleet[:2]
    assert list(visits(2, 36, family="B", first=5, types=3, seed=5001)) != fleet[:2]


def test_three_years_have_a_recording_a_week_of_every_vehicle(fleet):
    assert all(145 <= len(vehicle) <= 168 for vehicle in fleet)
    assert [vehicle[0].number for vehicle in fleet[:4]] == [5, 6, 7, 5]
    for earlier, other in ((a, b) for vehicle in fleet for a, b in pairwise(vehicle)):
        assert earlier.begin < other.begin
        assert earlier.strokes < other.strokes
        assert earlier.odometer < other.odometer


@pytest.mark.slow
def test_a_facing_wears_until_the_clutch_is_replaced(fleet):
    end = truck(5, "B").w_max
    for earlier, other in ((a, b) for vehicle in fleet for a, b in pairwise(vehicle)):
        assert (other.wear == 0.0) if other.event == "clutch replaced" else (other.wear > earlier.wear)
        assert other.wear < end
    events = Counter(visit.event for vehicle in fleet for visit in vehicle)
    assert {"clutch replaced", "sensor replaced", "leak"} <= events.keys()
    worn_out = [a for vehicle in fleet for a, b in pairwise(vehicle) if b.event and a.wear > 0.9 * WORN_OUT * 3.5e-3]
    assert worn_out, "some clutches reach the end of their facing"


def test_the_air_follows_the_seasons(fleet):
    months = [(visit.begin.month, visit.temperature) for vehicle in fleet for visit in vehicle]
    july, january = (np.mean([T for month, T in months if month == m]) for m in (7, 1))
    assert 15.0 < july - january < 33.0


def test_some_files_go_wrong_and_clocks_restart(fleet):
    every = [visit for vehicle in fleet for visit in vehicle]
    assert {"cut off", "clock", "twice", ""} == {visit.fault for visit in every}
    assert all((visit.clock.year == 1970) == (visit.clock != visit.begin) for visit in every)
    assert any(visit.fault == "clock" and visit.clock.year == 1970 for visit in every)


@pytest.mark.parametrize(
    ("options", "text"), [({"vehicles": 0}, "0 vehicles"), ({"months": 0}, "0 months"), ({"types": 0}, "0 types")]
)
def test_a_fleet_that_cannot_be_is_refused(options, text):
    with pytest.raises(ParameterError, match=text):
        next(visits(**{"vehicles": 1, "months": 1, **options}))
