"""Loads and pressures of the observers: ``python benchmarks/online.py --family A --trucks 4 --seed 0``.

Every truck is calibrated once with pressure. Then its worn clutch is followed from position alone, sample by sample,
from the load of the new clutch, undisturbed or with a fault. Load over 5 to 8 mm, rms in % of the peak, after 2, 10 and
50 strokes and at the end; worse is how much larger that error became than at the start, from 5 strokes on; pressure in
chamber A, rms in kPa; median / worst over the trucks. Covered is the share of the points from 0.5 to 20 mm where the 95
% band of the load at the end holds the truth, width the median of the band from low to high in % of the peak. NIS is
(least to most) the largest mean over 10 s of motion, over that of the calibration recording.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from prove import SECONDS, STROKES_A_METRE

import clutchid
from clutchid import fit
from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import new_record
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.configuration import observer, start
from clutchid.observer.following import observe
from clutchid.observer.methods import METHODS
from clutchid.strokes.stroke import RESOLUTION, Stroke
from clutchid.truck import GRID, Drive, Vehicle, drive, truck

#: Wear of the facing in m.
WEAR = 1.5e-3

#: Strokes after which the load is compared with the truth, and those from which it should not become worse.
AFTER, SETTLED = (2, 10, 50), 5

#: What a calibration with the paper's model and load frees.
PAPER = ("load", "C_vs", "C_ve", "V_0A", "P_S", "P_0", "F_C", "D_v", "C_r", "y_max")


TITLES = (
    "2 strokes [%]", "10 strokes [%]", "50 strokes [%]", "end [%]", "worse [%]", "p_A [kPa]", "covered [%]",
    "width [%]", "us a sample", "NIS [1]",
)  # fmt: skip


class Row(NamedTuple):
    """Errors of a method with a fault on one truck; NaN where there are fewer strokes or the filter diverged."""

    after_2: float
    after_10: float
    after_50: float
    end: float
    worse: float
    pressure: float
    covered: float
    width: float
    microseconds: float
    nis: float


def _of_position(change: Callable[[FloatArray, np.random.Generator], FloatArray]) -> Callable[[Log], Log]:
    """A fault of the position sensor."""
    return lambda log: log.with_columns(position=change(log["position"].copy(), np.random.default_rng(len(log))))


def _frozen(position: FloatArray, random: np.random.Generator) -> FloatArray:
    for begin in random.integers(2000, position.size - 2000, 3):
        position[begin : begin + 500] = position[begin]
    return position


def _spikes(position: FloatArray, random: np.random.Generator) -> FloatArray:
    position[random.integers(0, position.size, 30)] += 5e-3 * random.choice([-1.0, 1.0], 30)
    return position


def _gaps(log: Log) -> Log:
    keep = np.ones(len(log), dtype=bool)
    for begin in np.random.default_rng(len(log)).integers(2000, len(log) - 2000, 3):
        keep[begin : begin + 1000] = False
    return Log(log.time[keep], {name: log[name][keep] for name in log.columns}, name=log.name)


def _late(log: Log) -> Log:
    return log.with_columns(**{name: np.append(log[name][:1], log[name][:-1]) for name in INPUTS})


def _same(log: Log) -> Log:
    return log


def _thinner(kind: Vehicle) -> Vehicle:
    return kind.replace({"D_v": 0.8 * kind.D_v})


def _lower_supply(kind: Vehicle) -> Vehicle:
    return kind.replace({"P_S": 0.95 * kind.P_S})


def _leaking(kind: Vehicle) -> Vehicle:
    return kind.replace({"C_A0": kind.C_A0 + 6e-11})


def _as_it_is(kind: Vehicle) -> Vehicle:
    return kind


#: The fault that the recording is of the next truck.
ANOTHER = "another truck"

#: Faults: what changes of the truck since its calibration, and of the recording.
FAULTS: dict[str, tuple[Callable[[Vehicle], Vehicle], Callable[[Log], Log]]] = {
    "nothing": (_as_it_is, _same),
    "grease 20 % thinner": (_thinner, _same),
    "supply 5 % lower": (_lower_supply, _same),
    "duty one sample late": (_as_it_is, _late),
    "offset of 0.2 mm": (_as_it_is, _of_position(lambda position, _: position + 2e-4)),
    "frozen 3 x 0.5 s": (_as_it_is, _of_position(_frozen)),
    "three gaps of 1 s": (_as_it_is, _gaps),
    "30 spikes of 5 mm": (_as_it_is, _of_position(_spikes)),
    "leak": (_leaking, _same),
    ANOTHER: (_as_it_is, _same),
}


def one_truck(
    number: int,
    family: str,
    faults: Sequence[str],
    methods: Sequence[str],
    seconds: float,
    passes: int,
    calibrations: Path | None,
    conditions: bool,
) -> dict[tuple[str, str], Row]:
    """Errors of every method with every fault on one truck."""
    kind = truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    of_method = {
        method: calibrated(
            kind,
            seeds[0],
            calibrations / f"{family}{number}{mark}.toml" if calibrations else None,
            conditions,
            method == "paper",
        )
        for method in methods
        for mark in [f"{'_paper' if method == 'paper' else ''}{'_supply' if conditions else ''}"]
    }
    rows = {}
    for fault in faults:
        of_truck, of_log = FAULTS[fault]
        driven = truck(number + 1, family) if fault == ANOTHER else kind
        worn = drive(
            of_truck(driven), seconds=seconds, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False,
            conditions=conditions,
        )  # fmt: skip
        log = of_log(worn.log)
        rows |= {(fault, method): followed(of_method[method], worn, log, method, passes) for method in methods}
    return rows


def calibrated(
    kind: Vehicle, seed: int, path: Path | None, conditions: bool = False, paper: bool = False
) -> ParameterFile:
    """The calibration of a truck, read from a file if an earlier run has written it; `paper` with the paper's model."""
    if path is not None and path.exists():
        return clutchid.read_parameters(path)
    log = drive(kind, seconds=SECONDS, seed=seed, name="calibration", conditions=conditions).log
    both = ("position", "pressure_a")
    once = fit(log, measure=both, free=PAPER, method="shooting") if paper else fit(log, measure=both, free=("auto",))
    if path is not None:
        path.parent.mkdir(exist_ok=True)
        clutchid.write_parameters(clutchid.parameter_file(once), path)
    return clutchid.parameter_file(once)


