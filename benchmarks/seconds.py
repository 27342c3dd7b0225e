"""Seconds that calibrations and estimates take on an idle machine: ``python benchmarks/seconds.py --trucks 8``.

Each truck of the proving ground is calibrated from a recording with pressure; its worn clutch is then read from position
alone, unchanged and under each change of `clutchid.truck.CHANGES`. One process, one truck after the other, after a first
calibration that is not counted. Median / worst over trucks and changes.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from widening import calibrated, worn_clutch

from clutchid import fit
from clutchid.truck import CHANGES

#: Columns that the recordings lack.
CONDITIONS = ("temperature_ambient", "pressure_supply")

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[float, T]:
    """Seconds of a piece of work, and its result."""
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def row(family: str, numbers: Sequence[int]) -> str:
    """Calibrations, estimates of unchanged and of changed trucks of a family."""
    seconds: dict[str, list[float]] = {"calibration": [], "unchanged": [], "changed": []}
    for number in numbers:
        took, once = timed(lambda number=number: calibrated(number, family, CONDITIONS, "shooting"))
        seconds["calibration"].append(took)
        for case in ("nothing", *CHANGES):
            log = worn_clutch(number, family, case).log.without(*CONDITIONS)
            took, _ = timed(lambda log=log, once=once: fit(log, once.actuator, calibration=once.calibration))
            seconds["unchanged" if case == "nothing" else "changed"].append(took)
    cells = " | ".join(f"{statistics.median(each):.1f} / {max(each):.1f}" for each in seconds.values())
    return f"| {family} | {cells} |"


def main() -> None:
    """Print a row a family."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    calibrated(chosen.seed, "A", CONDITIONS, "shooting")
    print("| family | calibration [s] | estimate, unchanged [s] | changed [s] |\n|---|---|---|---|")
    for family in ("A", "B"):
        print(row(family, range(chosen.seed, chosen.seed + chosen.trucks)), flush=True)


if __name__ == "__main__":
    main()
