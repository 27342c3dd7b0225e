"""What a change between calibration and use costs: ``python benchmarks/widening.py --trucks 8 --seed 1000``.

Every truck of the proving ground is calibrated once with pressure. Then its worn clutch is recorded under one change at
a time, and the load is read from position alone: with all other numbers held as calibrated, by default, which sets free
what has changed, and with the supply pressure free as well or measured with a workshop's instrument. Errors as in
``clutchid prove``, median / worst over the trucks; covered is the share of the grid where the band holds the true load.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from clutchid import Fit, Prior, SolveError, fit
from clutchid.study.proving.answers import Answer, score
from clutchid.study.proving.ground import SECONDS, STROKES
from clutchid.truck import Truck, drive, truck

#: Wear of the facing in m under every change.
WEAR = 1.5e-3
VALVE_TIMES = tuple(f"t_{i}{valve}" for valve in "se" for i in (1, 2, 3, 4))

#: No truck is used below or above these, in K: one that is cold already gets less than 30 K colder.
COLDEST, WARMEST = Truck.row("T_0").low, Truck.row("T_0").high

#: What differs from the calibration: numbers of the truck by factor, then other arguments of `drive`.
CHANGES: dict[str, tuple[Mapping[str, float], Callable[[Truck], Mapping[str, Any]]]] = {
    "nothing": ({}, lambda _: {}),
    "supply 5 % lower": ({"P_S": 0.95}, lambda _: {}),
    "30 K colder": ({}, lambda kind: {"temperature": max(kind.T_0 - 30.0, COLDEST)}),
    "30 K warmer": ({}, lambda kind: {"temperature": min(kind.T_0 + 30.0, WARMEST)}),
    "5 K warmer": ({}, lambda kind: {"temperature": min(kind.T_0 + 5.0, WARMEST)}),
    "valves 10 % slower": (dict.fromkeys(VALVE_TIMES, 1.1), lambda _: {}),
    "valves pass 10 % less": ({"C_s": 0.9, "C_e": 0.9}, lambda _: {}),
    "colder and slower": (dict.fromkeys(VALVE_TIMES, 1.1), lambda kind: {"temperature": max(kind.T_0 - 30.0, COLDEST)}),
    "100 Hz bus log": ({}, lambda _: {"recorder": "bus"}),
}


def around(once: Fit, shares: Mapping[str, float], factor: float = 1.0) -> dict[str, Any]:
    """Numbers free with the load, each known within a share of its calibrated value, times `factor`."""
    value = {name: factor * once.actuator.value(name) for name in shares}
    priors = {name: Prior(value[name], share * value[name]) for name, share in shares.items()}
    return {"free": ("load", *shares), "priors": priors}


#: What a user might do about it, from the calibration and how much the supply really changed.
REMEDIES: dict[str, Callable[[Fit, float], dict[str, Any]]] = {
    "held as calibrated": lambda once, _supply: {"calibration": replace(once.calibration, score=None)},
    "default": lambda _once, _supply: {},
    "P_S free, 5 %": lambda once, _supply: around(once, {"P_S": 0.05}),
    "P_S measured, 1 %": lambda once, supply: around(once, {"P_S": 0.01}, supply),
}


def one_truck(number: int, method: str) -> list[tuple[str, str, list[float] | None]]:
    """Errors of a truck under every change with every remedy; None where the search failed."""
    kind = truck(number)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    log = drive(kind, seconds=SECONDS, seed=seeds[0], name="calibration").log
    once = fit(log, measure=("position", "pressure_a"), free=("auto",), method=method)
    rows: list[tuple[str, str, list[float] | None]] = []
    for change, (factors, options) in CHANGES.items():
        other = kind.replace({name: getattr(kind, name) * factor for name, factor in factors.items()})
        worn = drive(
            other,
            seconds=SECONDS,
            seed=seeds[1],
            wear=WEAR,
            cycles=WEAR * STROKES,
            pressure=False,
            name="worn",
            **options(kind),
        )
        for remedy, of in REMEDIES.items():
            try:
                wanted = {"calibration": once.calibration, **of(once, factors.get("P_S", 1.0))}
                found = fit(worn.log, once.actuator, **wanted)
            except SolveError:
                rows.append((change, remedy, None))
                continue
            curve = found.load_curve
            pressure = found.recordings["worn"].simulated["pressure_a"]
            answer = Answer(curve.position, curve.force, curve.low, curve.high, pressure)
            rows.append((change, remedy, [*asdict(score(answer, worn.truth, worn.log.time)).values()]))
    return rows


def main() -> None:
    """Print a row a change and remedy."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=1000)
    options.add_argument("--method", default="shooting")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        trucks = list(pool.map(one_truck, numbers, [chosen.method] * len(numbers)))
    titles = ("0.5-20 mm [%]", "5-8 mm [%]", "half load [mm]", "p_A [kPa]", "covered [%]", "failed")
    print(f"{'change':<24}{'remedy':<24}" + "".join(f"{title:>16}" for title in titles))
    for change in CHANGES:
        for remedy in REMEDIES:
            found = [row for rows in trucks for c, r, row in rows if (c, r) == (change, remedy)]
            table = np.abs([row for row in found if row is not None])
            cells = [f"{np.median(column):.2f} /{column.max():6.2f}" for column in table[:, :4].T]
            cells += [f"{100 * table[:, 4].mean():.0f}", str(sum(row is None for row in found))]
            print(f"{change:<24}{remedy:<24}" + "".join(f"{cell:>16}" for cell in cells))


if __name__ == "__main__":
    main()
