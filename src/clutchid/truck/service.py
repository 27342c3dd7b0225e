"""Vehicles in service: recordings of a fleet over months, and the events of its clutches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.names import check_names
from clutchid.truck.families import family_label, truck, vehicle_of_type
from clutchid.truck.vehicle import Vehicle

#: First day of the fleet.
_BEGIN = datetime(2024, 1, 8, 6, tzinfo=UTC)

#: Days of a month.
_MONTH = 365.25 / 12

#: Most vehicles, and months, of a fleet.
_MOST = 100_000, 240

#: Strokes in a week, km in a week, and wear in m of a stroke: median, and standard deviation of the logarithm between
#: vehicles. An assumption: a facing of 3.5 mm lasts about a million strokes, three years of distribution traffic.
_STROKES_A_WEEK, _KM_A_WEEK, _WEAR_A_STROKE = (7000.0, 0.25), (2500.0, 0.3), (1 / 3e8, 0.25)

#: Scatter of these within a vehicle, from a week to the next; an assumption.
_SCATTER = 0.2

#: Mean of the air temperature over a year in K, its yearly amplitude, and the scatter of a day; an assumption.
_CLIMATE, _SEASON, _DAY = (283.0, 5.0), (12.0, 3.0), 4.0

#: Supply pressure as a share of the set one: standard deviation of the drift in a year; an assumption.
_SUPPLY_DRIFT = 0.01

#: Probability in a year that a clutch is replaced early, a position sensor is replaced, a leak begins; and in a
#: recording that its file is cut off, the clock restarts, or it is sent twice. Assumptions.
REPLACED, _SENSOR, _LEAK = 0.1, 0.1, 0.05
_CUT_OFF, _CLOCK, _TWICE = 0.01, 0.003, 0.005

#: Standard deviation of the gain of a new position sensor, recordings for which a restarted clock is wrong, and the
#: conductance in m³/(Pa·s) that a leak gains in a week.
_GAIN, _WRONG, _LEAK_A_WEEK = 3e-3, 3, 2e-12

#: Events of a vehicle: a clutch or a position sensor is replaced, a leak begins.
EVENTS = ("replaced", "sensor", "leak")

#: Offset in m, either way, of a position sensor whose exchange is planned: least and largest. An assumption.
_OFFSET = 0.2e-3, 0.5e-3

#: Part of the time in service in which a planned event happens.
_PLANNED = 0.25, 0.75

#: Makes what options add independent of what is drawn without them.
_SALT = 1

#: Share of the facing at which a worn clutch is replaced.
WORN_OUT = 0.97


@dataclass(frozen=True, slots=True)
class Visit:
    """One recording of a vehicle in service.

    `number` is that of the truck type, `begin` the true time, `clock` what the file says; `odometer` in km, `strokes`
    of the vehicle, `wear` [m] and `cycles` of its clutch, `temperature` in K, `supply` as a share of the set pressure,
    `leak` in m³/(Pa·s), `gain` and `offset` [m] of the position sensor. `event` is what happened since the recording
    before ("clutch replaced", "sensor replaced", "leak", or empty), `fault` is what is wrong with its file ("cut off",
    "clock" or "twice"). `spread` is how far the vehicle lies from its type towards type `other`, and `records_supply`
    says whether it records its supply pressure.
    """

    recording: str
    vehicle: str
    family: str
    number: int
    begin: datetime
    clock: datetime
    odometer: float
    strokes: float
    wear: float
    cycles: float
    temperature: float
    supply: float
    leak: float
    gain: float
    seed: int
    event: str = ""
    fault: str = ""
    offset: float = 0.0
    other: int = 0
    spread: float = 0.0
    records_supply: bool = True

    @property
    def truck(self) -> Vehicle:
        """The truck as it is at this recording, but for wear and cycles."""
        new = vehicle_of_type(self.number, self.family, self.other, self.spread)
        return new.replace({"P_S": new.P_S * self.supply, "C_A0": new.C_A0 + self.leak})


class FleetPlan(NamedTuple):
    """Supplies, events and spread of the vehicles of a fleet.

    Attributes
    ----------
    no_supply
        Share of the vehicles that do not record their supply pressure.
    events
        Some of `EVENTS`: each vehicle has one of them, or none, in the middle half of its service. Without any, events
        happen by chance, and an exchanged sensor has another gain but no offset.
    spread
        How far each vehicle lies from its type towards another type of its family, from 0 to 1.
    """

    no_supply: float = 0.0
    events: tuple[str, ...] = ()
    spread: float = 0.0


#: Events by chance, and vehicles of a type that are all alike.
BY_CHANCE = FleetPlan()


def visits(
    vehicles: int,
    months: float,
    family: str = "A",
    first: int = 0,
    types: int = 4,
    seed: int = 0,
    days: float = 7.0,
    plan: FleetPlan = BY_CHANCE,
) -> Iterator[tuple[Visit, ...]]:
    """The recordings of every vehicle, in order of time; the same arguments give the same fleet.

    Parameters
    ----------
    vehicles, months
        Number of vehicles, and months of service.
    family, first, types
        Family of the trucks, number of the first type, and number of types, which the vehicles take in turn.
    seed
        Seed of what happens to the vehicles.
    days
        Mean time from a recording to the next.
    plan
        Supplies that are not recorded, planned events, and the spread of the vehicles of a type.

    Raises
    ------
    ParameterError
        If a number is out of its range, or there is no such event.
    """
    most, longest = _MOST
    for what, value, low, high in (
        ("vehicles", vehicles, 1, most), ("months", months, 0.1, longest), ("types", types, 1, most),
        ("days between recordings", days, 0.1, 365.0), ("seed", seed, 0, 2**63),
        ("as the share without a supply", plan.no_supply, 0, 1), ("as the spread of a type", plan.spread, 0, 1),
    ):  # fmt: skip
        if not low <= value <= high:
            raise ParameterError(f"{value} {what}: a fleet has {low} to {high:g}.")
    check_names(plan.events, EVENTS, "event of a fleet")
    limit = truck(first, family).w_max
    for v in range(vehicles):
        yield tuple(_service(v, family, first + v % types, limit, months * _MONTH, days, seed, plan))


class _Planned(NamedTuple):
    """A planned event of a vehicle: one of `EVENTS` or empty, its day, and the offset of a sensor in m."""

    event: str
    day: float
    offset: float


def _first_visit(v: int, family: str, number: int, length: float, seed: int, plan: FleetPlan) -> tuple[Visit, _Planned]:
    """Vehicle `v` before its first recording, and its planned event."""
    random = np.random.default_rng([seed, v, _SALT])
    unrecorded, other = float(random.uniform()) < plan.no_supply, int(random.integers(2**31))
    kind, day = int(random.integers(len(plan.events) + 1)), length * float(random.uniform(*_PLANNED))
    offset = float(random.choice([-1.0, 1.0]) * random.uniform(*_OFFSET))
    now = Visit(
        "", f"{family_label(family)}{v:05d}", family, number, _BEGIN, _BEGIN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0,
        other=other, spread=plan.spread, records_supply=not unrecorded,
    )  # fmt: skip
    return now, _Planned(("", *plan.events)[kind], day, offset)


def _service(
    v: int, family: str, number: int, limit: float, length: float, days: float, seed: int, plan: FleetPlan
) -> Iterator[Visit]:
    """Recordings of vehicle `v` over `length` days."""
    random = np.random.default_rng([seed, v])
    strokes_a_week, km_a_week, wear_a_stroke = (
        median * float(np.exp(spread * random.standard_normal()))
        for median, spread in (_STROKES_A_WEEK, _KM_A_WEEK, _WEAR_A_STROKE)
    )
    mean, season = (middle + spread * random.standard_normal() for middle, spread in (_CLIMATE, _SEASON))
    day = float(random.uniform(0.0, days))
    now, planned = _first_visit(v, family, number, length, seed, plan)
    passed, wrong, count = day, 0, 0
    while day < length:
        weeks = passed / 7.0
        scatter = np.exp(_SCATTER * random.standard_normal(3))
        strokes = strokes_a_week * weeks * float(scatter[0])
        now = _gone_on(now, strokes, km_a_week * weeks * float(scatter[1]), wear_a_stroke * float(scatter[2]), weeks)
        due = planned if day - passed < planned.day <= day else planned._replace(event="")
        now = _with_event(now, weeks, limit, random, due if plan.events else None)
        begin = _BEGIN + timedelta(days=day)
        yearly = np.cos(2 * np.pi * (begin.timetuple().tm_yday - 200) / 365.25)
        fault = _fault(random)
        wrong = _WRONG if fault == "clock" else max(wrong - 1, 0)
        clock = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(hours=10.0 * (_WRONG - wrong)) if wrong else begin
        now = replace(
            now, recording=f"{now.vehicle}_{count:04d}", begin=begin, clock=clock,
            temperature=float(np.clip(mean + season * yearly + _DAY * random.standard_normal(), 238.0, 318.0)),
            seed=int(random.integers(2**31)), fault="clock" if wrong and not fault else fault,
        )  # fmt: skip
        yield now
        passed = float(days * random.uniform(0.7, 1.3))
        day, count = day + passed, count + 1


def _gone_on(now: Visit, strokes: float, km: float, wear_a_stroke: float, weeks: float) -> Visit:
    """A vehicle after some weeks without an event."""
    return replace(
        now, strokes=now.strokes + strokes, cycles=now.cycles + strokes, odometer=now.odometer + km,
        wear=now.wear + wear_a_stroke * strokes, event="",
        leak=now.leak + (_LEAK_A_WEEK * weeks if now.leak else 0.0),
    )  # fmt: skip


def _with_event(now: Visit, weeks: float, limit: float, random: np.random.Generator, planned: _Planned | None) -> Visit:
    """Events of a vehicle, at most one at a time, by chance or as planned, and the drift of its supply."""
    years, drawn = weeks * 7.0 / 365.25, random.uniform(size=3)
    drift, gain = _SUPPLY_DRIFT * np.sqrt(years) * random.standard_normal(), _GAIN * random.standard_normal()
    now = replace(now, supply=float(np.clip(now.supply + drift, 0.9, 1.05)))
    chances = zip(EVENTS, drawn, (REPLACED, _SENSOR, _LEAK), strict=True)
    events = [event for event, at, rate in chances if at < rate * years] if planned is None else [planned.event]
    if now.wear >= WORN_OUT * limit or "replaced" in events:
        return replace(now, wear=0.0, cycles=0.0, event="clutch replaced")
    if "sensor" in events:
        return replace(now, gain=1.0 + float(gain), offset=planned.offset if planned else 0.0, event="sensor replaced")
    if "leak" in events and not now.leak:
        return replace(now, leak=_LEAK_A_WEEK, event="leak")
    return now


def _fault(random: np.random.Generator) -> str:
    """Fault of a file."""
    drawn, edge = float(random.uniform()), 0.0
    for fault, probability in (("cut off", _CUT_OFF), ("clock", _CLOCK), ("twice", _TWICE)):
        edge += probability
        if drawn < edge:
            return fault
    return ""
