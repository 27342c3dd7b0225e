"""What a first start costs: ``python benchmarks/startup.py [--repeat N] [--kernels]``.

Whole processes, each first with an empty cache and then with the cache that it left: a plain `clutchid fit` of the
bundled recording (position, three weights), its first calibration (`--free auto`), and a drive of a virtual truck.
With the cache of that drive, that of a truck of other parts follows, which compiles its plant alone. Printed are both
times, what the first takes more, and the same of the processor time, which a busy machine changes less. The texts of
the standard models lie in the wheel, so measure with the wheel installed; a tree of sources derives them. With
`--kernels`, how long Numba compiles each kernel of a first calibration, with and without those that it calls.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

from numba.core import event

import clutchid

_RECORDING = str(Path(clutchid.__file__).parent / "study/data/truck1_calibration.csv")

#: Commands, that whose cache they find at first, and what more than warm the first may take in s.
COMMANDS: dict[str, tuple[tuple[str, ...], str, float]] = {
    "plain fit": (("fit", _RECORDING), "", 4.0),
    "calibration": (("fit", _RECORDING, "--measure", "position,pressure_a", "--free", "auto"), "", 10.0),
    "drive": (("drive", "--truck", "0", "--seconds", "5", "--out", "log.csv"), "", 10.0),
    "other parts": (("drive", "--truck", "0", "--family", "B", "--seconds", "5", "--out", "log.csv"), "drive", 3.0),
}


def seconds(arguments: tuple[str, ...], cache: Path) -> tuple[float, float]:
    """Wall and processor time in s of a command as a process of its own."""
    command = [sys.executable, "-m", "clutchid", *arguments]
    begin, used = time.perf_counter(), _processor()
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "CLUTCHID_CACHE": str(cache)}
        subprocess.run(command, check=True, capture_output=True, env=environment, cwd=folder)
    return time.perf_counter() - begin, _processor() - used


def _processor() -> float:
    """Processor time in s of the processes that this one has waited for."""
    times = os.times()
    return times.children_user + times.children_system


class Compilations(event.Listener):
    """Times in s of the kernels that Numba compiles: `whole` with those that they call, `own` without."""

    def __init__(self) -> None:
        self.whole: defaultdict[str, float] = defaultdict(float)
        self.own: defaultdict[str, float] = defaultdict(float)
        self._open: list[tuple[str, float]] = []

    def on_start(self, begins: Any) -> None:
        """A kernel begins to be compiled."""
        self._open.append((begins.data["dispatcher"].py_func.__name__, time.perf_counter()))

    def on_end(self, _: Any) -> None:
        """A kernel is compiled; its time is none of that which called it."""
        name, begun = self._open.pop()
        taken = time.perf_counter() - begun
        self.whole[name] += taken
        self.own[name] += taken
        if self._open:
            self.own[self._open[-1][0]] -= taken


def by_kernel() -> None:
    """Print how long each kernel of a first calibration is compiled, the longest first."""
    compilations = Compilations()
    with tempfile.TemporaryDirectory() as cache, event.install_listener("numba:compile", compilations):
        os.environ["CLUTCHID_CACHE"] = cache
        clutchid.calibrate(clutchid.bundled_recording())
    print(f"{'kernel':<24} {'with callees':>12} {'own':>8}")
    for name in sorted(compilations.whole, key=compilations.whole.__getitem__, reverse=True):
        print(f"{name:<24} {compilations.whole[name]:>10.1f} s {compilations.own[name]:>6.1f} s")
    print(f"{'all':<24} {sum(compilations.own.values()):>21.1f} s")


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--kernels", action="store_true")
    chosen = parser.parse_args()
    if chosen.kernels:
        by_kernel()
        return
    rounds = chosen.repeat
    times = f"{'warm':>8} {'more':>8}"
    print(f"{'command':<14} {'empty cache':>12} {times} {'target':>8} {'processor':>12} {times}")
    for _ in range(rounds):
        for name, (arguments, before, target) in COMMANDS.items():
            with tempfile.TemporaryDirectory() as folder:
                cache = Path(folder) / "cache"
                if before:
                    seconds(COMMANDS[before][0], cache)
                cold, warm = (seconds(arguments, cache) for _ in range(2))
            (wall, cpu), (wall_warm, cpu_warm) = cold, warm
            print(
                f"{name:<14} {wall:>10.1f} s {wall_warm:>6.1f} s {wall - wall_warm:>6.1f} s {target:>6.1f} s "
                f"{cpu:>10.1f} s {cpu_warm:>6.1f} s {cpu - cpu_warm:>6.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
