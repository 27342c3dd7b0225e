"""Alarms and forecasts on many vehicles whose readings are DRAWN from measured errors of a reading, not read.

    python benchmarks/wear_drawn.py --family A --vehicles 1000

Service of four years, a recording a week (`clutchid drive --fleet` with the same seed has the same vehicles); shift and
load of a reading are the true ones plus a constant error of the vehicle, one by air temperature, and one of its own, as
`benchmarks/wear.py` measured them. Exchanged sensors and leaks change nothing here. A clutch is found to be
replaced if an alarm names one of the two recordings from it on; every other alarm is false.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import Measurement, half_load
from clutchid.fleets.virtual import POSITIONS, STEPS, STROKES_A_METRE, engaging, true_load
from clutchid.log import FloatArray
from clutchid.truck import aged
from clutchid.truck.families import truck
from clutchid.truck.service import Visit, visits
from clutchid.wear.history import Dated, History, WearReading
from clutchid.wear.life import Wear, wear_of
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


class Life(NamedTuple):
    """What one vehicle adds: shift errors in m, whether the band holds, replacements and found ones, false alarms."""

    errors: FloatArray
    covered: FloatArray
    replaced: int
    found: int
    false: int
    recordings: int


def table_of(family: str, number: int) -> WearTable:
    """Shift and load of a type against wear of the facing."""
    new = truck(number, family)
    wear = np.linspace(0.0, new.w_max, STEPS)
    loads = [true_load(aged(new, w, w * STROKES_A_METRE)) for w in wear]
    half, load = np.array([half_load(POSITIONS, one) for one in loads]), np.array([engaging(one) for one in loads])
    return WearTable(wear, half - half[0], load / load[0] - 1.0)


def drawn(service: Sequence[Visit], table: WearTable, random: np.random.Generator) -> list[WearReading]:
    """The readings of a vehicle; those of a file that was cut off are missing."""
    errors = MEASURED[service[0].family]
    fixed = [(e.constant * random.standard_normal(), e.warm * random.standard_normal()) for e in errors]
    readings = []
    for visit in service:
        warmer = (visit.temperature - REFERENCE) / 10.0
        true = [float(np.interp(visit.wear, table.wear, values)) for values in (table.shift, table.load)]
        read = [
            value + e.std * (constant + warm * warmer + e.own * random.standard_normal())
            for value, e, (constant, warm) in zip(true, errors, fixed, strict=True)
        ]
        measured = Measurement(read[0], errors[0].std, read[1], errors[1].std, visit.temperature)
        readings.append(WearReading("ok", "", "good", None if visit.fault == "cut off" else measured))
    return readings


def history(service: Sequence[Visit]) -> History:
    """The recordings over strokes."""
    dated = tuple(Dated(v.recording, v.begin, v.odometer, v.strokes, "table") for v in service)
    return History(tuple(range(len(dated))), dated, "strokes", np.array([v.strokes for v in service]))


def life(service: Sequence[Visit], wear: Wear, table: WearTable) -> Life:
    """How the trend of one vehicle compares with the truth."""
    true = np.interp([v.wear for v in service], table.wear, table.shift)
    band = wear.then["shift"]
    inside = (band.low <= true) & (true <= band.high)
    replaced = {k for k, v in enumerate(service) if v.event == "clutch replaced" and 0 < k < len(service) - 1}
    alarms = {next(k for k, v in enumerate(service) if v.recording == alarm.before) for alarm in wear.alarms}
    found = {k for k in replaced if alarms & {k, k + 1}}
    false = [k for k in alarms if not {k, k - 1} & replaced]
    return Life((band.value - true)[10:], inside[10:], len(replaced), len(found), len(false), len(service))


def forecast(
    service: Sequence[Visit], readings: Sequence[WearReading], table: WearTable, *, known: bool
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
    ends = WearTable(*(values[table.wear <= last.wear] for values in table)) if known else None
    wear = wear_of("", history(service[: half + 1]), readings[: half + 1], ends, None if known else limit)
    left = last.strokes - service[half].strokes
    return None if wear.left is None else bool(wear.left.low <= left <= wear.left.high)


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--family", default="A", choices=tuple(MEASURED))
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--types", type=int, default=4)
    parser.add_argument("--seed", type=int, default=5000)
    options = parser.parse_args()
    tables = {n: table_of(options.family, n) for n in range(options.first, options.first + options.types)}
    random = np.random.default_rng(options.seed)
    lives: list[tuple[int, Life, bool | None, bool | None]] = []
    for service in visits(options.vehicles, 48.0, options.family, options.first, options.types, options.seed):
        table = tables[service[0].number]
        readings = drawn(service, table, random)
        one = life(service, wear_of("", history(service), readings), table)
        both = (forecast(service, readings, table, known=known) for known in (False, True))
        lives.append((service[0].number, one, *both))
    lives.sort(key=lambda row: row[0])
    for number, some in groupby(lives, key=lambda row: row[0]):
        report(f"type {number}", tables[number], list(some))
    report("all", None, lives)


def report(name: str, table: WearTable | None, some: Sequence[tuple[int, Life, bool | None, bool | None]]) -> None:
    """Print the rates of some vehicles."""
    found = [row[1] for row in some]
    errors = 1e3 * np.abs(np.concatenate([one.errors for one in found]))
    covered = 100.0 * np.mean(np.concatenate([one.covered for one in found]))
    replaced, seen = sum(one.replaced for one in found), sum(one.found for one in found)
    rate = 1e3 * sum(one.false for one in found) / sum(one.recordings for one in found)
    held = [[row[k] for row in some if row[k] is not None] for k in (2, 3)]
    words = [f"{100 * np.mean(one):.0f} % of {len(one)}" if one else "-" for one in held]
    moves = f", {1e3 * table.shift[-1]:+.2f} mm and {100 * table.load[-1]:+.0f} % when worn out" if table else ""
    print(
        f"{name}{moves}: shift {np.median(errors):.3f} / {errors.max():.3f} mm off, covered {covered:.0f} %; "
        f"replaced found {100 * seen / max(replaced, 1):.0f} % of {replaced}; {rate:.2f} false alarms in 1,000 "
        f"recordings; what is left covered {words[0]} by a shift, {words[1]} with a table"
    )


if __name__ == "__main__":
    main()
