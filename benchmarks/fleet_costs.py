"""Cost of a run of `clutchid fleet --verb track` beside the reading itself, by what is stored and what is new.

Usage: python benchmarks/fleet_costs.py [--recordings 100,10000,100000] [--new 0,10]
       python benchmarks/fleet_costs.py --events 1000 [--at s3://bucket/fleet]

Vehicles have 50 recordings, whose readings are drawn; files are empty. Each run is a process of its own. The first one
of each table writes empty pages. With --events, parts of one row are written and taken into a new index, then folded:
in a folder, or at an address, such as that of `moto_server` (AWS_ENDPOINT_URL and so on in the environment).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from time import perf_counter

import numpy as np

import clutchid
from clutchid.estimation.assess.comparison import HalfLoad, Measurement
from clutchid.fleets import output, verbs
from clutchid.fleets.parts import adopt, append, write_once
from clutchid.fleets.storage import Folder, objects_at
from clutchid.fleets.store import StoredRow, run_store, stored_row
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.processes import Timing
from clutchid.wear.history import RecordingJob, WearReading

#: Recordings of a vehicle, and the first of their days.
EACH, FIRST = 50, datetime(2024, 1, 1, tzinfo=UTC)


def row_of(job: RecordingJob) -> StoredRow:
    """A row of the index with a drawn reading: a clutch that wears by 0.4 mm in its recordings."""
    rng = np.random.default_rng(abs(hash((job.vehicle, job.recording))) % 2**32)
    k = int(job.recording[1:])
    shift = 4e-4 * k / EACH + 3e-6 * rng.standard_normal()
    position = np.linspace(0.0, 0.025, 101)
    force = 5000.0 * np.tanh((position + shift) / 4e-3)
    reading = WearReading(
        "ok", "", "good", Measurement(shift, 3.5e-5, -40.0 * shift, 0.01, 293.0), sha256=f"{job.vehicle}{k}",
        half_load=HalfLoad(2e-3 - shift, 1.9e-3 - shift, 2.1e-3 - shift),
        curve=LoadCurve(position, force, force - 90.0, force + 90.0),
    )  # fmt: skip
    return stored_row(job, reading, Timing(1.5, 1.4, "host", 1, 1), datetime.now(UTC).isoformat())


def make(folder: Path, first: int, last: int) -> None:
    """Files and table rows of recordings by number; the numbers are dealt to vehicles in turn after the first ones."""
    rows = []
    for n in range(first, last):
        vehicle, k = f"V{n // EACH:05d}", n % EACH
        path = folder / "fleet" / vehicle / f"r{k:02d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        rows.append(f"r{k:02d},{vehicle},T1,{FIRST + timedelta(days=14 * k):%Y-%m-%d},{4000 * k}\n")
    table = folder / "fleet" / "recordings.csv"
    if not table.exists():
        table.write_text("recording,vehicle,type,date,strokes\n")
    with table.open("a") as lines:
        lines.writelines(rows)


def run(folder: Path, *, pages: bool) -> None:
    """One run, in which reading a recording costs nothing; without `pages` they are empty."""

    def read_all(_place, _read, todo, _keys, store, _progress):
        store.put(row_of(job) for job in todo)
        store.saved()

    verbs.read_all, verbs.content_of = read_all, lambda _: None  # an empty calibration will do
    if not pages:
        output.write_page = lambda _document, path: path.write_text("")
    begin = perf_counter()
    fleet = clutchid.fleet(folder / "fleet", folder / "cal.toml", folder / "out", verb="track", limit=5e-4)
    print(f"{fleet.read} {perf_counter() - begin:.2f}")


def measured(folder: Path, *, pages: bool) -> tuple[int, float]:
    """How many recordings a run in a new process reads, and its time in s without the start of the process."""
    command = [sys.executable, __file__, "--run", str(folder), *(["--pages"] if pages else [])]
    count, seconds = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-2:]
    return int(count), float(seconds)


def events(count: int, at: str) -> None:
    """Times to write parts of one row, to take them in, and to fold them."""
    with tempfile.TemporaryDirectory() as folder:
        storage = objects_at(at) or Folder(Path(folder) / "parts")
        jobs = [RecordingJob(f"r{n % EACH:02d}", f"V{n // EACH:05d}", "T1", FIRST + timedelta(days=14 * (n % EACH)))
                for n in range(count)]  # fmt: skip
        rows = [row_of(job) for job in jobs]
        with run_store(Path(folder) / "run", {}) as store:
            steps: dict[str, Callable[[], object]] = {
                "written": lambda: [write_once(row, storage) for row in rows],
                "taken in": lambda: adopt(store, storage), "folded": lambda: append(store, storage),
            }  # fmt: skip
            for step, work in steps.items():
                begin = perf_counter()
                work()
                print(f"{count:,} parts of one row {step} in {perf_counter() - begin:.1f} s", flush=True)
            assert len(store.keys()) == count


def main() -> None:
    """Print a table of costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", default="100,10000,100000")
    parser.add_argument("--new", default="0,10")
    parser.add_argument("--events", type=int, default=0)
    parser.add_argument("--at", default="")
    parser.add_argument("--run", type=Path)
    parser.add_argument("--pages", action="store_true")
    options = parser.parse_args()
    if options.run:
        return run(options.run, pages=options.pages)
    if options.events:
        return events(options.events, options.at)
    print("| stored | new | time [s] | index [MB] | parts |\n|---|---|---|---|---|")
    for count in map(int, options.recordings.split(",")):
        folder, stored = Path(tempfile.mkdtemp(prefix="clutchid-fleet-")), 0
        try:
            (folder / "cal.toml").write_text("[parameters]\n")
            for new in (count, *map(int, options.new.split(","))):
                make(folder, stored, stored + new)
                read, seconds = measured(folder, pages=stored > 0)
                assert read == new, (read, new)
                size = (folder / "out" / "run.sqlite").stat().st_size / 1e6
                parts = len(list((folder / "out" / "recordings").rglob("*.parquet")))
                print(f"| {stored:,} | {new:,} | {seconds:.2f} | {size:.1f} | {parts} |", flush=True)
                stored += new
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    return None


if __name__ == "__main__":
    main()
