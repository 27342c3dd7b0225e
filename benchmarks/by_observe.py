"""Cost, error, coverage and alarms of ``track --by observe|estimate|auto`` on virtual fleets.

    python benchmarks/by_observe.py DIR --family A --vehicles 10 --seed 70

makes a fleet in DIR (half of the vehicles without a recorded supply pressure; each has a replaced clutch, an exchanged
sensor, a leak or nothing, and differs from its type), calibrates its types, and reads every recording by observe and by
estimate. Readings are kept in DIR/readings.jsonl, so that a run can be stopped and continued.

Then the tables: what the errors of a vehicle's readings share, in their own standard deviations; and cost, error,
coverage and alarms by what reads the recordings, for all vehicles and by whether they record the supply pressure.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

import clutchid
from clutchid.log import FloatArray
from clutchid.truck.service import BY_CHANCE, EVENTS, visits
from clutchid.verbs.reading import Reading
from clutchid.verbs.virtual_fleet import write_fleet
from clutchid.verbs.wear_reading import read_recording
from clutchid.wear.alarms import CHANGED
from clutchid.wear.history import RecordingJob, WearReading, packed_reading, restored
from clutchid.wear.life import LifeLimits, Wear, to_estimate, wear_of
from clutchid.wear.tables import read_table
from clutchid.wear.trend import REFERENCE

#: By event: kinds of its alarm, and recordings after it within which an alarm is its own; a leak grows.
ALARMS = {
    "clutch replaced": (CHANGED, 2),
    "sensor replaced": (("sensor moved",), 1),
    "leak": (("leak", "departed"), 1000),
}

WAYS = ("observe", "estimate", "auto")


class Read(NamedTuple):
    """A reading, and the seconds of a processor that it took."""

    reading: WearReading
    seconds: float


class Recording(NamedTuple):
    """A recording with its truth, and its readings by what read it; `first` is that of the first pass of auto."""

    job: RecordingJob
    truth: Mapping[str, Any]
    by: Mapping[str, Read]


class Life(NamedTuple):
    """The wear of a vehicle as followed in one way, its recordings, seconds of a processor, and second estimates."""

    wear: Wear
    recordings: Sequence[Recording]
    seconds: float
    again: int


def make(folder: Path, options: argparse.Namespace) -> None:
    """The fleet and the calibrations of its types, as far as they are not there."""
    if not folder.exists():
        plan = BY_CHANCE._replace(no_supply=options.no_supply, spread=options.spread)
        plan = plan if options.by_chance else plan._replace(events=EVENTS)
        size = (options.vehicles, options.months, options.family, 0, options.types, options.seed, options.days)
        write_fleet(folder, visits(*size, plan))
    for path in sorted((folder / "calibrations").glob("*.parquet")):
        start = path.with_suffix(".toml")
        if not start.exists():
            clutchid.write_parameters(clutchid.parameter_file(clutchid.calibrate(path)), start)


def timed(by: str, job: RecordingJob) -> Read:
    """A reading in this process."""
    begin = time.process_time()
    reading = read_recording(Reading(), by, job)
    return Read(reading, time.process_time() - begin)


def read_by_all(job: RecordingJob) -> dict[str, Read]:
    """A recording by observe, by estimate, and by the first pass of auto, which is one of the two."""
    first, observed = timed("auto", job), timed("observe", job)
    if first.reading.by == "observe":
        return {"observe": observed, "estimate": timed("estimate", job), "first": first}
    return {"observe": observed, "estimate": first._replace(seconds=first.seconds - observed.seconds), "first": first}


def jobs_of(folder: Path) -> list[RecordingJob]:
    """The recordings of a fleet, without the copies of those that were sent twice."""
    return [
        replace(
            job,
            path=folder / "recordings" / job.vehicle / f"{job.recording}.parquet",
            start=folder / "calibrations" / f"{job.type}.toml",
        )
        for job in read_table(folder / "recordings.csv").values()
        if not job.recording.endswith("_again")
    ]


def store(folder: Path) -> None:
    """Read the recordings that are not kept yet."""
    path, jobs = folder / "readings.jsonl", jobs_of(folder)
    readings = stored(folder)
    missing = [job for job in jobs if job.recording not in readings]
    for job in missing[:1]:
        read_by_all(job)  # compiles
    with path.open("a", encoding="utf-8") as file:
        for job in missing:
            texts = {by: (packed_reading(reading)[0], seconds) for by, (reading, seconds) in read_by_all(job).items()}
            file.write(json.dumps({"recording": job.recording, **texts}) + "\n")
            file.flush()


def stored(folder: Path) -> dict[str, dict[str, Read]]:
    """The readings that are kept, by recording and what read it."""
    path = folder / "readings.jsonl"
    rows = map(json.loads, path.read_text(encoding="utf-8").splitlines() if path.exists() else [])
    return {
        row.pop("recording"): {by: Read(restored(text, None), seconds) for by, (text, seconds) in row.items()}
        for row in rows
    }


def vehicles_of(folder: Path) -> list[list[Recording]]:
    """The recordings that have been read, by vehicle and in order."""
    truth = {row["recording"]: row for row in pl.read_csv(folder / "truth.csv", infer_schema_length=None).to_dicts()}
    readings = stored(folder)
    by_vehicle: dict[str, list[Recording]] = {}
    for job in jobs_of(folder):
        if job.recording in readings:
            row = Recording(job, truth[job.recording], readings[job.recording])
            by_vehicle.setdefault(job.vehicle, []).append(row)
    return list(by_vehicle.values())


def followed(recordings: Sequence[Recording], way: str) -> Life:
    """The wear of a vehicle as `track --by` follows it, from the readings that are kept."""
    reads = {row.job.recording: row.by["first" if way == "auto" else way] for row in recordings}
    seconds = sum(read.seconds for read in reads.values())
    estimated = {row.job.recording: row.by["estimate"] for row in recordings}
    count = 0
    while True:
        readings = [reads[row.job.recording].reading for row in recordings]
        wear = wear_of("", [row.job for row in recordings], readings, LifeLimits())
        again = to_estimate(wear) if way == "auto" else ()
        if not again:
            return Life(wear, recordings, seconds, count)
        reads |= {job.recording: estimated[job.recording] for job in again}
        seconds += sum(estimated[job.recording].seconds for job in again)
        count += len(again)


def shared(recordings: Sequence[Recording], by: str) -> FloatArray | None:
    """Of shift and load, in standard deviations: constant error, error in 10 K, and rms of what is left, (2, 3)."""
    rows = [(row.by[by].reading.measurement, row.truth) for row in recordings]
    read = [(now, truth) for now, truth in rows if now is not None]
    if len(read) < 5:
        return None
    warmer = (np.array([now.temperature for now, _ in read]) - REFERENCE) / 10.0
    basis, table = np.column_stack([np.ones_like(warmer), warmer - warmer.mean()]), []
    for errors in np.transpose([errors_of(now, truth) for now, truth in read]):
        weights, *_ = np.linalg.lstsq(basis, errors, rcond=None)
        table.append([*weights, rms(errors - basis @ weights)])
    return np.array(table)


def errors_of(now: Any, truth: Mapping[str, Any]) -> tuple[float, float]:
    """Errors of shift and load of a measurement in its standard deviations."""
    shift, load = now.shift - 1e-3 * truth["shift [mm]"], now.load - truth["load change [1]"]
    return shift / now.shift_std, load / now.load_std


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def print_shared(vehicles: Sequence[Sequence[Recording]]) -> None:
    """What the errors of the readings of a vehicle share, rms over the vehicles."""
    print("rms over vehicles, in standard deviations: constant, 10 K, left; shift, load")
    for by in ("observe", "estimate"):
        for name, group in groups(vehicles).items():
            tables = [table for recordings in group if (table := shared(recordings, by)) is not None]
            if tables:
                values = np.sqrt(np.mean(np.square(tables), axis=0))
                words = "   ".join(" ".join(f"{value:.2f}" for value in row) for row in values)
                print(f"{by:9} {name:18} {len(tables):3} vehicles  {words}")


def groups(vehicles: Sequence[Sequence[Recording]]) -> dict[str, list[Sequence[Recording]]]:
    """All vehicles, those that record the supply pressure, and those that do not."""
    recorded = [rows for rows in vehicles if rows[0].truth["supply_recorded"] in (True, "True", "true")]
    others = [rows for rows in vehicles if rows not in recorded]
    return {"all": list(vehicles), "supply recorded": recorded, "not recorded": others}


class Counts(NamedTuple):
    """Events, those found and those found as another kind, and alarms of nothing."""

    events: int
    detected: int
    other: int
    false: int


def counted(life: Life) -> Counts:
    """The events of a life against its alarms, each alarm for one event at most."""
    place = {row.job.recording: k for k, row in enumerate(life.recordings)}
    at = [(place[alarm.before], alarm.kind) for alarm in life.wear.alarms]
    events = [(k, row.truth["event"]) for k, row in enumerate(life.recordings) if row.truth["event"]]
    named = set[int]()
    detected = other = 0
    for k, event in events:
        kinds, patience = ALARMS[event]
        own = {i for i, (j, kind) in enumerate(at) if k <= j <= k + patience and kind in kinds}
        near = {i for i, (j, _) in enumerate(at) if k <= j <= k + 1}
        detected += bool(own)
        other += not own and bool(near)
        named |= own or near
    return Counts(len(events), detected, other, len(at) - len(named))


def print_ways(vehicles: Sequence[Sequence[Recording]]) -> None:
    """The table of the three ways."""
    print("way, vehicles: s/recording, estimated (in the second pass); measured, |shift| median 95 %, in 95 %; load, "
          "in 95 %; trend |shift| median 95 %, in band; events/detected/as another kind/false")  # fmt: skip
    for name, group in groups(vehicles).items():
        for way in WAYS:
            lives = [followed(recordings, way) for recordings in group]
            if lives:
                print(f"{way:9} {name:18} {row_of(lives)}")


def row_of(lives: Sequence[Life]) -> str:
    """A row of the table."""
    readings = [(reading, row.truth) for life in lives for reading, row in in_order(life)]
    measured = [(reading.measurement, truth) for reading, truth in readings if reading.measurement is not None]
    shift = np.array([1e3 * now.shift - truth["shift [mm]"] for now, truth in measured])
    load = np.array([100 * (now.load - truth["load change [1]"]) for now, truth in measured])
    inside = np.abs([errors_of(now, truth) for now, truth in measured]) <= 1.96
    trend, covered = np.concatenate([trend_of(life) for life in lives], axis=1)
    counts = np.sum([counted(life) for life in lives], axis=0)
    estimated = np.mean([reading.by == "estimate" for reading, _ in readings])
    seconds, again = sum(life.seconds for life in lives) / len(readings), sum(life.again for life in lives)
    of_shift, of_load = 100 * inside.mean(axis=0)
    return (
        f"{len(lives):3}: {seconds:5.2f} s, {100 * estimated:3.0f} % ({again}); "
        f"{100 * len(measured) / len(readings):3.0f} %, "
        f"{wide(shift, 3)} mm, {of_shift:.0f} %; {wide(load, 2)} %, {of_load:.0f} %; "
        f"{wide(trend, 3)} mm, {100 * covered.mean():.0f} %; " + "/".join(map(str, counts))
    )


def wide(errors: FloatArray, digits: int) -> str:
    """Median and 95 % quantile of the size of errors."""
    return " ".join(f"{value:.{digits}f}" for value in np.quantile(np.abs(errors), (0.5, 0.95)))


def in_order(life: Life) -> list[tuple[WearReading, Recording]]:
    """The final readings of a life with their recordings."""
    by_name = {row.job.recording: row for row in life.recordings}
    return [(row.reading, by_name[row.job.recording]) for row in life.wear.rows]


def trend_of(life: Life) -> FloatArray:
    """Error of the trend's shift in mm as known at each recording, and whether its band holds the truth, (2, n)."""
    by_name, band = {row.job.recording: row.truth for row in life.recordings}, life.wear.then["shift"]
    true = np.array([1e-3 * by_name[job.recording]["shift [mm]"] for job in life.wear.dated])
    return np.array([1e3 * (band.value - true), (band.low <= true) & (true <= band.high)])


def main() -> None:
    """Make, read and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--family", default="A")
    for name, usual in (("vehicles", 10), ("types", 3), ("seed", 70)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    for name, share in (("months", 24.0), ("days", 90.0), ("no-supply", 0.5), ("spread", 0.1)):
        parser.add_argument(f"--{name}", type=float, default=share)
    parser.add_argument("--by-chance", action="store_true", help="events by chance, not one a vehicle")
    parser.add_argument("--print", action="store_true", help="only print the tables of what has been read")
    options = parser.parse_args()
    if not options.print:
        make(options.folder, options)
        store(options.folder)
    vehicles = vehicles_of(options.folder)
    print_shared(vehicles)
    print_ways(vehicles)


if __name__ == "__main__":
    main()
