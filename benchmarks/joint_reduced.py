"""Standard deviations of the reduced joint filter over those of the full one: ``python benchmarks/joint_reduced.py``.

Trucks of both families are calibrated once with pressure. Then their worn clutch is followed from position alone by
`joint`, and by `joint-reduced` with its own number of modes of the load or with others. Printed is the ratio of their
standard deviations at the end, least to most over the trucks: of each parameter that adapts, and of the load at
positions from 1 to 15 mm where that of `joint` is below half of its prior. Of the load it is what the filter knows,
without the parts of a band that no recording makes smaller. What a filter knows depends on the way that it went: the
column "moved" is `joint` itself from a start that is off by 0.03 prior standard deviations. Errors are those of the
load over 5 to 8 mm at the end, rms in % of the peak, median / worst; that of `joint` is behind the name of its row.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from online import WEAR, calibrated

from clutchid.log import FloatArray
from clutchid.observer import estimates_of, observe, observer, start
from clutchid.observer.methods import METHODS
from clutchid.observer.observer import Observer
from clutchid.observer.state import ObserverState
from clutchid.study.proving.ground import STROKES_A_METRE
from clutchid.truck import GRID, Truth, drive, truck

#: Positions in m at which standard deviations of the load are compared, and over which its error is.
POSITIONS, TOUCH = np.arange(1e-3, 15.01e-3, 0.25e-3), np.arange(5e-3, 8.01e-3, 0.25e-3)

#: Prior standard deviations by which the other start of `joint` is off.
MOVED = 0.03


class Spread(NamedTuple):
    """Standard deviations of the load in N at `POSITIONS` and of parameters by name; error of the load in %."""

    load: FloatArray
    parameters: dict[str, float]
    error: float


def main() -> None:
    """Print a column a number of modes, a row a parameter, for each family."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=6, help="of each family")
    options.add_argument("--seed", type=int, default=0, help="number of the first truck")
    options.add_argument("--modes", type=int, action="append", help="default: those of joint-reduced")
    options.add_argument("--seconds", type=float, default=60.0, help="of the worn clutch")
    options.add_argument("--calibrations", type=Path, help="folder in which calibrations are kept for the next run")
    chosen = options.parse_args()
    modes = chosen.modes or [METHODS["joint-reduced"].modes]
    for family in ("A", "B"):
        numbers = range(chosen.seed, chosen.seed + chosen.trucks)
        spreads = [of_truck(family, number, modes, chosen.seconds, chosen.calibrations) for number in numbers]
        titles = ["moved", *(f"{count} modes" for count in modes)]
        print(f"{f'family {family}':<24}" + "".join(f"{title:>16}" for title in titles))
        for name, cells in table(spreads).items():
            print(f"{name:<24}" + "".join(f"{cell:>16}" for cell in cells), flush=True)


def of_truck(family: str, number: int, modes: Sequence[int], seconds: float, calibrations: Path | None) -> list[Spread]:
    """That of `joint` before the first sample, at the end, at the end from a moved start; then with modes."""
    of_vehicle, seeds = truck(number, family), np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    file = calibrated(of_vehicle, seeds[0], calibrations / f"{family}{number}.toml" if calibrations else None)
    worn = drive(of_vehicle, seconds=seconds, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False)
    made = [observer(file.actuator, calibration=file.calibration, modes=count) for count in (None, *modes)]
    full, first = made[0], start(made[0])
    begins = [(full, first), (full, moved(first)), *((variant, start(variant)) for variant in made[1:])]
    ends = [(variant, observe(variant, state, worn.log)[0]) for variant, state in begins]
    return [spread(variant, state, worn.truth) for variant, state in ((full, first), *ends)]


def moved(state: ObserverState) -> ObserverState:
    """The state before the first sample with other values; a leak is not below 0."""
    theta = np.abs(MOVED * np.random.default_rng(0).standard_normal(state.theta.size))
    return state._replace(theta=theta, sound=state.sound._replace(theta=theta))


def spread(variant: Observer, state: ObserverState, truth: Truth) -> Spread:
    """Standard deviations and error in a state."""
    load = np.linalg.norm(variant.actuator.load.phi(POSITIONS) @ variant.prior.weights @ state.T, axis=1)
    values = {
        name: value.std
        for name, value in estimates_of(variant, state).items()
        if name not in variant.actuator.load.names
    }
    off = variant.load(state).force(TOUCH) - truth.load(TOUCH)
    return Spread(load, values, 100.0 * float(np.sqrt(np.mean(off**2)) / truth.load(GRID).max()))


def table(spreads: Sequence[Sequence[Spread]]) -> dict[str, list[str]]:
    """Ratios by name, a cell a number of modes."""
    cells: dict[str, list[str]] = {name: [] for name in ("load", *spreads[0][0].parameters)}
    for column in range(2, len(spreads[0])):
        load = [row[column].load / row[1].load for row in spreads]
        determined = [row[1].load < 0.5 * row[0].load for row in spreads]
        ratios = {"load": np.concatenate([ratio[at] for ratio, at in zip(load, determined, strict=True)])}
        for name in spreads[0][0].parameters:
            ratios[name] = np.array([row[column].parameters[name] / row[1].parameters[name] for row in spreads])
        for name, ratio in ratios.items():
            cells[name].append(f"{ratio.min():.3f} to {ratio.max():.3f}")
    off = np.array([[end.error for end in row[1:]] for row in spreads])
    full, *others = [f"{np.median(column):.2f} / {column.max():.2f}" for column in off.T]
    return {**cells, f"error [%], {full}": others}


if __name__ == "__main__":
    main()
