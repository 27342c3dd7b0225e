"""Which property of a truck the model misses: ``python benchmarks/ablation.py --trucks 4 --seed 0``.

One property at a time is taken from the virtual trucks, and each is calibrated with pressure. Two numbers say what is
left, in % of the true peak, mean over 5 to 20 mm: the error of the load in the calibration, and what the position alone
misses on the same recording. A property whose loss makes them smaller is one that the model does not have.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from prove import SECONDS

from clutchid import fit
from clutchid.truck import Truck, drive, truck

FAST_VALVES = {f"t_{i}{valve}": 1e-4 for valve in "se" for i in (1, 2, 3, 4)}
STEADY_SUPPLY = {"dP_G": 1.0, "r_up": 1.0, "r_down": 1.0}

#: What a truck loses, by name.
LOSSES: dict[str, Mapping[str, float]] = {
    "nothing": {},
    "travel of the valves": FAST_VALVES,
    "swing of the supply": STEADY_SUPPLY,
    "both": {**FAST_VALVES, **STEADY_SUPPLY},
    "hysteresis": {"mu_h": 2e-3, "F_h": 2.0, "K_h": 1e4},
    "lag of the sensors": {"tau_y": 0.0, "tau_p": 0.0},
    "static friction": {"R_S": 1.0},
    "leaks": {"C_AB": 0.0, "C_A0": 0.0},
}

Y = np.arange(10, 41) / 2000


def errors(name: str, number: int) -> tuple[float, float]:
    """Error of the calibrated load and what position alone misses, for one truck without one property."""
    kind: Truck = truck(number).replace(LOSSES[name])
    seed = int(np.random.default_rng([number, 2]).integers(0, 2**31))
    driven = drive(kind, seconds=SECONDS, seed=seed, name="calibration")
    result = fit(driven.log, measure=("position", "pressure_a"), free=("auto",))
    assert result.calibration is not None
    load, true = result.actuator.load, driven.truth.load(Y)
    missed = load.phi(Y) @ np.array(result.calibration.bias)
    return tuple(float(100 * e.mean() / true.max()) for e in (load.force(Y) - true, missed))


def main() -> None:
    """Print a row a loss, a pair of numbers a truck."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=4)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    print(f"{'without':<24}" + "".join(f"{f'truck {n}':>16}" for n in numbers))
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        for name in LOSSES:
            pairs = pool.map(errors, [name] * len(numbers), numbers)
            print(f"{name:<24}" + "".join(f"{f'{a:.2f} / {b:.2f}':>16}" for a, b in pairs), flush=True)


if __name__ == "__main__":
    main()
