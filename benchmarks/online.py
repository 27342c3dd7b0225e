"""Loads and pressures of the observers: ``python benchmarks/online.py --family A --trucks 4 --seed 0``.

Every truck is calibrated once with pressure. Then its worn clutch is followed from position alone, sample by sample,
from the load of the new clutch. Load over 5 to 8 mm, rms in % of the peak, after 2 and 10 strokes and at the end of 30
s; pressure in chamber A, rms in kPa; median / worst over the trucks. Covered is the share of the points from 0.5 to 20
mm where the 95 % band of the load at the end holds the truth.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np

from clutchid import Fit, fit
from clutchid.log import FloatArray, Log
from clutchid.observe.methods import METHODS
from clutchid.observe.observer import observe, observer, start
from clutchid.study.proving.ground import SECONDS, STROKES
from clutchid.truck import GRID, Drive, drive, truck

#: Wear of the facing in m, and position in m whose upward crossings are counted as strokes.
WEAR, STROKE = 1.5e-3, 2e-3

#: Strokes after which the load is compared with the truth.
AFTER = (2, 10)


class Row(NamedTuple):
    """Errors of one truck; NaN where there are fewer strokes."""

    after_2: float
    after_10: float
    end: float
    pressure: float
    covered: float
    microseconds: float


def strokes(log: Log) -> FloatArray:
    """Numbers of the samples at which strokes end."""
    above = log["position"] > STROKE
    ends: FloatArray = np.flatnonzero(above[:-1] & ~above[1:]) + 1
    return ends


def followed(once: Fit, worn: Drive, method: str) -> Row:
    """Errors of a method on a recording."""
    one = observer(once.actuator, method)
    state, truth = start(one), worn.truth.load(GRID)
    touch, ends = (GRID >= 5e-3) & (GRID <= 8e-3), strokes(worn.log)
    cuts = [int(ends[n - 1]) for n in AFTER if ends.size >= n]
    errors, pressures, begin, seconds = [], [], 0, 0.0
    for end in (*cuts, len(worn.log)):
        started = time.perf_counter()
        state, found = observe(one, state, worn.log.slice(begin, end))
        seconds += time.perf_counter() - started
        pressures.append(found.states[:, once.actuator.states.index("p_A")])
        off = 100 * (one.load(state).force(GRID) - truth) / truth.max()
        errors.append(float(np.sqrt(np.mean(off[touch] ** 2))))
        begin = end
    errors = [*errors[:-1], *[np.nan] * (len(AFTER) - len(cuts)), errors[-1]]
    pressure = np.sqrt(np.nanmean((np.concatenate(pressures) - worn.truth.states["pressure_a"]) ** 2))
    within = np.abs(one.load(state).force(GRID) - truth) <= 1.96 * one.load_deviation(state, GRID)
    return Row(*errors, float(pressure) * 1e-3, 100 * float(within.mean()), seconds / len(worn.log) * 1e6)


def main() -> None:
    """Print a row a method."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=4)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    rows: dict[str, list[Row]] = {method: [] for method in METHODS}
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        kind = truck(number, chosen.family)
        seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
        log = drive(kind, seconds=SECONDS, seed=seeds[0], name="calibration").log
        once = fit(log, measure=("position", "pressure_a"), free=("auto",))
        worn = drive(
            kind, seconds=SECONDS, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES, pressure=False, name="worn"
        )
        for method, found in rows.items():
            found.append(followed(once, worn, method))
    titles = ("2 strokes [%]", "10 strokes [%]", "end [%]", "p_A [kPa]", "covered [%]", "us a sample")
    print(f"{'method':<12}" + "".join(f"{title:>18}" for title in titles))
    for method, found in rows.items():
        table = np.array(found)
        cells = [f"{np.nanmedian(column):.2f} / {np.nanmax(column):.2f}" for column in table.T]
        cells[4] = f"{table[:, 4].mean():.0f}"
        print(f"{method:<12}" + "".join(f"{cell:>18}" for cell in cells))


if __name__ == "__main__":
    main()
