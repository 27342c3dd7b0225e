"""What a first start costs: ``python benchmarks/startup.py [--repeat N]``.

Whole processes on the bundled recording, each first with an empty cache and then with the cache that it left: a plain
`clutchid fit` (position, three weights) and a first calibration (`--free auto`). Printed are both times, what the first
takes more, and the same of the processor time, which a busy machine changes less. The texts of the standard models lie
in the wheel, so measure with the wheel installed; a tree of sources derives them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import clutchid

#: What more than warm a first start may take, in s.
COMMANDS = {
    "plain fit": ((), 4.0),
    "calibration": (("--measure", "position,pressure_a", "--free", "auto"), 10.0),
}


def seconds(arguments: tuple[str, ...], cache: Path) -> tuple[float, float]:
    """Wall and processor time in s of `clutchid fit` as a process of its own."""
    recording = Path(clutchid.__file__).parent / "study/paper/data/truck1_calibration.csv"
    command = [sys.executable, "-m", "clutchid", "fit", str(recording), *arguments]
    begin, used = time.perf_counter(), _processor()
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "CLUTCHID_CACHE": str(cache)})
    return time.perf_counter() - begin, _processor() - used


def _processor() -> float:
    """Processor time in s of the processes that this one has waited for."""
    times = os.times()
    return times.children_user + times.children_system


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=1)
    rounds = parser.parse_args().repeat
    times = f"{'warm':>8} {'more':>8}"
    print(f"{'command':<14} {'empty cache':>12} {times} {'target':>8} {'processor':>12} {times}")
    for _ in range(rounds):
        for name, (arguments, target) in COMMANDS.items():
            with tempfile.TemporaryDirectory() as folder:
                cold, warm = (seconds(arguments, Path(folder) / "cache") for _ in range(2))
            (wall, cpu), (wall_warm, cpu_warm) = cold, warm
            print(
                f"{name:<14} {wall:>10.1f} s {wall_warm:>6.1f} s {wall - wall_warm:>6.1f} s {target:>6.1f} s "
                f"{cpu:>10.1f} s {cpu_warm:>6.1f} s {cpu - cpu_warm:>6.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
