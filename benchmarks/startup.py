"""What a first start costs: ``python benchmarks/startup.py [--repeat N]``.

Whole processes on the bundled recording, each first with an empty cache and then with the cache that it left: a plain
`clutchid fit` (position, three weights) and a first calibration (`--free auto`). Printed are both times and what the
first takes more; the machine should be idle.
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
    "plain fit": ((), 6.0),
    "calibration": (("--measure", "position,pressure_a", "--free", "auto"), 20.0),
}


def seconds(arguments: tuple[str, ...], cache: Path) -> float:
    """Wall time in s of `clutchid fit` as a process of its own."""
    recording = Path(clutchid.__file__).parent / "study/paper/data/truck1_calibration.csv"
    command = [sys.executable, "-m", "clutchid", "fit", str(recording), *arguments]
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "CLUTCHID_CACHE": str(cache)})
    return time.perf_counter() - begin


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=1)
    rounds = parser.parse_args().repeat
    print(f"{'command':<14} {'empty cache':>12} {'warm':>8} {'more':>8} {'target':>8}")
    for _ in range(rounds):
        for name, (arguments, target) in COMMANDS.items():
            with tempfile.TemporaryDirectory() as folder:
                cold, warm = (seconds(arguments, Path(folder) / "cache") for _ in range(2))
            print(f"{name:<14} {cold:>10.1f} s {warm:>6.1f} s {cold - warm:>6.1f} s {target:>6.1f} s")


if __name__ == "__main__":
    main()
