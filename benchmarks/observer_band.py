"""The band of a load on line by case: ``python benchmarks/observer_band.py --calibrations FOLDER --trucks 12``.

Trucks 3606 on of families A and B, and hybrids h:6 on, are calibrated once with pressure, and the supply pressure
recorded. Their worn clutch is then observed unchanged, with 5 % less and more supply, with valves that pass 7 % less,
cold and warm, with nothing recorded beside it, with the supply pressure, and with the air temperature too. A line a
family and case: error over 5 to 8 mm, rms in % of the peak, median / worst; slope of the error over the position, in %
of f + A_A P_0 at full stroke, mean and rms; share of the points from 0.5 to 20 mm in the band, and its width in % of
the peak, with the supply considered and if it is as calibrated; trust good / with care / none, and of how many good
ones less than 90 % of the points are in the band; seconds of the flag `supply_unlike`.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from online import WEAR, calibrated
from prove import SECONDS, STROKES_A_METRE

from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.inference.uncertainty.conditions import by_supply
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.configuration import Observer, observer
from clutchid.observer.run import observe_recording
from clutchid.truck import GRID, Vehicle, drive, truck

#: First number of the trucks of families, and first seed of the hybrids.
FIRST, HYBRIDS = 3606, 6

#: Columns that a recording lacks, by what it has beside position and duty cycles.
LACKING: dict[str, tuple[str, ...]] = {
    "Nothing else recorded": ("pressure_supply", "temperature_ambient"),
    "Supply pressure recorded": ("temperature_ambient",),
    "Supply pressure and air temperature recorded": (),
}


class Case(NamedTuple):
    """Factors on the supply pressure and on what its sensor shows, and named changes of the truck."""

    supply: float = 1.0
    sensor: float = 1.0
    change: tuple[str, ...] = ()


CASES: dict[str, Case] = {
    "unchanged": Case(),
    "supply -5 %": Case(0.95),
    "supply +5 %": Case(1.05),
    "valves -7 %": Case(change=("valves",)),
    "cold": Case(change=("cold",)),
    "warm": Case(change=("warm",)),
    **{f"sensor {percent:+d} %": Case(sensor=1.0 + percent / 100.0) for percent in (-7, -5, -2, 2, 5, 7)},
}


class Row(NamedTuple):
    """A load at the end of a recording: error and widths in % of the peak, slope, shares of the points in the bands."""

    error: float
    slope: float
    covered: float
    width: float
    covered_as_calibrated: float
    width_as_calibrated: float
    trust: str
    unlike: float


def truck_and_observer(
    of: tuple[str, int], calibrations: Path, sensor_std: float | None = None
) -> tuple[Vehicle, Observer, int]:
    """A truck by family and number, the observer of its calibration, and the seed of its worn clutch."""
    family, number = of
    kind = truck(0, f"h:{number}") if family == "h" else truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    mark = f"h{number}0" if family == "h" else f"{family}{number}"
    content = calibrated(kind, seeds[0], calibrations / f"{mark}_supply.toml", conditions=True)
    made = observer(content.actuator, calibration=content.calibration, supply_sensor_std=sensor_std)
    return kind, made, seeds[1]


def one_truck(
    of: tuple[str, int], calibrations: Path, seconds: float, cases: Sequence[str], sensor_std: float | None = None
) -> dict[tuple[str, str, str], Row]:
    """Every case on one truck, with each of `LACKING`."""
    kind, joint, seed = truck_and_observer(of, calibrations, sensor_std)
    family, rows = of[0], {}
    for case in cases:
        share, sensor, change = CASES[case]
        changed: Vehicle = kind.replace({"P_S": share * kind.P_S})
        worn = drive(
            changed, seconds=seconds, seed=seed, wear=WEAR, cycles=WEAR * STROKES_A_METRE,
            pressure=False, conditions=True, change=change,
        )  # fmt: skip
        truth = worn.truth.load(GRID)
        for recorded, lacking in LACKING.items():
            shown = worn.log.with_columns(pressure_supply=sensor * worn.log["pressure_supply"])
            run = observe_recording(joint, shown.without(*lacking))
            force = joint.load(run.after).force(GRID)
            off, by_position = force - truth, GRID / joint.actuator.parameters.y_max * by_supply(joint.actuator, force)
            slope = 100 * float(by_position @ off) / float(by_position @ by_position)
            touch, peak = (GRID >= 5e-3) & (GRID <= 8e-3), truth.max()
            deviations = [joint.load_deviation(run.after, GRID, as_calibrated=as_is) for as_is in (False, True)]
            bands = [
                value
                for deviation in deviations
                for value in (
                    100 * float(np.mean(np.abs(off) <= QUANTILE * deviation)),
                    200 * QUANTILE * float(np.median(deviation)) / peak,
                )
            ]
            error = 100 * float(np.sqrt(np.mean(off[touch] ** 2))) / peak
            rows[family, case, recorded] = Row(
                error, slope, *bands, observed_verdict(indicators(run)).trust, run.health["supply_unlike"]
            )
    return rows


def line(rows: Sequence[Row]) -> str:
    """Cells of a line of the table."""
    errors = np.array([row.error for row in rows])
    slopes, covered, width, covered_as, width_as = (np.array([row[i] for row in rows]) for i in range(1, 6))
    trusts = [sum(row.trust == grade for row in rows) for grade in ("good", "with care", "none")]
    beside = sum(row.trust == "good" and row.covered < 90 for row in rows)
    return (
        f"{np.median(errors):.2f} / {errors.max():.2f} | {slopes.mean():+.1f}, {np.sqrt(np.mean(slopes**2)):.1f} | "
        f"{covered.mean():.0f} | {np.median(width):.1f} | {covered_as.mean():.0f} | {np.median(width_as):.1f} | "
        f"{' / '.join(map(str, trusts))} | {beside} | {np.mean([row.unlike for row in rows]):.1f}"
    )


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    options.add_argument("--trucks", type=int, default=12, help="of each family")
    options.add_argument("--hybrids", type=int, default=18)
    options.add_argument("--seconds", type=float, default=SECONDS, help="of the worn clutch")
    options.add_argument("--supply-sensor-std", type=float, help="as that of `clutchid observe`")
    options.add_argument("--case", action="append", choices=tuple(CASES), help="default: all")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    trucks = [(family, FIRST + i) for family in ("A", "B") for i in range(chosen.trucks)]
    trucks += [("h", HYBRIDS + i) for i in range(chosen.hybrids)]
    cases = chosen.case or list(CASES)
    of_a_truck = partial(
        one_truck,
        calibrations=chosen.calibrations,
        seconds=chosen.seconds,
        cases=cases,
        sensor_std=chosen.supply_sensor_std,
    )
    rows_by_case: dict[tuple[str, str, str], list[Row]] = defaultdict(list)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        for rows in pool.map(of_a_truck, trucks):
            for key, row in rows.items():
                rows_by_case[key].append(row)
    bands = "points in the band [%] | width [%] | as calibrated: points [%] | width [%]"
    head = f"error [%] | slope [%] | {bands} | trust | good beside | unlike [s]"
    for recorded in LACKING:
        print(f"\n{recorded}\n\n| family | case | trucks | {head} |\n|{'---|' * 12}")
        for family in ("A", "B", "h"):
            for case in cases:
                rows = rows_by_case[family, case, recorded]
                if rows:
                    print(f"| {family} | {case} | {len(rows)} | {line(rows)} |")


if __name__ == "__main__":
    main()
