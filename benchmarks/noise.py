"""Noise by maximum likelihood of innovations: ``python benchmarks/noise.py DIR --family h --trucks 24``.

DIR has calibrations as `readings.py` and `hybrids.py` store them. The observer follows each calibration recording with
the noise of position and that of the model (states, flow) multiplied by factors of a grid; the likeliest factors are
those of the largest Gaussian likelihood of the innovations while the piston moves, an outlier counted as one at the
gate. The worn clutch is then read from position alone with the usual noise, with that one, and with that one and a
calibration that has it too. Errors and bands in % of the peak, as in `widening.py`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from prove import SECONDS
from readings import LACKING, calibration_of
from widening import LATE, calibrated, reading, seeds, worn_clutch

from clutchid.estimation.parameter_file import ParameterFile
from clutchid.log import Log
from clutchid.observer import observe, observer, start
from clutchid.simulation.noise import Noise
from clutchid.truck import drive, truck

#: Factors of the noise of position and of that of the model, and the changes under which a worn clutch is read.
POSITION, MODEL = (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0), (0.25, 0.5, 1.0, 2.0, 4.0)
CASES = ("nothing", "warm", "cold", "valves", LATE)


#: Modules whose noise is changed; the package exports a function of the name of the first one.
on_line, posed = map(import_module, ("clutchid.observer.configuration", "clutchid.estimation.problem"))


class Factors(NamedTuple):
    """Of the standard deviations of position and model."""

    position: float = 1.0
    model: float = 1.0


@contextmanager
def noise(factors: Factors) -> Iterator[None]:
    """Estimates and observers with other noise."""

    def scaled(**numbers: Any) -> Noise:
        usual = Noise(**numbers)
        measured = {**usual.measured, "position": usual.measured["position"] * factors.position}
        states = {name: value * factors.model for name, value in usual.states.items()}
        return replace(usual, measured=measured, states=states, flow=usual.flow * factors.model)

    posed.Noise = on_line.Noise = scaled  # type: ignore[attr-defined]
    try:
        yield
    finally:
        posed.Noise = on_line.Noise = Noise  # type: ignore[attr-defined]


def log_likelihood(once: ParameterFile, log: Log) -> float:
    """Gaussian log-likelihood of the innovations of the position while the piston moves, up to a constant."""
    joint = observer(once.actuator, calibration=once.calibration)
    _, run = observe(joint, start(joint), log)
    e, variance = run.innovations[:, 0], run.innovations[:, 1]
    speed = np.abs(run.states[:, once.actuator.states.index("v")])
    moving = np.isfinite(e) & (speed > joint.joint.settings.least_speed)
    squared = np.minimum(e[moving] ** 2 / variance[moving], joint.joint.noise.outlier**2)
    return float(-0.5 * np.sum(squared + np.log(variance[moving])))


def likeliest(once: ParameterFile, log: Log) -> tuple[Factors, float]:
    """The factors of the largest likelihood, and its logarithm above that of the usual noise."""
    values = {}
    for factors in map(Factors._make, product(POSITION, MODEL)):
        with noise(factors):
            values[factors] = log_likelihood(once, log)
    best = max(values, key=lambda factors: values[factors])
    return best, values[best] - values[Factors()]


def main() -> None:
    """A line a reading, and a line over all."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--family", default="h", choices=("A", "B", "h"))
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    rows = []
    for seed in range(chosen.seed, chosen.seed + chosen.trucks):
        number, family = (0, f"h:{seed}") if chosen.family == "h" else (seed, chosen.family)
        once = calibration_of(number, family, chosen.folder / f"{chosen.family}_{seed:05d}.toml")
        new = drive(truck(number, family), seconds=SECONDS, seed=seeds(number)[0], conditions=True).log
        best, gain = likeliest(once, new.without(*LACKING["position"]))
        print(f"{family} {number}: position {best.position:g}, model {best.model:g}, +{gain:.0f}", flush=True)
        with noise(best):
            anew = calibrated(number, family, LACKING["supply"], "shooting")
        for case in CASES:
            worn = worn_clutch(number, family, case)
            trucks = []
            for calibration, factors in ((once, Factors()), (once, best), (anew, best)):
                with noise(factors):
                    trucks.append(reading(worn, LACKING["position"], calibration, {}))
            if None not in trucks:
                rows.append([(r.error, 100 * r.covered, r.width) for r in trucks if r is not None])
                print(f"  {case}: " + ", ".join(f"{e:.2f} (width {w:.1f})" for e, _, w in rows[-1]), flush=True)
    titles = "usual noise", "likeliest in the reading", "and in the calibration"
    for title, (error, covered, width) in zip(titles, np.transpose(rows, (1, 2, 0)), strict=True):
        print(
            f"{title}: error {np.median(error):.2f} / {error.max():.2f}, mean {error.mean():.2f}, covered "
            f"{covered.mean():.1f} %, width {np.median(width):.1f}, {len(error)} readings"
        )


if __name__ == "__main__":
    main()
