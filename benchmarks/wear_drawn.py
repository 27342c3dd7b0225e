"""Alarms and forecasts on many vehicles whose readings are DRAWN from measured errors of a reading, not read.

    python benchmarks/wear_drawn.py --family A --vehicles 1000
    python benchmarks/wear_drawn.py --vehicles 300 --months 42 --days 90 --odd 0.02 --faults 0.1    (few, and spoiled)

Service of four years, a recording a week (`clutchid drive --fleet` with the same seed has the same vehicles); shift and
load of a reading are the true ones plus a constant error of the vehicle, one by air temperature, and one of its own, as
`benchmarks/wear.py` measured them. Exchanged sensors and leaks change nothing here. A clutch is found to be
replaced if an alarm names one of the two recordings from it on; every other alarm is false. `--odd` is the share of
readings that miss by far, `--faults` that of vehicles whose load changes suddenly, by a fault that stays until the
clutch is replaced. The alarms of the trend of shift and load, and of that with a table of wear, are counted by kind.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import Measurement, half_load
from clutchid.log import FloatArray
from clutchid.truck import aged
from clutchid.truck.families import truck
from clutchid.truck.service import Visit, visits
from clutchid.verbs.virtual_fleet import LOAD_POSITIONS, STEPS, STROKES_A_METRE, engaging, load_at_positions
from clutchid.wear.history import RecordingJob, WearReading
from clutchid.wear.life import LifeLimits, Wear, wear_of
from clutchid.wear.trend import REFERENCE, WearTable


class Errors(NamedTuple):
    """Standard deviation that a reading reports, in SI, and what is constant, by 10 K, and its own, as shares of it."""

    std: float
    constant: float
    warm: float
    own: float


#: As `benchmarks/wear.py` measured them on types 0 to 3: benchmarks/results/wear.md.
MEASURED = {
    "A": (Errors(44e-6, 0.20, 0.07, 0.09), Errors(0.0135, 0.30, 0.29, 0.29)),
    "B": (Errors(78e-6, 0.18, 0.05, 0.09), Errors(0.025, 0.36, 0.12, 0.17)),
}


#: Spread of a reading that misses by far, and of a sudden change: shift [m] and load.
ODD, FAULT = (0.3e-3, 0.1), (0.3e-3, 0.1)


class Life(NamedTuple):
    """What one vehicle adds: shift errors in m, whether the band holds, and its events by kind of what an alarm says.

    `replaced` and `faults` are the alarm of each true event, "" where it is missed; `false` the alarms without event.
    """

    errors: FloatArray
    covered: FloatArray
    replaced: list[str]
    faults: list[str]
    false: list[str]
    recordings: int


def table_of(family: str, number: int) -> WearTable:
    """Shift and load of a type against wear of the facing."""
    new = truck(number, family)
    wear = np.linspace(0.0, new.w_max, STEPS)
    loads = [load_at_positions(aged(new, w, w * STROKES_A_METRE)) for w in wear]
    half, load = (
        np.array([half_load(LOAD_POSITIONS, curve) for curve in loads]),
        np.array([engaging(curve) for curve in loads]),
    )
    return WearTable(wear, half - half[0], load / load[0] - 1.0)


class Spoiled(NamedTuple):
    """Share of readings that miss by far, and of vehicles whose load changes suddenly."""

    odd: float = 0.0
    faults: float = 0.0


class Truth(NamedTuple):
    """Half-load shift in m and load by recording, with the fault, and the recording before which it began, or None."""

    shift: FloatArray
    load: FloatArray
    fault: int | None


def truth(service: Sequence[Visit], table: WearTable, faults: float, random: np.random.Generator) -> Truth:
    """True shift and load; a fault begins at any recording and ends with the clutch."""
    values = [np.interp([visit.wear for visit in service], table.wear, series) for series in (table.shift, table.load)]
    if len(service) < 5 or random.uniform() >= faults:
        return Truth(*values, None)
    begin = int(random.integers(2, len(service) - 2))
    end = next((k for k in range(begin, len(service)) if service[k].event == "clutch replaced"), len(service))
    for series, size in zip(values, FAULT, strict=True):
        series[begin:end] += size * random.standard_normal()
    return Truth(*values, begin if end > begin else None)


def drawn(service: Sequence[Visit], true: Truth, odd: float, random: np.random.Generator) -> list[WearReading]:
    """The readings of a vehicle; those of a file that was cut off are missing."""
    errors = MEASURED[service[0].family]
    fixed = [(e.constant * random.standard_normal(), e.warm * random.standard_normal()) for e in errors]
    readings = []
    for visit, *values in zip(service, true.shift, true.load, strict=True):
        warmer = (visit.temperature - REFERENCE) / 10.0
        misses = random.standard_normal(2) * ODD if odd and random.uniform() < odd else (0.0, 0.0)
        read = [
            value + e.std * (constant + warm * warmer + e.own * random.standard_normal()) + miss
            for value, e, (constant, warm), miss in zip(values, errors, fixed, misses, strict=True)
        ]
        measured = Measurement(read[0], errors[0].std, read[1], errors[1].std, visit.temperature)
        readings.append(WearReading("ok", "", "good", None if visit.fault == "cut off" else measured))
    return readings


def jobs(service: Sequence[Visit]) -> list[RecordingJob]:
    """The recordings over strokes."""
    return [RecordingJob(v.recording, "", "", v.begin, v.odometer, v.strokes) for v in service]


def life(service: Sequence[Visit], wear: Wear, true: Truth) -> Life:
    """How the trend of one vehicle compares with the truth."""
    band = wear.then["shift"]
    inside = (band.low <= true.shift) & (true.shift <= band.high)
    names = {visit.recording: k for k, visit in enumerate(service)}
    alarms = {names[alarm.before]: alarm.kind for alarm in wear.alarms}
    new = [k for k, v in enumerate(service) if v.event == "clutch replaced" and k]
    replaced = [k for k in new if k < len(service) - 1]  # at the last one an alarm is right, and none is not wrong
    faults = [] if true.fault is None else [true.fault]
    kinds = [[alarms.get(k, alarms.get(k + 1, "")) for k in events] for events in (replaced, faults)]
    false = [kind for k, kind in alarms.items() if not {k, k - 1} & {*new, *faults}]
    begin = min(10, len(service) // 2)
    return Life((band.value - true.shift)[begin:], inside[begin:], *kinds, false, len(service))


def forecast(
    service: Sequence[Visit], readings: Sequence[WearReading], table: WearTable, *, with_table: bool
) -> bool | None:
    """Whether the 90 % interval, given at half of the first clutch's life, covers what was left; None if it lived on.

    With `known` the table of wear is given, else the limit is a shift.
    """
    end = next((k for k, v in enumerate(service) if k and v.wear < service[k - 1].wear), None)
    if end is None or service[end - 1].wear < 0.9 * table.wear[-1]:
        return None
    last = service[end - 1]
    half = next(k for k, v in enumerate(service) if v.wear >= 0.5 * last.wear)
    limit = float(np.interp(last.wear, table.wear, table.shift))
    ends = WearTable(*(values[table.wear <= last.wear] for values in table)) if with_table else None
    limits = LifeLimits(None if with_table else limit, ends)
    wear = wear_of("", jobs(service[: half + 1]), readings[: half + 1], limits)
    left = last.strokes - service[half].strokes
    return None if wear.left is None else bool(wear.left.low <= left <= wear.left.high)


def fleet_parser(text: str, seed: int = 5000, months: float = 48.0) -> argparse.ArgumentParser:
    """Options of a fleet of drawn vehicles."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("--family", default="A", choices=tuple(MEASURED))
    for name, whole in (("vehicles", 1000), ("first", 0), ("types", 4), ("seed", seed)):
        parser.add_argument(f"--{name}", type=int, default=whole)
    for name, number in (("months", months), ("days", 7.0)):
        parser.add_argument(f"--{name}", type=float, default=number)
    return parser