def _stroke_ends(time: FloatArray, position: FloatArray) -> list[int]:
    """The numbers of the samples at which strokes end."""
    rule, stroke = kernels_in("clutchid.strokes.stroke_rule"), new_record(Stroke)
    steps = np.round(np.diff(time, prepend=time[:1]) / RESOLUTION).astype(np.int64).tolist()
    return [i for i, (y, dt) in enumerate(zip(position, steps, strict=True)) if rule.count_stroke(stroke, y, dt)]


def followed(calibrated: ParameterFile, worn: Drive, log: Log, method: str, passes: int) -> Row:
    """Errors of a method on a recording, the last of `passes` passes for pressure and the end."""
    actuator = calibrated.actuator
    follower = observer(actuator, method, calibration=calibrated.calibration)
    state, truth = start(follower), worn.truth.load(GRID)
    touch, ends = (GRID >= 5e-3) & (GRID <= 8e-3), _stroke_ends(worn.log.time, worn.log["position"])

    def error() -> float:
        off = 100 * (follower.load(state).force(GRID) - truth) / truth.max()
        return float(np.sqrt(np.mean(off[touch] ** 2)))

    cuts = [*np.searchsorted(log.time, worn.log.time[ends]).tolist(), len(log)]
    errors, seconds = [error()], 0.0
    pressures: list[FloatArray] = []
    ratios = [1.0]
    for number in range(passes):
        again = Log(log.time + number * (log.time[-1] + 1.0), {name: log[name] for name in log.columns})
        pressures = []
        for begin, end in zip([0, *cuts], cuts, strict=False):
            started = time.perf_counter()
            state, run = observe(follower, state, again.slice(begin, end))
            seconds += time.perf_counter() - started
            pressures.append(run.states[:, actuator.states.index("p_A")])
            ratios.append(float(np.max(run.mismatch, initial=1.0, where=np.isfinite(run.mismatch))))
            errors.append(error())
    true = np.interp(log.time, worn.log.time, worn.truth.states["pressure_a"])
    pressure = np.sqrt(np.nanmean((np.concatenate(pressures) - true) ** 2))
    deviation = follower.load_deviation(state, GRID)
    within = np.abs(follower.load(state).force(GRID) - truth) <= QUANTILE * deviation
    reached = [errors[n] if len(errors) > n + 1 else np.nan for n in AFTER]
    worse = max(errors[SETTLED:], default=np.nan) - errors[0]
    return Row(
        *reached, errors[-1], worse, float(pressure) * 1e-3, 100 * float(within.mean()),
        200 * QUANTILE * float(np.median(deviation)) / truth.max(), seconds / (passes * len(log)) * 1e6,
        max(ratios) if np.isfinite(follower.usual) else np.nan,
    )  # fmt: skip


def main() -> None:
    """Print a row a fault and method."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=4)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--fault", action="append", choices=tuple(FAULTS), help="default: all")
    options.add_argument("--method", action="append", choices=tuple(METHODS), help="default: all")
    options.add_argument("--seconds", type=float, default=60.0, help="of the worn clutch")
    options.add_argument("--passes", type=int, default=1, help="of the same recording, one after the other")
    options.add_argument("--calibrations", type=Path, help="folder in which calibrations are kept for the next run")
    options.add_argument("--conditions", action="store_true", help="the vehicle records its supply pressure")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    faults, methods = chosen.fault or list(FAULTS), chosen.method or list(METHODS)
    of_a_truck = partial(
        one_truck,
        family=chosen.family,
        faults=faults,
        methods=methods,
        seconds=chosen.seconds,
        passes=chosen.passes,
        calibrations=chosen.calibrations,
        conditions=chosen.conditions,
    )
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        trucks = list(pool.map(of_a_truck, range(chosen.seed, chosen.seed + chosen.trucks)))
    print(f"{'fault':<22}{'method':<15}" + "".join(f"{title:>16}" for title in TITLES))
    for fault in faults:
        for method in methods:
            print(f"{fault:<22}{method:<15}" + "".join(f"{cell:>16}" for cell in cells(trucks, fault, method)))


def cells(trucks: Sequence[Mapping[tuple[str, str], Row]], fault: str, method: str) -> list[str]:
    """A line of the table."""
    table = np.array([rows[fault, method] for rows in trucks])
    finite = [column[np.isfinite(column)] for column in table.T]
    both = [f"{np.median(column):.2f} / {column.max():.2f}" if column.size else "-" for column in finite]
    if finite[9].size:
        both[9] = f"{finite[9].min():.2f} to {finite[9].max():.2f}"
    both[6], both[7] = f"{table[:, 6].mean():.0f}", f"{np.nanmedian(table[:, 7]):.1f}"
    return both


if __name__ == "__main__":
    main()
