"""Processor time of reading a file: ``python benchmarks/files.py [--ref COMMIT] [--rounds 5] [FORMAT ...]``.

A recording of 5 columns is written as CSV, MDF 4, Parquet and MATLAB 5, of a few 100 kB and of more than 10 MB. It is
read in a new process, whose time includes that of its guarded reader: once, with all imports, and then again. With
`--ref` the package of a commit reads the same files, by turns; printed are the least times of all rounds in ms.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from clutchid.log import Log
from clutchid.measurements import write

ROOT = Path(__file__).resolve().parents[1]

FORMATS = {"csv": ".csv", "mdf": ".mf4", "parquet": ".parquet", "mat": ".mat"}

#: Samples of the small and of the large recording.
SIZES = (10_000, 400_000)

CODE = """
import os, sys, time
from pathlib import Path
def spent():
    total, ticks = time.process_time(), os.sysconf("SC_CLK_TCK")
    for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        total += sum(map(int, Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[11:13])) / ticks
    return total
from clutchid.measurements import read
times = [spent()]
for _ in range(4):
    read(sys.argv[1])
    times.append(spent())
first, *others = [after - before for before, after in zip(times, times[1:])]
print(first, min(others))
"""


def recording(samples: int) -> Log:
    """Strokes at 1 kHz, with a chamber pressure."""
    time = np.arange(samples) / 1000
    random = np.random.default_rng(0)
    columns = {
        "position": 0.01 + 0.008 * np.sin(time) + 1e-6 * random.standard_normal(samples),
        "duty_supply": (time % 2 < 0.7).astype(float),
        "duty_exhaust": (time % 2 > 1.3).astype(float),
        "pressure_a": 3e5 + 1e5 * np.cos(time) + 100 * random.standard_normal(samples),
    }
    return Log(time, {name: np.round(values, 9) for name, values in columns.items()})


def times(package: Path, file: Path) -> tuple[float, float]:
    """Processor time in ms of the first reading in a process, and the least of the others."""
    environment = os.environ | {"PYTHONPATH": str(package), "OPENBLAS_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1"}
    command = [sys.executable, "-c", CODE, str(file)]
    first, again = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()
    return 1e3 * float(first), 1e3 * float(again)


def main() -> None:
    """Write the files, read them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", default=list(FORMATS))
    parser.add_argument("--ref")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        packages = {"now": ROOT / "src"}
        if asked.ref:
            packages = {asked.ref: Path(folder) / "src", **packages}
            archive = subprocess.run(
                ["git", "archive", asked.ref, "src"], cwd=ROOT, capture_output=True, check=True
            ).stdout
            subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
        print("| format | MB | " + " | ".join(f"{name}: first, again [ms]" for name in packages) + " |")
        print("|---" * (2 + len(packages)) + "|")
        for name in asked.formats:
            for samples in SIZES:
                file = Path(folder) / f"run{FORMATS[name]}"
                write(recording(samples), file)
                rounds = [[times(package, file) for package in packages.values()] for _ in range(asked.rounds)]
                least = np.min(rounds, axis=0)
                cells = " | ".join(f"{first:.0f}, {again:.0f}" for first, again in least)
                print(f"| {name} | {file.stat().st_size / 1e6:.1f} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
