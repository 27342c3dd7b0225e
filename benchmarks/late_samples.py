"""Accuracy where samples are lost: ``python benchmarks/late_samples.py --calibrations FOLDER [--draws 3]``.

Trucks are calibrated once on 30 s with pressure and the conditions; a clutch worn by 2 mm is then observed over 30 s by
the method `joint`, whole and with samples that are lost. A line a case: error of the load over 5 to 8 mm, rms in % of
the peak, mean and worst of all trucks and draws; points of the load over 0.5 to 20 mm in its band, mean and least.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from online import calibrated

from clutchid.log import Log
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.configuration import observer
from clutchid.observer.run import observe_recording
from clutchid.truck import GRID, drive, truck

TRUCKS = "A0,A1,A2,B0,B1,B3"

#: Cases: length of a loss in samples, from and to, and how often: a period in samples, or a share of the samples.
CASES = {
    "nothing": None, "6 of 100": (6, 6, 100), "1 to 5, at 2 %": (1, 5, 0.02), "1 to 5, at 10 %": (1, 5, 0.1),
    "20 ms of each 200": (19, 19, 200), "50 ms of each 1000": (50, 50, 1000), "50 ms of each 330": (50, 50, 330),
    "30 to 80, at 0.2 %": (30, 80, 0.002), "30 to 80, at 2 %": (30, 80, 0.02),
}  # fmt: skip


def losses(case: tuple[int, int, float] | None, log: Log, seed: int) -> Iterator[tuple[int, int]]:
    """First and last sample, exclusive, of each loss."""
    if case is None:
        return
    shortest, longest, often = case
    rng, at = np.random.default_rng(seed), 50
    while at < len(log) - 30:
        at += int(rng.geometric(often)) if often < 1.0 else 0
        length = int(rng.integers(shortest, longest + 1))
        yield at, at + length
        at += length + 1 if often < 1.0 else int(often)


def without(log: Log, lost: Iterator[tuple[int, int]]) -> Log:
    """A recording without the samples that are lost."""
    used = np.ones(len(log), dtype=bool)
    for first, last in lost:
        used[first:last] = False
    return Log(log.time[used], {name: values[used] for name, values in log.columns.items()}, log.name, log.metadata)


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    options.add_argument("--trucks", default=TRUCKS)
    options.add_argument("--draws", type=int, default=3)
    chosen = options.parse_args()
    rows: dict[str, list[tuple[float, float]]] = {name: [] for name in CASES}
    touch, band = (GRID >= 5e-3) & (GRID <= 8e-3), (GRID >= 0.5e-3) & (GRID <= 20e-3)
    for name in chosen.trucks.split(","):
        kind = truck(int(name[1:]), name[0])
        content = calibrated(kind, 1, chosen.calibrations / f"{name}_seed1.toml", conditions=True)
        worn = drive(kind, seconds=30.0, seed=2, wear=2e-3, conditions=True, pressure=False)
        followed, truth = observer(content.actuator, "joint", calibration=content.calibration), worn.truth.load(GRID)
        for case, how in CASES.items():
            drawn = how is not None and how[2] < 1.0
            for draw in range(chosen.draws if drawn else 1):
                run = observe_recording(followed, without(worn.log, losses(how, worn.log, draw)))
                off = followed.load(run.after).force(GRID) - truth
                inside = np.abs(off) <= QUANTILE * followed.load_deviation(run.after, GRID)
                error = 100.0 * float(np.sqrt(np.mean(off[touch] ** 2)) / truth.max())
                rows[case].append((error, 100.0 * float(np.mean(inside[band]))))
    print("| lost | error, mean / worst [%] | points in the band, mean / least [%] |\n|---|---|---|")
    for case, values in rows.items():
        errors, points = np.array(values).T
        print(f"| {case} | {errors.mean():.2f} / {errors.max():.2f} | {points.mean():.0f} / {points.min():.0f} |")


if __name__ == "__main__":
    main()
