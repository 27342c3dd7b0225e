"""Calibrations that lack a settled vented rest: ``python benchmarks/vented.py --family A --trucks 12 --seed 3400``.

Every truck is calibrated with pressure from recordings that begin 0, 5 and 15 s after the logger should have been
started, from one and from two of them, and its worn clutch is read with each calibration from position alone, in other
weather. The error of the load is the mean over 5 to 8 mm in % of the peak, with its sign; covered is the share of the
points from 0.5 to 20 mm in the 95 % band, width the median of the band in % of the peak; trust counts good / with care
/ none; ``P_0`` is the error of the calibrated ambient pressure against what the sensor shows when it is vented, in kPa.

A drive is made once and kept in ``--folder``, and a result is a line of ``--folder``/FAMILY.jsonl as soon as it is
there: what is there is not made again, so that a run can be stopped, by ``--seconds`` too. Trucks come one after the
other, the longest work first. With ``--out`` the tables of all lines in the folder are written to a file.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from clutchid import Fit, FitRequest, fit
from clutchid.errors import ClutchidError
from clutchid.log import Log
from clutchid.truck import GRID, Drive, drive, truck

SECONDS = 30.0

#: Begin of the calibration recordings in s, and their number; the longest work first.
STARTS, RECORDINGS = (0, 5, 15), (2, 1)

#: Wear of the facing in m when it is read, and strokes for a metre of wear.
WEAR, STROKES = 1.5e-3, 3e8

#: Standard deviation in Pa of the weather between calibration and reading.
WEATHER = 1.2e3

TRUSTS = ("good", "with care", "none")
TITLES = ("error [%]", "rms [%]", "worst [%]", "covered [%]", "width [%]", "trust")

#: Ends what one process computes with several threads.
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "POLARS_MAX_THREADS")


class Job(NamedTuple):
    """A calibration of a truck from so many recordings that begin at `start` s, and a reading with it."""

    family: str
    number: int
    start: int
    recordings: int

    @property
    def name(self) -> str:
        """Key of its results."""
        return f"{self.family}{self.number}-{self.start}-{self.recordings}"


def drives(family: str, number: int, folder: Path) -> dict[str, Drive]:
    """Two calibration recordings and one of the worn clutch, driven once and kept."""
    path = folder / f"{family}{number}.drives"
    if path.exists():
        with path.open("rb") as file:
            logs, truths = pickle.load(file)
        return {name: (Log(*log), truth) for (name, log), truth in zip(logs.items(), truths, strict=True)}
    kind = truck(number, family)
    random = np.random.default_rng([number, 49])
    first, second, third = random.integers(0, 2**31, 3).tolist()
    weather = kind.replace({"P_0": kind.P_0 + WEATHER * float(random.standard_normal())})
    made = {
        "calibration": drive(kind, seconds=SECONDS, seed=first, name="calibration"),
        "second": drive(kind, seconds=SECONDS, seed=second, name="second"),
        "worn": drive(
            weather, seconds=SECONDS, seed=third, wear=WEAR, cycles=WEAR * STROKES, pressure=False, name="worn"
        ),
    }
    logs = {name: (driven.log.time, dict(driven.log.columns), name) for name, driven in made.items()}
    truths = [driven.truth.load(GRID) for driven in made.values()]
    part = path.with_suffix(f".{os.getpid()}")
    with part.open("wb") as file:
        pickle.dump((logs, truths), file)
    part.rename(path)
    return {name: (Log(*log), truth) for (name, log), truth in zip(logs.items(), truths, strict=True)}


def errors(result: Fit, truth: np.ndarray) -> dict[str, Any]:
    """Error, coverage, width and trust of a load."""
    curve = result.load_curve
    force, low, high = (np.interp(GRID, curve.position, values) for values in (curve.force, curve.low, curve.high))
    peak, near = truth.max(), (GRID > 4.999e-3) & (GRID < 8.001e-3)
    return {
        "error": 100 * float(np.mean((force - truth)[near])) / peak,
        "rms": 100 * float(np.sqrt(np.mean((force - truth) ** 2))) / peak,
        "covered": 100 * float(np.mean((low <= truth) & (truth <= high))),
        "width": 100 * float(np.median(high - low)) / peak,
        "trust": result.verdict.trust,
    }


def result(job: Job, folder: Path) -> dict[str, Any]:
    """Errors of a calibration and of a reading with it, or why there is none."""
    begin, used = time.perf_counter(), time.process_time()
    made, kind = drives(job.family, job.number, folder), truck(job.number, job.family)
    row: dict[str, Any] = {"job": job.name, **job._asdict()}
    names = ("calibration", "second")[: job.recordings]
    logs = [made[name][0] for name in names]
    logs = [log.slice(round(1000 * job.start), len(log)) for log in logs]
    try:
        once = fit(logs, measure=("position", "pressure_a"), free=("auto",))
        row["calibration"] = errors(once, made["calibration"][1])
        row["P_0"] = once.actuator.parameters.P_0 - kind.P_0 - kind.e_p
        row["P_0_std"] = once.parameters["P_0"].std if "P_0" in once.parameters else None
        reading = fit(made["worn"][0], once.actuator, request=FitRequest(calibration=once.calibration))
        row["reading"] = errors(reading, made["worn"][1])
    except ClutchidError as error:
        row["failed"] = str(error)
    row |= {"seconds": time.perf_counter() - begin, "processor": time.process_time() - used}
    return row


def work(jobs: Sequence[Job], folder: Path, workers: int, budget: float) -> None:
    """Append the results of the jobs to the file of their family as they come, until the budget in s is spent."""
    until = time.perf_counter() + budget
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        trucks = dict.fromkeys((job.family, job.number) for job in jobs)
        for _ in pool.map(made, [(*item, folder) for item in trucks]):
            pass
        waiting, running = list(jobs), set()
        while waiting or running:
            while waiting and len(running) < workers and time.perf_counter() < until:
                running.add(pool.submit(result, waiting.pop(0), folder))
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for item in finished:
                row = item.result()
                with (folder / f"{row['family']}.jsonl").open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
                print(f"{row['job']}: {row['processor']:.0f} s of the processor", flush=True)
            if time.perf_counter() >= until:
                waiting = []


def made(item: tuple[str, int, Path]) -> None:
    """Drive a truck, for those jobs that need it."""
    drives(*item)


def rows_of(folder: Path, family: str) -> list[dict[str, Any]]:
    """All results of a family that are there."""
    path = folder / f"{family}.jsonl"
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.exists() else []


def cells(rows: Sequence[dict[str, Any]], what: str) -> list[str]:
    """Cells of a table over trucks."""
    read = [row[what] for row in rows if what in row]
    if not read:
        return ["-"] * len(TITLES)
    error, rms, covered, width = (
        np.array([reading[key] for reading in read]) for key in ("error", "rms", "covered", "width")
    )
    trust = " / ".join(str(sum(reading["trust"] == grade for reading in read)) for grade in TRUSTS)
    return [
        f"{np.mean(error):+.2f}", f"{np.median(rms):.2f}", f"{error[np.argmax(np.abs(error))]:+.2f}",
        f"{np.mean(covered):.0f}", f"{np.median(width):.1f}", trust,
    ]  # fmt: skip


def table(rows: Sequence[dict[str, Any]], family: str) -> list[str]:
    """The table of a family."""
    head = ["start [s]", "recordings", "trucks", "failed", "P_0 rms, worst [kPa]"]
    lines = [f"| family {family}: {' | '.join([*head, *TITLES, *TITLES])} |"]
    lines += ["|" + "---|" * (len(head) + 2 * len(TITLES))]
    for count in sorted(RECORDINGS):
        for start in STARTS:
            part = [row for row in rows if (row["start"], row["recordings"]) == (start, count)]
            pressures = np.array([row["P_0"] for row in part if "P_0" in row]) * 1e-3
            if not pressures.size:
                continue
            worst = pressures[np.argmax(np.abs(pressures))]
            of_rest = f"{np.sqrt(np.mean(pressures**2)):.2f}, {worst:+.2f}"
            failed = sum("failed" in row for row in part)
            row = [str(start), str(count), str(len(part)), str(failed), of_rest]
            lines.append(f"| {' | '.join([*row, *cells(part, 'calibration'), *cells(part, 'reading')])} |")
    return lines


def main() -> None:
    """Make what is missing, and print the tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", help="A, B or A,B")
    options.add_argument("--trucks", type=int, default=12)
    options.add_argument("--seed", type=int, default=3400)
    options.add_argument("--workers", type=int, default=1)
    options.add_argument("--folder", type=Path, default=Path("vented"), help="drives and results, kept")
    options.add_argument("--seconds", type=float, default=float("inf"), help="begin no more work after that time")
    options.add_argument("--out", type=Path, help="file for the tables")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(ONE_THREAD, "1")
    chosen.folder.mkdir(parents=True, exist_ok=True)
    families = chosen.family.split(",")
    there = {row["job"] for family in families for row in rows_of(chosen.folder, family)}
    jobs = [
        Job(family, number, start, count)
        for number in range(chosen.seed, chosen.seed + chosen.trucks)
        for count in RECORDINGS
        for family in reversed(families)
        for start in STARTS
    ]
    work([job for job in jobs if job.name not in there], chosen.folder, chosen.workers, chosen.seconds)
    lines = [line for family in families for line in (*table(rows_of(chosen.folder, family), family), "")]
    print("\n".join(lines))
    if chosen.out:
        chosen.out.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
