"""A virtual drive against real time, warm, in one process: ``python benchmarks/truck.py``.

Medians over rounds and truck types, for the compiled loop alone and for the whole of `drive` (course, noise, loop,
truth). ``--cold`` also times the first drive of a process whose cache is empty.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

from clutchid.truck import drive, truck
from clutchid.truck.running import run_truck
from clutchid.truck.settings import Course

FIRST = "from clutchid.truck import drive, truck; drive(truck(0), seconds=1)"


def timed(work: object) -> float:
    """Wall time of a call without arguments."""
    begin = time.perf_counter()
    work()  # type: ignore[operator]
    return time.perf_counter() - begin


def warm(seconds: float, rounds: int, trucks: int) -> None:
    """Print the median times and their ratio to real time."""
    whole, alone = [], []
    for number in range(trucks):
        chosen = truck(number)
        driven = drive(chosen, seconds=seconds, seed=number)
        n = driven.wanted.size
        course = Course(driven.wanted, np.full((n, 2), np.nan), np.zeros(n))
        whole += [timed(lambda t=chosen, s=number: drive(t, seconds=seconds, seed=s)) for _ in range(rounds)]
        alone += [timed(lambda t=chosen, c=course: run_truck(t, c)) for _ in range(rounds)]
    for name, times in (("loop alone", alone), ("whole drive", whole)):
        median, worst = statistics.median(times), max(times)
        print(
            f"{name:<12}{seconds:g} s of driving in {median * 1e3:.1f} ms (worst {worst * 1e3:.1f} ms):"
            f" {seconds / median:.0f} x real time (worst {seconds / worst:.0f} x)"
        )


def cold() -> None:
    """Print the time of a process that derives, prints and compiles, and of the next one."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "CLUTCHID_CACHE": folder}
        for name in ("cold process", "warm process"):
            command = [sys.executable, "-c", FIRST]
            print(f"{name}: {timed(lambda c=command: subprocess.run(c, check=True, env=environment)):.2f} s")


def main() -> None:
    """Run the chosen measurements."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=30.0)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--cold", action="store_true")
    chosen = options.parse_args()
    warm(chosen.seconds, chosen.rounds, chosen.trucks)
    if chosen.cold:
        cold()


if __name__ == "__main__":
    main()
