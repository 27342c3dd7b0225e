"""What a change between calibration and use costs: ``python benchmarks/widening.py --family B --trucks 8 --seed 0``.

Every truck of the proving ground is calibrated once with pressure. Then its worn clutch is recorded under one change at
a time and under pairs of them, and the load is read from position alone: by default, which weighs what may have
changed, and with the supply pressure free with 5 % or measured with a workshop's instrument. Errors as in ``clutchid
prove``, median / worst over the trucks; covered is the share of the grid where the band holds the true load, width the
median of the band from low to high in % of the peak; trust counts the verdicts good / with care / none.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from itertools import combinations
from multiprocessing import get_context
from typing import Any

import numpy as np

from clutchid import Fit, Prior, SolveError, fit
from clutchid.study.proving.answers import Answer, score
from clutchid.study.proving.ground import SECONDS, STROKES
from clutchid.truck import CHANGES, GRID, Vehicle, drive, truck

#: Verdicts, in the order of the column "trust".
TRUSTS = ("good", "with care", "none")

#: Wear of the facing in m under every change.
WEAR = 1.5e-3


def _as_usual(_: Vehicle) -> Mapping[str, Any]:
    return {}


#: What differs from the calibration: named changes of the truck, one after the other, and other arguments of `drive`.
CASES: dict[str, tuple[tuple[str, ...], Callable[[Vehicle], Mapping[str, Any]]]] = {
    "nothing": ((), _as_usual),
    **{name: ((name,), _as_usual) for name in CHANGES},
    **{f"{one} and {other}": ((one, other), _as_usual) for one, other in combinations(CHANGES, 2) if other != "warm"},
    "supply and warm": (("supply", "warm"), _as_usual),
    "5 K warmer": ((), lambda kind: {"temperature": kind.T_0 + 5.0}),
    "100 Hz bus log": ((), lambda _: {"recorder": "bus"}),
}


def around(once: Fit, shares: Mapping[str, float], factor: float = 1.0) -> dict[str, Any]:
    """Numbers free with the load, each known within a share of its calibrated value, times `factor`."""
    value = {name: factor * once.actuator.value(name) for name in shares}
    priors = {name: Prior(value[name], share * value[name]) for name, share in shares.items()}
    return {"free": ("load", *shares), "priors": priors}


def left_out(remedy: str) -> tuple[str, ...]:
    """Columns that the recordings lack."""
    return () if remedy == CONDITIONS else ("temperature_ambient", "pressure_supply")


#: The remedy for which calibration and recording have ambient temperature and supply pressure.
CONDITIONS = "conditions recorded"


#: What a user might do about it, from the calibration and how much the supply really changed.
REMEDIES: dict[str, Callable[[Fit, float], dict[str, Any]]] = {
    "default": lambda _once, _supply: {},
    CONDITIONS: lambda _once, _supply: {},
    "P_S free, 5 %": lambda once, _supply: around(once, {"P_S": 0.05}),
    "P_S measured, 1 %": lambda once, supply: around(once, {"P_S": 0.01}, supply),
}


def one_truck(
    number: int, family: str, cases: Sequence[str], remedies: Sequence[str], method: str
) -> list[tuple[str, str, list[float] | None]]:
    """Errors of a truck under every change with every remedy; None where the search failed."""
    kind = truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    log = drive(kind, seconds=SECONDS, seed=seeds[0], name="calibration", conditions=True).log
    calibrations = {
        columns: fit(log.without(*columns), measure=("position", "pressure_a"), free=("auto",), method=method)
        for columns in {left_out(remedy) for remedy in remedies}
    }
    rows: list[tuple[str, str, list[float] | None]] = []
    for case in cases:
        changes, options = CASES[case]
        worn = drive(
            kind, seconds=SECONDS, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES, pressure=False, change=changes,
            name="worn", conditions=True, **options(kind),
        )  # fmt: skip
        supply = worn.truth.supply / kind.P_S
        for remedy in remedies:
            once = calibrations[left_out(remedy)]
            try:
                wanted = {"calibration": once.calibration, **REMEDIES[remedy](once, supply)}
                found = fit(worn.log.without(*left_out(remedy)), once.actuator, **wanted)
            except SolveError:
                rows.append((case, remedy, None))
                continue
            curve = found.load_curve
            pressure = found.recordings["worn"].simulated["pressure_a"]
            answer = Answer(curve.position, curve.force, curve.low, curve.high, pressure)
            peak = worn.truth.load(GRID).max()
            width = float(np.median(np.interp(GRID, curve.position, curve.high - curve.low))) / peak * 100
            values = [*asdict(score(answer, worn.truth, worn.log.time)).values()]
            rows.append((case, remedy, [*values, width, TRUSTS.index(found.verdict.trust)]))
    return rows


def main() -> None:
    """Print a row a change and remedy."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=1000)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--case", action="append", choices=tuple(CASES), help="default: all")
    options.add_argument("--remedy", action="append", choices=tuple(REMEDIES), help="default: all")
    options.add_argument("--method", default="shooting")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    cases, remedies = chosen.case or list(CASES), chosen.remedy or list(REMEDIES)
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        trucks = list(
            pool.map(
                partial(one_truck, family=chosen.family, cases=cases, remedies=remedies, method=chosen.method), numbers
            )
        )
    titles = (
        "0.5-20 mm [%]",
        "5-8 mm [%]",
        "half load [mm]",
        "p_A [kPa]",
        "covered [%]",
        "width [%]",
        "trust",
        "failed",
    )
    print(f"{'change':<24}{'remedy':<24}" + "".join(f"{title:>16}" for title in titles))
    for case in cases:
        for remedy in remedies:
            found = [row for rows in trucks for c, r, row in rows if (c, r) == (case, remedy)]
            table = np.abs([row for row in found if row is not None])
            cells = [f"{np.median(column):.2f} /{column.max():6.2f}" for column in table[:, :4].T]
            cells += [
                f"{100 * table[:, 4].mean():.0f}",
                f"{np.median(table[:, 5]):.1f}",
                " / ".join(str(int(np.sum(table[:, 6] == i))) for i in range(len(TRUSTS))),
                str(sum(row is None for row in found)),
            ]
            print(f"{case:<24}{remedy:<24}" + "".join(f"{cell:>16}" for cell in cells))


if __name__ == "__main__":
    main()
