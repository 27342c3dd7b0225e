"""What a change between calibration and use costs: ``python benchmarks/widening.py --family B --trucks 8 --seed 0``.

Every truck of the proving ground is calibrated once with pressure. Then its worn clutch is recorded under one change at
a time and under pairs of them, and the load is read from position alone: by default, which weighs what may have
changed, and with the supply pressure free with 5 % or measured with a workshop's instrument. Errors as in ``prove.py``,
median / worst over the trucks; covered is the share of the grid where the band holds the true load, width the median of
the band from low to high in % of the peak; trust counts the verdicts good / with care / none; seconds are those of a
reading, median / worst. Below the table: how well the verdicts tell good from bad, over all rows together.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import combinations
from multiprocessing import get_context
from typing import Any, NamedTuple, get_args

import numpy as np
from own_plant import OwnDrive, own_drive, own_type
from prove import SECONDS, STROKES_A_METRE, Answer, score

from clutchid import DataError, Fit, FitRequest, Prior, SolveError, fit
from clutchid.estimation.fit import MethodName
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.log import INPUTS
from clutchid.truck import CHANGES, GRID, Drive, Vehicle, drive, truck

#: Columns of the table.
TITLES = (
    "0.5-20 mm [%]", "5-8 mm [%]", "half load [mm]", "p_A [kPa]", "covered [%]", "width [%]", "trust", "seconds",
    "refused",
)  # fmt: skip

#: Verdicts, in the order of the column "trust".
TRUSTS = ("good", "with care", "none")

#: Wear of the facing in m under every change.
WEAR = 1.5e-3

#: Family of the plant that shares no part with the package, `own_plant.py`.
OWN = "own"

#: Cases that `drive` does not make: duty cycles that are recorded late, and a calibration of the truck before.
LATE, ANOTHER = "duty one sample late", "another truck's calibration"


def _as_usual(_: Vehicle) -> Mapping[str, Any]:
    return {}


#: What differs from the calibration: named changes of the truck, one after the other, and other arguments of `drive`.
CASES: dict[str, tuple[tuple[str, ...], Callable[[Vehicle], Mapping[str, Any]]]] = {
    "nothing": ((), _as_usual),
    **{name: ((name,), _as_usual) for name in CHANGES},
    **{
        f"{change} and {other}": ((change, other), _as_usual)
        for change, other in combinations(CHANGES, 2)
        if other != "warm"
    },
    "supply and warm": (("supply", "warm"), _as_usual),
    "60 K colder": (("cold", "cold"), _as_usual),
    "5 K warmer": ((), lambda kind: {"temperature": kind.T_0 + 5.0}),
    "100 Hz bus log": ((), lambda _: {"recorder": "bus"}),
    LATE: ((), _as_usual),
    ANOTHER: ((), _as_usual),
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


class Reading(NamedTuple):
    """A load read from position alone: errors as in ``prove.py``, band, verdict and time."""

    error: float
    error_5_to_8: float
    half_load: float
    pressure: float
    covered: float
    width: float
    trust: int
    seconds: float


class Row(NamedTuple):
    """A case with a remedy on one truck; without a reading if it was refused or its search failed."""

    case: str
    remedy: str
    reading: Reading | None


def one_truck(number: int, family: str, cases: Sequence[str], remedies: Sequence[str], method: MethodName) -> list[Row]:
    """Every case with every remedy on one truck."""
    calibrations = {
        columns: calibrated(number, family, columns, method) for columns in {left_out(remedy) for remedy in remedies}
    }
    rows = []
    for case in cases:
        worn = worn_clutch(number + 1 if case == ANOTHER else number, family, case)
        supply = worn.truth.supply / truck(number, family).P_S
        for remedy in remedies:
            columns = left_out(remedy)
            wanted = REMEDIES[remedy](calibrations[columns], supply)
            rows.append(Row(case, remedy, reading(worn, columns, calibrations[columns], wanted)))
    return rows


#: Priors of a calibration: the defaults.
NO_PRIORS: Mapping[str, Prior] = {}


def calibrated(
    number: int, family: str, without: Sequence[str], method: MethodName, priors: Mapping[str, Prior] = NO_PRIORS
) -> Fit:
    """A calibration of a truck from a recording without some columns."""
    seed, name = seeds(number)[0], "calibration"
    if family == OWN:
        log = own_drive(number, seed, name=name).log
    else:
        log = drive(truck(number, family), seconds=SECONDS, seed=seed, name=name, conditions=True).log
    request = FitRequest(("position", "pressure_a"), ("auto",), method=method, priors=priors)
    return fit(log.without(*without), request=request)


def worn_clutch(
    number: int, family: str, case: str, bus: bool = False, another: int = 0, kind: Vehicle | None = None
) -> Drive | OwnDrive:
    """A recording of a truck's worn clutch, in the controller or on the bus; `another` numbers further ones.

    `kind` is driven in its place, with its seeds.
    """
    changes, options = CASES[case]
    seed = seeds(number)[1] + another
    worn: Drive | OwnDrive
    if family == OWN:
        own = options(own_type(number))
        worn = own_drive(number, seed, wear=WEAR, pressure=False, change=changes, name="worn", **own)
    else:
        kind = kind or truck(number, family)
        worn = drive(
            kind, seconds=SECONDS, seed=seed, wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False, change=changes,
            name="worn", conditions=True, **({"recorder": "bus"} if bus else {}), **options(kind),
        )  # fmt: skip
    if case != LATE:
        return worn
    late = {name: np.append(worn.log[name][:1], worn.log[name][:-1]) for name in INPUTS}
    return replace(worn, log=worn.log.with_columns(**late))


def seeds(number: int) -> list[int]:
    """Seeds of the calibration recording and of the worn one."""
    drawn: list[int] = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    return drawn


def reading(
    worn: Drive, without: Sequence[str], once: Fit | ParameterFile, wanted: Mapping[str, Any]
) -> Reading | None:
    """The load of a worn clutch from position alone, against the truth; None if it is refused or the search fails."""
    begin = time.perf_counter()
    try:
        result = fit(
            worn.log.without(*without), once.actuator, FitRequest(**{"calibration": once.calibration, **wanted})
        )
    except (SolveError, DataError):
        return None
    seconds = time.perf_counter() - begin
    curve, pressure = result.load_curve, result.recordings["worn"].simulated["pressure_a"]
    answer = Answer(curve.position, curve.force, curve.low, curve.high, pressure)
    of_band = np.median(np.interp(GRID, curve.position, curve.high - curve.low)) / worn.truth.load(GRID).max()
    errors = score(answer, worn.truth, worn.log.time)
    return Reading(
        errors.load, abs(errors.load_touch), abs(errors.half_load), errors.pressure, errors.coverage,
        100 * float(of_band), TRUSTS.index(result.verdict.trust), seconds,
    )  # fmt: skip


def line(rows: Sequence[Row]) -> list[str]:
    """Cells of a case with a remedy over all trucks."""
    table = np.array([row.reading for row in rows if row.reading is not None])
    if not len(table):
        return [""] * 7 + [str(len(rows))]
    median_and_worst = [f"{np.median(column):.2f} /{column.max():6.2f}" for column in table.T]
    trusts = " / ".join(str(int(np.sum(table[:, 6] == i))) for i in range(len(TRUSTS)))
    covered, width = f"{table[:, 4].mean() * 100:.0f}", f"{np.median(table[:, 5]):.1f}"
    return [*median_and_worst[:4], covered, width, trusts, median_and_worst[7], str(len(rows) - len(table))]


def judged(rows: Sequence[Row]) -> str:
    """How well the verdicts tell good readings from bad ones."""
    readings = [row.reading for row in rows if row.reading is not None]
    error, trust = np.array([r.error for r in readings]), np.array([r.trust for r in readings])

    def share(of: np.ndarray, which: np.ndarray) -> str:
        return f"{100 * np.mean(which[of]):.0f} % of {int(of.sum())}" if of.any() else "none"

    bad = error > 2.0
    apart = np.sign(trust[bad][:, None] - trust[~bad][None, :])
    area = f"{np.mean(0.5 + 0.5 * apart):.2f}" if apart.size else "-"
    return (
        f"below 1 %: {share(error < 1.0, trust == 0)} good; good: {share(trust == 0, bad)} above 2 %; "
        f"above 5 %: {share(error > 5.0, trust == 2)} none; AUC of the verdict for above 2 %: {area}"
    )


def main() -> None:
    """Print a row a change and remedy."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=1000)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--case", action="append", choices=tuple(CASES), help="default: all")
    options.add_argument("--remedy", action="append", choices=tuple(REMEDIES), help="default: all")
    options.add_argument("--method", default="shooting", choices=get_args(MethodName))
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    cases, remedies = chosen.case or list(CASES), chosen.remedy or list(REMEDIES)
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    of_a_truck = partial(one_truck, family=chosen.family, cases=cases, remedies=remedies, method=chosen.method)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        rows = [row for of_truck in pool.map(of_a_truck, numbers) for row in of_truck]
    print(f"{'change':<28}{'remedy':<24}" + "".join(f"{title:>16}" for title in TITLES))
    for case in cases:
        for remedy in remedies:
            cells = line([row for row in rows if (row.case, row.remedy) == (case, remedy)])
            print(f"{case:<28}{remedy:<24}" + "".join(f"{cell:>16}" for cell in cells))
    for remedy in remedies:
        print(f"\n{remedy}: {judged([row for row in rows if row.remedy == remedy])}")


if __name__ == "__main__":
    main()
