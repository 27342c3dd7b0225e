"""Time and size of a calibration and an adaptation: ``python benchmarks/calibration.py [--repeat N]``.

A recording of 30 s at 1 kHz of the virtual truck, with pressure, and one of the same truck with a worn clutch, without.
The calibration frees 25 numbers (three splines), then all that ``--free auto`` frees; times are of a warm process. The
ratio is that of processor times, of all threads, to a plain fit of the worn recording by the paper's method; it hardly
depends on the machine and on what else it does.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

from clutchid import Actuator, Fit, FitRequest, fit
from clutchid.estimation.automatic import freed
from clutchid.truck import drive, truck

MODEL = Actuator(model="energy-balance-stribeck")
TWENTY_FIVE = (
    "load",
    *(n for n in freed(MODEL) if not MODEL.row(n).valves and n not in ("K_z", "D_zdot", "v_S")),
)


def main() -> None:
    """Print a row a fit."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--repeat", type=int, default=5)
    repeat = options.parse_args().repeat
    calibration = drive(truck(8), seconds=30, seed=1, name="calibration").log
    worn = drive(truck(8), seconds=30, seed=2, wear=1.5e-3, pressure=False, name="worn").log
    worn = replace(worn, metadata={})
    both = ("position", "pressure_a")
    paper = Actuator(model="energy-balance-stribeck").replace({"P_0": 1.05e5})
    once = fit(calibration, measure=both, free=("auto",))

    def few() -> Fit:
        return fit(calibration, paper, measure=both, free=TWENTY_FIVE, method="shooting")

    def automatic() -> Fit:
        return fit(calibration, measure=both, free=("auto",))

    def adaptation() -> Fit:
        return fit(worn, once.actuator, request=FitRequest(calibration=once.calibration))

    def plain() -> Fit:
        return fit(worn)

    rows = {"plain fit": plain, "calibration, splines": few, "calibration, auto": automatic, "adaptation": adaptation}
    unit = 0.0
    print(f"{'fit':<28}{'free':>6}{'evaluations':>13}{'median [s]':>12}{'processor [s]':>15}{'ratio':>8}")
    for name, work in rows.items():
        result = work()
        times = [_timed(work) for _ in range(repeat)]
        elapsed, processor = (statistics.median(times_of) for times_of in zip(*times, strict=True))
        unit = unit or processor
        row = f"{name:<28}{len(result.parameters):>6}{result.evaluations:>13}{elapsed:>12.2f}{processor:>15.2f}"
        print(f"{row}{processor / unit:>8.3g}", flush=True)


def _timed(work: Callable[[], Fit]) -> tuple[float, float]:
    """Time of a fit on the clock and of the processor, in s."""
    begin, used = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - begin, time.process_time() - used


if __name__ == "__main__":
    main()
