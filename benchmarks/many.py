"""Many simulations: ``python benchmarks/many.py [--count 10000] [--samples 1000]``.

Processor time and time on the clock of `simulate`, one by one, and of `simulate_many`, per simulation: of one actuator,
of actuators that differ in their load, and of ones that differ in friction and valves; in turn, round after round.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from clutchid import Actuator, Load, Log, simulate, simulate_many


def seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Time on the clock and processor time in s."""
    clock, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processor


def main() -> None:
    """Print a table in ms a simulation: median of the rounds."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, help="simulations at once")
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    t = 1e-3 * np.arange(options.samples)
    phase = t % 1.5
    duties = {"duty_supply": 1.0 * (phase > 0.1) * (phase < 0.3), "duty_exhaust": 1.0 * (phase > 0.8)}
    log, number = Log(t, duties), np.arange(options.count)
    cases = {
        "one actuator": [Actuator()] * options.count,
        "by load": [Actuator(load=Load((9e5 + 10.0 * i, 0.0, 0.0))) for i in number],
        "by friction and valves": [
            Actuator().replace({"D_v": 1500.0 + 0.1 * i, "C_ve": 2e-8 + 1e-13 * i}) for i in number
        ],
    }
    few = slice(0, min(options.count, 1000))
    simulate_many(cases["by load"][:16], log)
    print(f"{'ms a simulation, clock / processor':36s} {'simulate':>15s} {'simulate_many':>15s}")
    for name, actuators in cases.items():
        alone, many = [], []
        for _ in range(options.rounds):
            alone.append(np.array(seconds(lambda: [simulate(a, log) for a in actuators[few]])) / len(actuators[few]))  # noqa: B023
            many.append(np.array(seconds(lambda: simulate_many(actuators, log))) / len(actuators))  # noqa: B023
        texts = (" / ".join(f"{1e3 * x:.3f}" for x in np.median(times, axis=0)) for times in (alone, many))
        print(f"{name:36s} " + " ".join(f"{text:>15s}" for text in texts))


if __name__ == "__main__":
    main()
