r"""Due dates of many vehicles against the truth, their readings DRAWN from measured errors of a reading, or read.

    python benchmarks/due_drawn.py --family A --vehicles 10000 --first 8 --days 28 --table
    python benchmarks/due_drawn.py --family B --vehicles 2000 --days 90 --axis km
    python benchmarks/due_drawn.py --vehicles 100 --months 42 --days 90 --seed 72 --events --table \
        --readings FILE.parquet

Readings that were read are those of `clutchid fleet RESULT`, kept by `--keep RESULT --readings FILE.parquet`, of a
fleet of `clutchid drive --fleet` with the same seed and `--events replaced,leak,sensor`.

Service of `--months` with a recording every `--days`; each vehicle is cut off at `--lives` of them, chosen by chance in
the middle part of its service, and forecast with the vehicles of its type: until the shift of a worn clutch, or with
`--table` until the end of the table of wear. A clutch that is replaced early within a horizon is not counted there.

Printed: probability within days and km in five bins against the share that came true, with its binomial 95 % interval,
and the Brier score; how often 90 % intervals of what is left in strokes, days and km hold, and how wide they are; both
with the types and by each vehicle alone; at 25, 50 and 75 % of a life: the share of vehicles whose median is within
20 and 50 % of the truth (alpha-lambda), and the relative accuracy (1 - error / truth); the prognostic horizon, the part
of a life before its end from which the median stays within these, looked at in eighths (Saxena et al., 2010, Int.
Journal of Prognostics and Health Management 1, 4); and replacements of all vehicles in a month.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
import polars as pl
from scipy import stats
from wear_drawn import drawn, fleet_parser, jobs, table_of, truth

from clutchid.documents.fleet_tables import VehicleRow
from clutchid.fleets.forecasts import forecast_of
from clutchid.log import FloatArray
from clutchid.truck.service import BY_CHANCE, EVENTS, WORN_OUT, Visit, visits
from clutchid.wear.due import WITHIN_DAYS, WITHIN_KM, Forecast, forecast, replacements
from clutchid.wear.evidence import LifeEvidence
from clutchid.wear.history import RecordingJob, WearReading, restored
from clutchid.wear.life import UNKNOWN_INTERVAL, LifeLimits, wear_of
from clutchid.wear.pooling import pooled
from clutchid.wear.trend import LIFE, WearTable

#: Shares of a life at which forecasts are judged, those of them that are printed, and the errors that are near.
SHARES = tuple(k / 8 for k in range(1, 8))
PRINTED, NEAR = (0.25, 0.5, 0.75), (0.2, 0.5)


#: A recording that is not among those that were kept.
NOT_READ = WearReading("bad_input", "not read.", apart=True)


class Clutch(NamedTuple):
    """A clutch of a vehicle: its first and last recording, and strokes, days and km at which it is worn out.

    NaN where it was replaced before, or lasts longer than the service.
    """

    first: int
    last: int
    ends: FloatArray


class Case(NamedTuple):
    """A vehicle cut off: its type, its evidence, strokes, days and km that were left, and for how long it was seen.

    `left` is NaN where the end was not seen; then the clutch lasted at least `seen`.
    """

    number: int
    evidence: LifeEvidence
    left: FloatArray
    seen: FloatArray


def places(service: Sequence[Visit]) -> FloatArray:
    """Strokes, days and km of recordings, (n, 3)."""
    begin = service[0].begin
    return np.array([(v.strokes, (v.begin - begin).total_seconds() / 86400, v.odometer) for v in service])


def clutches(service: Sequence[Visit], limit: float) -> list[Clutch]:
    """The clutches of a vehicle, and where each reaches a wear of `limit`."""
    starts = [0, *(k for k, v in enumerate(service) if k and v.event == "clutch replaced")]
    where, result = places(service), []
    for first, after in zip(starts, [*starts[1:], None], strict=True):
        last = (after or len(service)) - 1
        ends = np.full(3, np.nan)
        if after and last > first:
            rate = (service[last].wear - service[first].wear) / (where[last] - where[first])
            ahead = (limit - service[last].wear) / rate
            if ahead[0] <= where[after, 0] - where[last, 0]:  # else replaced early
                ends = where[last] + np.clip(ahead, 0.0, where[after] - where[last])
        result.append(Clutch(first, last, ends))
    return result


def case(
    service: Sequence[Visit], readings: Sequence[WearReading], at: int, ends: FloatArray, limits: LifeLimits, axis: str
) -> Case | None:
    """A vehicle as it is known at recording `at`; None without a forecast."""
    wear = wear_of("", jobs_on(service[: at + 1], axis), list(readings[: at + 1]), limits)
    where = places(service)
    last = next((k for k in range(at + 1, len(service)) if service[k].event == "clutch replaced"), len(service)) - 1
    return wear.evidence and Case(service[0].number, wear.evidence, ends - where[at], where[last] - where[at])


def jobs_on(service: Sequence[Visit], axis: str) -> list[RecordingJob]:
    """Recordings with strokes, or with km only."""
    rows = jobs(service)
    return rows if axis == "strokes" else [replace(row, strokes=float("nan")) for row in rows]


def stacked(cases: Sequence[Case]) -> LifeEvidence:
    """The evidence of some vehicles."""
    return LifeEvidence(*(np.stack(column) for column in zip(*(row.evidence for row in cases), strict=True)))


def forecasts(cases: Sequence[Case], *, alone: bool) -> Forecast:
    """The forecasts of vehicles in their order, with others of their type or each alone."""
    groups: dict[int, list[int]] = defaultdict(list)
    for i, row in enumerate(cases):
        groups[row.number].append(i)
    order = [i for rows in groups.values() for i in rows]
    parts = []
    for rows in groups.values():
        evidence = stacked([cases[i] for i in rows])
        if alone:
            vehicles = [evidence.at(slice(k, k + 1)) for k in range(len(rows))]
            parts += [forecast(vehicle, pooled(vehicle)) for vehicle in vehicles]
        else:
            parts.append(forecast(evidence, pooled(evidence)))
    back = np.argsort(order)
    return Forecast(*(np.concatenate(column)[back] for column in zip(*parts, strict=True)))


def keep(result: Path, path: Path) -> None:
    """Keep the readings of a fleet without their loads."""
    table = pl.scan_parquet(result / "recordings" / "**" / "*.parquet").sort("written_at").collect()
    rows = table.unique(["vehicle", "recording"], keep="last").sort("vehicle", "recording")
    texts = [json.loads(record)[2] for record in rows["record"]]
    pl.DataFrame({"recording": rows["recording"], "reading": texts}).write_parquet(path, compression="zstd")


def read_again(path: Path) -> dict[str, WearReading]:
    """The readings that were kept, by recording."""
    return {name: restored(text, None) for name, text in pl.read_parquet(path).rows()}


def print_within(name: str, shares: FloatArray, came: FloatArray, counts: FloatArray) -> None:
    """Probabilities against what came true, in five bins."""
    p, y = shares[counts], came[counts]
    words = []
    for k in range(5):
        own = (p >= k / 5) & ((p < (k + 1) / 5) | (k == 4))
        if own.sum():
            low, high = stats.binomtest(int(y[own].sum()), int(own.sum())).proportion_ci()
            words.append(
                f"{100 * p[own].mean():.0f}: {100 * y[own].mean():.0f} ({100 * low:.0f}-{100 * high:.0f}; {own.sum()})"
            )
    brier, by_mean = np.mean((p - y) ** 2), y.mean() * (1 - y.mean())
    print(f"  within {name}: {', '.join(words)}; Brier {brier:.4f}, by the mean {by_mean:.4f}")


def report(cases: Sequence[Case], axis: str, *, alone: bool) -> None:
    """Print how forecasts compare with the truth."""
    table = forecasts(cases, alone=alone)
    left, seen = np.array([row.left for row in cases]), np.array([row.seen for row in cases])
    print(f"{'alone' if alone else 'with its type'}, {len(cases)} vehicles:")
    first = 0 if axis == "strokes" else 2
    for words, horizons, shares, q in (
        ("days", WITHIN_DAYS, table.within_days, 1),
        ("km", WITHIN_KM, table.within_km, 2),
    ):
        for k, horizon in enumerate(horizons):
            came = left[:, q] <= horizon
            counts = came | (left[:, q] > horizon) | (seen[:, q] > horizon)
            print_within(f"{horizon:g} {words}", shares[:, k], came, counts)
    for words, bands, q in (
        (axis, LIFE[axis] * table.left, first),
        ("days", table.left_days, 1),
        ("km", table.left_km, 2),
    ):
        counted = np.isfinite(left[:, q])
        inside = (bands[:, 0] <= left[:, q]) & (left[:, q] <= bands[:, 2])
        below, above = (100 * np.mean(side[counted]) for side in (left[:, q] < bands[:, 0], left[:, q] > bands[:, 2]))
        width = np.median((bands[counted, 2] - bands[counted, 0]) / np.maximum(left[counted, q], 1.0))
        print(f"  left in {words}: {100 * inside[counted].mean():.0f} % of {counted.sum()} in 90 %, {below:.0f} % "
              f"sooner, {above:.0f} % later; width {width:.2f} of the truth")  # fmt: skip
    month = replacements(table.by_month, table.common)
    came = [int(np.sum((left[:, 1] > 30.4375 * k) & (left[:, 1] <= 30.4375 * (k + 1)))) for k in range(12)]
    print("  replacements by month, expected (interval) true: " + ", ".join(
        f"{e:.0f} ({a:.0f}-{b:.0f}) {n}" for e, a, b, n in zip(*month, came, strict=True)))  # fmt: skip


def print_accuracy(at_share: Mapping[float, Sequence[Case | None]]) -> None:
    """Alpha-lambda and relative accuracy at shares of the life, and the prognostic horizon."""
    for words, q in (("strokes or km", 0), ("days", 1)):
        errors = np.array([_errors(rows, q) for rows in at_share.values()])
        for share, error in zip(at_share, errors, strict=True):
            if share in PRINTED:
                own = error[np.isfinite(error)]
                near = ", ".join(f"within {100 * alpha:.0f} % {100 * np.mean(own <= alpha):.0f}" for alpha in NEAR)
                print(
                    f"  at {100 * share:.0f} % of life, {words}: {own.size}, {near}, accuracy {1 - np.median(own):.2f}"
                )
        horizons = []
        for alpha in NEAR:
            near_to_end = np.logical_and.accumulate((errors <= alpha)[::-1])[:, np.isfinite(errors).all(axis=0)]
            horizons.append(f"within {100 * alpha:.0f} % {np.median(near_to_end.sum(axis=0)):.0f}")
        print(f"  prognostic horizon, {words}, median in eighths of a life: {', '.join(horizons)}")


def _errors(rows: Sequence[Case | None], q: int) -> FloatArray:
    """Errors of the medians as shares of the truth, in strokes (`q` = 0) or days; NaN where there is no forecast."""
    errors = np.full(len(rows), np.nan)
    places = [i for i, row in enumerate(rows) if row]
    own = [row for row in rows if row]
    table, true = forecasts(own, alone=False), np.array([row.left[q] for row in own])
    errors[places] = np.abs((table.left_days[:, 1] if q else table.left[:, 1] * LIFE["strokes"]) / true - 1.0)
    return errors


def print_cost(cases: Sequence[Case], count: int) -> None:
    """Time of the forecast of many vehicles, which are copies of some, from the texts of the index."""
    rows = [
        VehicleRow(
            f"V{k}", "", 1, 1, {"ok": 1}, None, *[UNKNOWN_INTERVAL] * 3, 0.0, UNKNOWN_INTERVAL, "strokes",
            pool=f"T{k % 4}", evidence=cases[k % len(cases)].evidence.packed,
        )
        for k in range(count)
    ]  # fmt: skip
    begin, processor = perf_counter(), process_time()
    forecast_of(rows)
    seconds, own = perf_counter() - begin, process_time() - processor
    print(f"{count} vehicles of 4 types: {seconds:.1f} s, {own:.1f} s of a processor")


def main() -> None:
    """Draw, forecast, compare."""
    parser = fleet_parser(__doc__)
    parser.add_argument("--odd", type=float, default=0.0)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--axis", default="strokes", choices=("strokes", "km"))
    parser.add_argument("--events", action="store_true", help="planned events, as of `drive --events`")
    parser.add_argument("--readings", type=Path, help="readings of a fleet that was read")
    parser.add_argument(
        "--cost", type=int, default=0, help="only time the forecast of this number of vehicles, from stored numbers"
    )
    parser.add_argument("--keep", type=Path, help="results of a fleet, whose readings are kept in --readings")
    options = parser.parse_args()
    if options.keep:
        keep(options.keep, options.readings)
        return
    stored = read_again(options.readings) if options.readings else {}
    plan = BY_CHANCE._replace(events=EVENTS if options.events else ())
    random = np.random.default_rng(options.seed)
    size = (options.vehicles, options.months, options.family, options.first, options.types, options.seed, options.days)
    tables = {n: table_of(options.family, n) for n in range(options.first, options.first + options.types)}
    cases: list[Case] = []
    at_share: dict[float, list[Case | None]] = {share: [] for share in SHARES}
    for service in visits(*size, plan):
        table = tables[service[0].number]
        worn = WORN_OUT * float(table.wear[-1])
        ends = WearTable(*(np.append(v[table.wear < worn], np.interp(worn, table.wear, v)) for v in table))
        limits = LifeLimits(table=ends) if options.table else LifeLimits(float(ends.shift[-1]))
        if stored:
            readings = [stored.get(visit.recording, NOT_READ) for visit in service]
        else:
            readings = drawn(service, truth(service, table, 0.0, random), options.odd, random)
        at = int(random.integers(len(service) // 4, 3 * len(service) // 4))
        lives = clutches(service, worn)
        own = next(c for c in lives if c.first <= at <= c.last)
        cases += [row for row in [case(service, readings, at, own.ends, limits, options.axis)] if row]
        whole = next((c for c in lives if np.isfinite(c.ends[0])), None)
        for share in SHARES if whole else ():
            strokes = np.array([v.strokes for v in service])
            begin = strokes[whole.first]
            k = int(np.searchsorted(strokes, begin + share * (whole.ends[0] - begin)))
            inside = k < whole.last
            at_share[share].append(case(service, readings, k, whole.ends, limits, options.axis) if inside else None)
    if options.cost:
        print_cost(cases, options.cost)
        return
    for alone in (False, True):
        report(cases, options.axis, alone=alone)
    print_accuracy(at_share)


if __name__ == "__main__":
    main()