def main() -> None:
    """Print the rates."""
    parser = fleet_parser(__doc__)
    parser.add_argument("--odd", type=float, default=0.0)
    parser.add_argument("--faults", type=float, default=0.0)
    options = parser.parse_args()
    tables = {n: table_of(options.family, n) for n in range(options.first, options.first + options.types)}
    random = np.random.default_rng(options.seed)
    lives: list[Row] = []
    fleet = visits(
        options.vehicles, options.months, options.family, options.first, options.types, options.seed, options.days
    )
    for service in fleet:
        table = tables[service[0].number]
        true = truth(service, table, options.faults, random)
        readings = drawn(service, true, options.odd, random)
        both = [
            life(service, wear_of("", jobs(service), readings, LifeLimits(table=table_of_wear)), true)
            for table_of_wear in (None, table)
        ]
        held = (
            []
            if true.fault
            else [forecast(service, readings, table, with_table=with_table) for with_table in (False, True)]
        )
        lives.append(Row(service[0].number, *both, *(held or (None, None))))
    lives.sort(key=lambda row: row.number)
    for number, some in groupby(lives, key=lambda row: row.number):
        report(f"type {number}", tables[number], list(some))
    report("all", None, lives)


class Row(NamedTuple):
    """A vehicle: number of its type, its life without and with a table, and whether its forecasts hold."""

    number: int
    alone: Life
    known: Life
    left_alone: bool | None
    left_known: bool | None


def report(name: str, table: WearTable | None, some: Sequence[Row]) -> None:
    """Print the rates of some vehicles."""
    moves = f", {1e3 * table.shift[-1]:+.2f} mm and {100 * table.load[-1]:+.0f} % when worn out" if table else ""
    print(f"{name}{moves}:")
    for words, rows, held in (
        ("shift", [row.alone for row in some], [row.left_alone for row in some]),
        ("table", [row.known for row in some], [row.left_known for row in some]),
    ):
        errors = 1e3 * np.abs(np.concatenate([drawn.errors for drawn in rows]))
        covered = 100.0 * np.mean(np.concatenate([drawn.covered for drawn in rows]))
        recordings = sum(drawn.recordings for drawn in rows)
        events = [Counter(kind for drawn in rows for kind in getattr(drawn, event)) for event in ("replaced", "faults")]
        false = Counter(kind for drawn in rows for kind in drawn.false)
        holds = [drawn for drawn in held if drawn is not None]
        left = f"{100 * np.mean(holds):.0f} % of {len(holds)}" if holds else "-"
        print(
            f"  {words}: {np.median(errors):.3f} / {errors.max():.3f} mm off, covered {covered:.0f} %; "
            f"replaced {_counts(events[0])}; faults {_counts(events[1])}; false in {recordings} recordings "
            f"{_counts(false)}; what is left covered {left}"
        )


def _counts(kinds: Counter[str]) -> str:
    """Numbers by kind of alarm."""
    return ", ".join(f"{number} {kind or 'missed'}" for kind, number in kinds.most_common()) or "none"


if __name__ == "__main__":
    main()
