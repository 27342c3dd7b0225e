"""Throughput of `clutchid fleet`: recordings by number and workers, memory of workers, and empty work.

    python benchmarks/fleet.py --recordings 10,100 --workers 1,2
    python benchmarks/fleet.py --empty 100000 --workers 2

One recording of a virtual truck stands for all: 30 s at 1 kHz, worn by 1.5 mm, position only. The time to start the
workers counts. Memory is that of this process, and of its largest worker, at the end of each fifth of the work.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil

import clutchid
from clutchid.fleets.cluster import Workers, results
from clutchid.fleets.jobs import fleet_of, with_dependencies
from clutchid.fleets.plan import read_all
from clutchid.fleets.store import run_store
from clutchid.truck import drive, truck
from clutchid.verbs.reading import Reading
from clutchid.verbs.wear_reading import read_recording


class Memory(NamedTuple):
    """Resident memory in MB: of this process, and of the largest worker."""

    this: float
    worker: float


def memory() -> Memory:
    """What this process and its workers hold."""
    process = psutil.Process()
    workers = [child.memory_info().rss for child in process.children(recursive=True)]
    return Memory(process.memory_info().rss / 1e6, max(workers, default=0) / 1e6)


def timed(count: int, work: Callable[[Callable[[int, int], None]], None]) -> tuple[float, list[Memory]]:
    """Time in s of `count` items, and the memory after each fifth of them."""
    seen: list[Memory] = []

    def progress(number: int, _all: int) -> None:
        if number * 5 // count > (number - 1) * 5 // count:
            seen.append(memory())

    begin = time.perf_counter()
    work(progress)
    return time.perf_counter() - begin, seen


def recordings(folder: Path, family: str, count: int) -> tuple[Path, Path]:
    """A folder with so many recordings, and their calibration."""
    new = drive(truck(0, family), seconds=30, seed=1, name="cal").log
    calibration = folder / "cal.toml"
    if not calibration.exists():
        fit = clutchid.fit(new, measure=("position", "pressure_a"), free=("auto",))
        clutchid.write_parameters(clutchid.parameter_file(fit), calibration)
    worn = drive(truck(0, family), seconds=30, seed=2, wear=1.5e-3, pressure=False).log
    source = folder / f"of{count}"
    (source / "V1").mkdir(parents=True)
    clutchid.write(worn, source / "V1" / "r0.parquet")
    for k in range(1, count):
        shutil.copyfile(source / "V1" / "r0.parquet", source / "V1" / f"r{k}.parquet")
    return source, calibration


def measure(folder: Path, family: str, count: int, workers: Sequence[int]) -> None:
    """Print throughput and memory over the numbers of workers."""
    source, calibration = recordings(folder, family, count)
    fleet = fleet_of(source, calibration)
    alone = 0.0
    for number in workers:
        out = folder / f"out{count}-{number}"
        with run_store(out, {}) as results:
            todo = with_dependencies(fleet, Reading(), "fit").jobs
            wall, seen = timed(
                count, partial(read_all, Workers(number), partial(read_recording, Reading(), "fit"), todo, {}, results)
            )
            seconds = [json.loads(row.timing)[0] for row in results.pending()]
        alone = alone or wall * number
        print(
            f"{count:6,} recordings, {number} workers: {wall:7.1f} s, {count / wall:6.2f} a second, "
            f"{1e3 * (wall * number - sum(seconds)) / count:6.1f} ms beside the reading of {np.median(seconds):.2f} s, "
            f"{alone / wall:.2f} times one worker; "
            f"memory {' '.join(f'{m.this:.0f}/{m.worker:.0f}' for m in seen)} MB",
            flush=True,
        )


def counted(workers: Workers, count: int, progress: Callable[[int, int], None]) -> None:
    """Do empty work, and count it."""
    for k, _ in enumerate(results(abs, range(count), workers), start=1):
        progress(k, count)


def empty(count: int, workers: Sequence[int]) -> None:
    """Print the time that empty work takes."""
    for number in workers:
        wall, seen = timed(count, partial(counted, Workers(number), count))
        print(
            f"{count:,} empty tasks, {number} workers: {wall:.0f} s, {1e3 * wall / count:.2f} ms each; "
            f"memory {' '.join(f'{m.this:.0f}/{m.worker:.0f}' for m in seen)} MB",
            flush=True,
        )


def main() -> None:
    """Measure what the options say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", default="10,100")
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--family", default="A")
    parser.add_argument("--empty", type=int, default=0)
    options = parser.parse_args()
    workers = [int(number) for number in options.workers.split(",")]
    if options.empty:
        empty(options.empty, workers)
        return
    with tempfile.TemporaryDirectory() as folder:
        for count in options.recordings.split(","):
            measure(Path(folder), options.family, int(count), workers)


if __name__ == "__main__":
    main()
