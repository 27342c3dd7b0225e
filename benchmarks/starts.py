"""An observer that begins within a stroke: ``python benchmarks/starts.py --calibrations FOLDER --trucks 6``.

As after a reset of the control unit, or a hole of a bus, while the clutch is open. Trucks and calibrations are those
of `observer_band.py`. The worn clutch is followed from every tenth of a second on at which the piston is away from its
rest. A line a family: share of the starts after which the filter diverged; pressure in chamber A against the measured
one over the first 0.4 s, rms; largest position beyond the measured one in that time; and the load from 5 to 8 mm at the
end, against that of the observer that has followed the recording from its first sample, in % of the peak: share of the
starts with more than 3 %, and the worst.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from observer_band import FIRST, HYBRIDS, truck_and_observer
from online import WEAR
from prove import STROKES_A_METRE

from clutchid.log import Log
from clutchid.observer import Observer, ObserverState, observe, start
from clutchid.strokes.stroke import BEGINS
from clutchid.truck import GRID, drive

#: Interval of the starts, and the time after each in which pressure and position count, in samples.
EVERY, FIRST_SAMPLES = 100, 400


class Row(NamedTuple):
    """A start: whether the filter diverged, rms pressure error in Pa, position error in m, load difference in %."""

    diverged: bool
    pressure: float
    position: float
    load: float


def one_start(joint: Observer, begin: ObserverState, log: Log, first: int, expected: np.ndarray) -> Row:
    """The observer from a sample on."""
    at = slice(first, first + FIRST_SAMPLES)
    after, samples = observe(joint, begin, log.slice(first, len(log)).without("pressure_a"))
    states, names = samples.states[:FIRST_SAMPLES], joint.actuator.states
    pressure = states[:, names.index("p_A")] - log["pressure_a"][at]
    position = states[:, names.index("y")] - log["position"][at]
    touch = (GRID >= 5e-3) & (GRID <= 8e-3)
    off = (joint.load(after).force(GRID) - expected)[touch]
    return Row(
        bool(np.isnan(position).any()),
        float(np.sqrt(np.nanmean(pressure**2))),
        float(np.nanmax(np.abs(position))),
        100.0 * float(np.sqrt(np.mean(off**2))) / float(expected.max()),
    )


def one_truck(of: tuple[str, int], calibrations: Path, seconds: float) -> list[Row]:
    """Every start on one truck."""
    kind, joint, seed = truck_and_observer(of, calibrations)
    log = drive(kind, seconds=seconds, seed=seed, wear=WEAR, cycles=WEAR * STROKES_A_METRE).log
    begin = start(joint)
    after, _ = observe(joint, begin, log.without("pressure_a"))
    expected = joint.load(after).force(GRID)
    firsts = [k for k in range(0, len(log) - 5 * FIRST_SAMPLES, EVERY) if log["position"][k] > BEGINS]
    return [one_start(joint, begin, log, first, expected) for first in firsts]


def line(rows: Sequence[Row]) -> str:
    """Cells of a line of the table."""
    diverged, pressure, position, load = np.array(rows).T
    return (
        f"{len(rows)} | {100 * np.mean(diverged):.1f} | {np.sqrt(np.mean(pressure**2)) / 1e3:.1f} | "
        f"{1e3 * position.max():.1f} | {100 * np.mean(load > 3.0):.1f} | {load.max():.1f}"
    )


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    options.add_argument("--trucks", type=int, default=6, help="of each family, and hybrids")
    options.add_argument("--seconds", type=float, default=12.0, help="of the worn clutch")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    of_a_truck = partial(one_truck, calibrations=chosen.calibrations, seconds=chosen.seconds)
    print("| family | starts | diverged [%] | pressure [kPa] | position [mm] | load beyond 3 % [%] | worst [%] |")
    print(f"|{'---|' * 7}")
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        for family, first in (("A", FIRST), ("B", FIRST), ("h", HYBRIDS)):
            of = [(family, first + i) for i in range(chosen.trucks)]
            print(f"| {family} | {line([row for rows in pool.map(of_a_truck, of) for row in rows])} |", flush=True)


if __name__ == "__main__":
    main()
