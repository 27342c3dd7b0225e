"""Seconds that calibrations and estimates take on an idle machine: ``python benchmarks/seconds.py --trucks 8``.

Each truck of the proving ground is calibrated from a recording with pressure; its worn clutch is then read from
position alone, unchanged and under each change of `clutchid.truck.CHANGES`. One process, one truck after the other,
after a first calibration that is not counted. Median / worst over trucks and changes by the clock, and the median of
the processor's time of all threads, which hardly depends on what else the machine does.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from widening import calibrated, worn_clutch

from clutchid import FitRequest, fit
from clutchid.truck import CHANGES

#: Columns that the recordings lack.
CONDITIONS = ("temperature_ambient", "pressure_supply")

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[tuple[float, float], T]:
    """Seconds of a piece of work by the clock and of the processor, and its result."""
    begin, used = time.perf_counter(), time.process_time()
    result = work()
    return (time.perf_counter() - begin, time.process_time() - used), result


def row(family: str, numbers: Sequence[int]) -> str:
    """Calibrations, estimates of unchanged and of changed trucks of a family."""
    seconds: dict[str, list[tuple[float, float]]] = {"calibration": [], "unchanged": [], "changed": []}
    for number in numbers:
        took, once = timed(lambda number=number: calibrated(number, family, CONDITIONS, "shooting"))
        seconds["calibration"].append(took)
        for case in ("nothing", *CHANGES):
            log = worn_clutch(number, family, case).log.without(*CONDITIONS)
            took, _ = timed(
                lambda log=log, once=once: fit(log, once.actuator, request=FitRequest(calibration=once.calibration))
            )
            seconds["unchanged" if case == "nothing" else "changed"].append(took)
    return f"| {family} | {' | '.join(map(cell, seconds.values()))} |"


def cell(seconds: Sequence[tuple[float, float]]) -> str:
    """Median / worst by the clock, and the median of the processor."""
    clock, processor = zip(*seconds, strict=True)
    return f"{statistics.median(clock):.1f} / {max(clock):.1f}; {statistics.median(processor):.1f}"


def main() -> None:
    """Print a row a family."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--families", default="A,B")
    chosen = options.parse_args()
    calibrated(chosen.seed, "A", CONDITIONS, "shooting")
    print("| family | calibration [s] | estimate, unchanged [s] | changed [s] |\n|---|---|---|---|")
    for family in chosen.families.split(","):
        print(row(family, range(chosen.seed, chosen.seed + chosen.trucks)), flush=True)


if __name__ == "__main__":
    main()
