"""Vehicles in service: what happens to them, before any of it is driven."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.truck import truck
from clutchid.truck.service import WORN_OUT, FleetPlan, visits


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


@pytest.mark.parametrize("family", ["A", "B", "h:3"])
def test_vehicles_of_a_type_are_all_alike_or_lie_around_it(family):
    plain, spread = (
        [vehicle[0] for vehicle in visits(20, 3, family, types=1, days=30.0, plan=FleetPlan(spread=share))]
        for share in (0.0, 0.1)
    )
    new = truck(0, family)
    for visit in plain:
        assert visit.truck == new.replace({"P_S": new.P_S * visit.supply, "C_A0": new.C_A0 + visit.leak})
    assert [visit.supply for visit in plain] == [visit.supply for visit in spread]
    peaks, frictions = (
        np.array([getattr(v.truck, name) for v in spread]) / getattr(new, name) for name in ("K_z", "F_C")
    )
    for values in (peaks, frictions):
        assert len(set(values)) == 20
        assert np.abs(values - 1.0).max() < 0.1
    assert {(v.truck.t_lead, v.truck.T_pwm) for v in spread} == {(new.t_lead, new.T_pwm)}


def test_planned_events_happen_once_in_the_middle_of_a_service():
    plan = FleetPlan(no_supply=0.5, events=("replaced", "leak", "sensor"))
    plain, fleet = ([*visits(60, 24, days=60.0, seed=3, plan=options)] for options in (FleetPlan(), plan))
    events = [[(k, visit.event) for k, visit in enumerate(vehicle) if visit.event] for vehicle in fleet]
    assert Counter(len(of) for of in events).keys() <= {0, 1, 2}, "a worn clutch is replaced as well"
    counts = Counter(event for of in events for _, event in of)
    assert min(counts[name] for name in ("clutch replaced", "sensor replaced", "leak")) >= 8
    exchanged = [(k, visit) for v in fleet for k, visit in enumerate(v) if visit.event == "sensor replaced"]
    assert all(2 <= k <= 10 and 0.2e-3 <= abs(visit.offset) <= 0.5e-3 for k, visit in exchanged)
    assert {np.sign(visit.offset) for _, visit in exchanged} == {-1.0, 1.0}
    assert 20 <= sum(not vehicle[0].records_supply for vehicle in fleet) <= 40
    # nothing else changes
    same = ("begin", "strokes", "odometer", "temperature", "supply", "seed", "fault")
    assert [[getattr(v, n) for n in same] for of in plain for v in of] == [
        [getattr(v, n) for n in same] for of in fleet for v in of
    ]
    assert all(visit.offset == 0.0 and visit.records_supply for vehicle in plain for visit in vehicle)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"plan": FleetPlan(no_supply=1.5)}, "1.5 as the share"),
        ({"plan": FleetPlan(events=("flood",))}, "flood"),
        ({"vehicles": 0}, "0 vehicles"),
        ({"months": 0}, "0 months"),
        ({"types": 0}, "0 types"),
    ],
)
def test_a_fleet_that_cannot_be_is_refused(options, text):
    with pytest.raises(ParameterError, match=text):
        next(visits(**{"vehicles": 1, "months": 1, **options}))
