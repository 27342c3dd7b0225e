"""A warm ``clutchid fit`` of a 30 s log as a whole process: ``python benchmarks/process.py``.

It is paired with a process that only imports SciPy's optimisers and Numba.

With ``--hour`` also time and peak memory of a fit of a one-hour log (3.6 million samples, three thetas).
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import clutchid

EXAMPLE = Path(clutchid.__file__).parent / "study/data/truck1_calibration.csv"
IMPORTS = [sys.executable, "-c", "import scipy.optimize, numba"]


def seconds(command: list[str]) -> float:
    """Wall time of one process."""
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - begin


def warm(rounds: int) -> None:
    """Print the median times of the two processes and their ratio, run in turn."""
    fit = [sys.executable, "-m", "clutchid", "fit", str(EXAMPLE)]
    seconds(fit), seconds(IMPORTS)
    pairs = [(seconds(fit), seconds(IMPORTS)) for _ in range(rounds)]
    ratios = sorted(a / b for a, b in pairs)
    print(f"clutchid fit, 30 s log, whole process: {statistics.median(a for a, _ in pairs):.3f} s")
    print(f"import scipy.optimize, numba:          {statistics.median(b for _, b in pairs):.3f} s")
    print(f"ratio {statistics.median(ratios):.2f} (from {ratios[0]:.2f} to {ratios[-1]:.2f} over {rounds} rounds)")


def hour() -> None:
    """Fit a one-hour log in a process of its own and print its time and peak memory."""
    example = clutchid.read(EXAMPLE)
    times = 120
    n = len(example)
    columns = {name: np.tile(example[name], times) for name in ("position", "duty_supply", "duty_exhaust")}
    long = clutchid.Log(np.arange(n * times) * 1e-3, columns)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hour.parquet"
        clutchid.write(long, path)
        elapsed = seconds([sys.executable, "-m", "clutchid", "fit", str(path)])
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024**2
    print(f"one-hour log, {n * times:,} samples, three thetas: {elapsed:.1f} s, peak memory {peak:.2f} GiB")


def main() -> None:
    """Run the chosen measurements."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--rounds", type=int, default=9)
    options.add_argument("--hour", action="store_true")
    chosen = options.parse_args()
    warm(chosen.rounds)
    if chosen.hour:
        hour()


if __name__ == "__main__":
    main()
