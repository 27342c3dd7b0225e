"""How certain a load from position alone may be called: ``python benchmarks/bands.py --family A --trucks 12``.

Every truck is calibrated once with pressure; its worn clutch is read under the cases of `widening.py`, once, and its
band is calculated with several settings of `clutchid.estimation.hypotheses.IntervalSettings`. Score: mean logarithm of
the density of the true load in the band, largest where bands are as wide as the errors are. Covered is the share
of the points from 0.5 to 20 mm in the 95 % band, width the median of the band from low to high in % of the peak; the
area under the curve is that of the expected error for loads more than 2 % off.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from widening import LATE, calibrated, worn_clutch

from clutchid.estimation.departure import relative_misfit
from clutchid.estimation.hypotheses import BAND, IntervalSettings, Mixture, explained, mixture
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.interval import QUANTILE
from clutchid.truck import GRID

#: Columns that the recordings lack.
CONDITIONS = ("temperature_ambient", "pressure_supply")

SHIPPED = "and misfit, as shipped"

#: What is compared: settings, and whether a misfit counts.
BANDS: Mapping[str, tuple[IntervalSettings, bool]] = {
    "evidence as it is": (IntervalSettings(1.0, 0.0), False),
    "half of it": (IntervalSettings(0.5, 0.0), False),
    "and what other grease adds": (BAND, False),
    SHIPPED: (BAND, True),
    "all evidence, the rest as shipped": (IntervalSettings(1.0, BAND.missed), True),
}

CASES = (
    "nothing", "supply", "cold", "warm", "valves", "seals", "supply and warm", "supply and cold", "cold and valves",
    "5 K warmer", LATE,
)  # fmt: skip

#: Error in % that counts as bad, and least density, so that one truck does not decide.
BAD, FLOOR = 2.0, 1e-2


class Reading(NamedTuple):
    """Error and standard deviation of a load at the points of the grid, in % of its peak."""

    case: str
    error: FloatArray
    std: FloatArray


def one_truck(number: int, family: str) -> dict[str, list[Reading]]:
    """Readings of one truck by setting."""
    once = calibrated(number, family, CONDITIONS, "shooting")
    kept = once.calibration
    assert kept is not None, "a calibration with pressure keeps one"
    found: dict[str, list[Reading]] = {name: [] for name in BANDS}
    for case in CASES:
        worn = worn_clutch(number, family, case)
        read, problem = reader([worn.log.without(*CONDITIONS)], once.actuator, kept)
        for name, (band, counts) in BANDS.items():
            found[name].append(reading(case, problem, read(band, counts), worn.truth.load(GRID)))
    return found


def reader(
    logs: Sequence[Log], actuator: Actuator, calibration: Calibration
) -> tuple[Callable[[IntervalSettings, bool], Mixture], Problem]:
    """A reading that takes the settings of its band and whether its misfit counts, and its problem."""
    functions = SHOOTING.changes
    assert functions is not None
    free = FreeParameters(actuator.load.names, ("position",))
    known = explained(SHOOTING.search(logs, actuator, free, calibration, None), functions, calibration)
    misfit = relative_misfit(min(one.solution.at.cost for one in known.values()), logs, calibration)
    return lambda band, counts: mixture(known, calibration, misfit if counts else 1.0, band), known[()].result.problem


def reading(case: str, problem: Problem, found: Mixture, truth: FloatArray) -> Reading:
    """The load of a mixture against the truth."""
    load = problem.actuator_of(found.x, problem.stems[0]).load
    slopes = np.zeros((len(load.names), found.x.size))
    for j, (c, value) in enumerate(zip(problem.coordinates, found.x.tolist(), strict=True)):
        if c.base in load.names:
            slopes[load.names.index(c.base), j] = c.slope(value)
    rows = load.phi(GRID) @ slopes
    std = np.sqrt(np.einsum("ij,jk,ik->i", rows, found.covariance, rows))
    return Reading(case, 100 * (load.force(GRID) - truth) / truth.max(), 100 * std / truth.max())


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def summary(readings: Sequence[Reading]) -> str:
    """Score, share covered, width, and how well the expected error separates good from bad."""
    z = [r.error / r.std for r in readings]
    density = [np.mean(np.log(np.exp(-0.5 * e**2) / r.std + FLOOR)) for e, r in zip(z, readings, strict=True)]
    covered = 100 * np.mean([np.abs(e) <= QUANTILE for e in z])
    width = np.median([2 * QUANTILE * np.median(r.std) for r in readings])
    bad = np.array([rms(r.error) > BAD for r in readings])
    expected = np.array([rms(r.std) for r in readings])
    area = f"{np.mean(expected[bad][:, None] > expected[~bad][None, :]):.2f}" if 0 < bad.sum() < bad.size else "-"
    return f"score {np.mean(density):6.2f}  covered {covered:3.0f} %  width {width:5.1f} %  area {area}"


def main() -> None:
    """Print a table for each setting, and the cases of the shipped one."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=12)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        trucks = list(pool.map(partial(one_truck, family=chosen.family), numbers))
    for name in BANDS:
        print(f"{name:<36}{summary([r for truck in trucks for r in truck[name]])}")
    for case in CASES:
        of_case = [r for truck in trucks for r in truck[SHIPPED] if r.case == case]
        errors = [rms(r.error) for r in of_case]
        print(f"  {case:<34}{np.median(errors):.2f} / {max(errors):5.2f} %  {summary(of_case)}")


if __name__ == "__main__":
    main()
