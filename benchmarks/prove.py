"""How far is a load from the truth, by method: ``python benchmarks/prove.py --trucks 24 --seed 1000 --workflow paper``.

The proving ground. Every virtual truck is recorded once with pressure and twice with a worn clutch from position alone.
A workflow is a function from those recordings to a load for each worn one. Errors are median / worst over the worn
recordings: load, rms over 0.5 to 20 mm, and over 5 to 8 mm, in % of the true peak; half load, the position where the
rising load reaches half its peak; p_A, rms of the chamber pressure. Covered is the share of the grid where the band
holds the true load, ± its 95 % interval for independent trucks; seconds are the median of a truck. Methods are chosen
on the trucks 0 to 23 and reported on 1000 to 1023.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np

from clutchid import Actuator, Fit, FitRequest, Log, Partition, SolveError, fit, simulate
from clutchid.estimation.assess.comparison import half_load
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.fit import MethodName
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.truck import CHANGES, GRID, Drive, Truth, drive, truck
from clutchid.verbs.virtual_fleet import STROKES_A_METRE

__all__ = ["SECONDS", "STROKES_A_METRE", "Answer", "Score", "score"]

#: Length of every recording in s.
SECONDS = 30.0

#: Wear of the facing in m in the two worn recordings.
WEAR = ((0.5e-3, 1.75e-3), (1.75e-3, 3.0e-3))

#: Range of the grid around the touch point, in m.
TOUCH = (5e-3, 8e-3)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """A load curve in N over positions in m with its 95 % band, and the chamber pressure in Pa at every sample."""

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray
    pressure_a: FloatArray


#: Function of a calibration recording with pressure and worn recordings with position only; one answer for each.
Workflow = Callable[[Log, Sequence[Log]], Sequence[Answer]]


class Score(NamedTuple):
    """Errors of one answer in %, %, mm and kPa, and the share of the grid where its band holds the true load."""

    load: float
    load_touch: float
    half_load: float
    pressure: float
    coverage: float


def score(answer: Answer, truth: Truth, time: FloatArray) -> Score:
    """Score `answer` against the truth of its recording, whose samples are at `time` in s.

    Raises
    ------
    ValueError
        If the curve does not cover the grid or is not finite there.
    """
    force, low, high = (np.interp(GRID, answer.position, c) for c in (answer.force, answer.low, answer.high))
    if answer.position[0] > GRID[0] or answer.position[-1] < GRID[-1] or not np.isfinite(force).all():
        raise ValueError("the load curve must be finite from 0.5 to 20 mm")
    true = truth.load(GRID)
    error = (force - true) / true.max() * 100
    near = (TOUCH[0] - 1e-9 < GRID) & (TOUCH[1] + 1e-9 > GRID)
    fine = np.linspace(0.0, GRID[-1], 4001)
    halves = [half_load(fine, np.interp(fine, answer.position, answer.force)), half_load(fine, truth.load(fine))]
    pressure = answer.pressure_a - np.interp(time, truth.time, truth.states["pressure_a"])
    return Score(
        load=_rms(error),
        load_touch=_rms(error[near]),
        half_load=(halves[0] - halves[1]) * 1e3,
        pressure=_rms(pressure[np.isfinite(pressure)]) * 1e-3,
        coverage=float(np.mean((low <= true) & (true <= high))),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def paper_method(partition: Partition | None, calibration: Log, worn: Sequence[Log]) -> list[Answer]:
    """The paper: position only, Appendix A, three splines; the calibration recording is not used."""
    del calibration
    return [answer_of(fit(log, request=FitRequest(partition=partition)), log) for log in worn]


def calibrated(
    model: str,
    adapt: Callable[[Fit, Log], Fit],
    calibration: Log,
    worn: Sequence[Log],
    *,
    method: MethodName = "shooting",
) -> list[Answer]:
    """Calibrate once with pressure, then estimate the load of every worn recording from position alone."""
    both = ("position", "pressure_a")
    once = fit(calibration, Actuator(model=model), measure=both, free=("auto",), method=method)
    return [answer_of(adapt(once, log), log) for log in worn]


def adapted(once: Fit, log: Log, method: MethodName = "shooting") -> Fit:
    """Default: only the load is free, corrected by the position-only bias on the calibration recording."""
    return fit(log, once.actuator, request=FitRequest(calibration=once.calibration), method=method)


def by_simulation(partition: Partition | None, once: Fit, log: Log) -> Fit:
    """The paper's simulation error method with the calibrated actuator; no prior on the load."""
    return fit(log, once.actuator, request=FitRequest(partition=partition))


def not_adapted(once: Fit, log: Log) -> Fit:
    """The load of the new clutch, without adaptation."""
    return replace(fit(log, once.actuator, free=()), load_curve=once.load_curve)


def uncorrected(once: Fit, log: Log) -> Fit:
    """As `adapted`, without the bias correction."""
    assert once.calibration is not None
    return fit(log, once.actuator, request=FitRequest(calibration=replace(once.calibration, position_only=None)))


def with_mean_valves(once: Fit, log: Log) -> Fit:
    """As `adapted`, with valves averaged over the period, as in the paper."""
    return adapted(replace(once, actuator=once.actuator.replace({"T_pwm": 0.0})), log)


def answer_of(result: Fit, log: Log) -> Answer:
    """Load and pressure of a fit; pressure from the fit if it follows the position, else by ballistic simulation."""
    if result.status == "failed":
        raise SolveError(result.message)
    curve, recording = result.load_curve, result.recordings[log.name]
    if result.follows:
        pressure = recording.simulated["pressure_a"]
    else:
        simulation = simulate(result.actuator, log, starts=recording.starts, on_failure="return")
        pressure = simulation.log["pressure_a"]
    return Answer(curve.position, curve.force, curve.low, curve.high, pressure)


#: Workflows by name; the first is the paper's method.
WORKFLOWS: dict[str, Workflow] = {
    "paper": partial(paper_method, None),
    "paper-every-200": partial(paper_method, Partition(every=200)),
    "paper-every-200-q": partial(paper_method, Partition(every=200, carry="q")),
    "paper-8-parts": partial(paper_method, Partition(parts=8)),
    "calibrated": partial(calibrated, AUTOMATIC, adapted),
    "calibrated-uncorrected": partial(calibrated, AUTOMATIC, uncorrected),
    "calibrated-mean-valves": partial(calibrated, AUTOMATIC, with_mean_valves),
    "calibrated-no-stribeck": partial(calibrated, "energy-balance", adapted),
    "calibrated-isothermal": partial(calibrated, "isothermal-stribeck", adapted),
    "calibrated-not-adapted": partial(calibrated, AUTOMATIC, not_adapted),
    "calibrated-every-200": partial(calibrated, AUTOMATIC, partial(by_simulation, Partition(every=200))),
    "calibrated-prediction-error": partial(
        calibrated, AUTOMATIC, partial(adapted, method="prediction-error"), method="prediction-error"
    ),
    "calibrated-ballistic": partial(calibrated, AUTOMATIC, partial(by_simulation, None)),
}


def recordings(number: int, family: str, changes: Sequence[str]) -> tuple[Drive, list[Drive]]:
    """The calibration recording of a truck, and its worn ones under some changes.

    Wear, manoeuvres and seeds depend on the number only.
    """
    new = truck(number, family)
    rng = np.random.default_rng([number, 1])
    wear = [float(rng.uniform(*limits)) for limits in WEAR]
    seeds = rng.integers(0, 2**31, 1 + len(wear)).tolist()
    calibration = drive(new, seconds=SECONDS, seed=seeds[0], name="calibration")
    worn = [
        drive(
            new, seconds=SECONDS, seed=seed, wear=facing, cycles=facing * STROKES_A_METRE, pressure=False,
            change=changes, name=f"worn{i}",
        )
        for i, (seed, facing) in enumerate(zip(seeds[1:], wear, strict=True), 1)
    ]  # fmt: skip
    return calibration, worn


class Proof(NamedTuple):
    """Scores of a workflow on the worn recordings of one truck, none if it failed, and its time in s."""

    scores: tuple[Score, ...]
    seconds: float


def proof(number: int, name: str, family: str, changes: Sequence[str]) -> Proof:
    """Run a workflow on one truck; it fails by an exception, or a curve that is not finite."""
    calibration, worn = recordings(number, family, changes)
    begin = time.perf_counter()
    try:
        logs = [replace(driven.log.without("pressure_a"), metadata={}) for driven in worn]
        answers = WORKFLOWS[name](calibration.log, logs)
        scores = [score(answer, driven.truth, driven.log.time) for answer, driven in zip(answers, worn, strict=True)]
    except Exception as error:
        print(f"{name}, truck {number}: {type(error).__name__}: {error}", file=sys.stderr)
        scores = []
    return Proof(tuple(scores), time.perf_counter() - begin)


#: Columns of the table.
TITLES = ("failed", "0.5-20 mm [%]", "5-8 mm [%]", "half load [mm]", "p_A [kPa]", "covered [%]", "seconds")


def cells(proofs: Sequence[Proof]) -> list[str]:
    """Cells of a workflow over all trucks."""
    scored = [proof for proof in proofs if proof.scores]
    failed, seconds = str(len(proofs) - len(scored)), f"{np.median([proof.seconds for proof in proofs]):.1f}"
    if not scored:
        return [failed, *[""] * 5, seconds]
    errors = np.abs([errors for proof in scored for errors in proof.scores])
    places = zip(errors.T[:4], (2, 2, 3, 1), strict=True)
    median_and_worst = [f"{np.median(column):.{n}f} / {column.max():.{n}f}" for column, n in places]
    shares = np.array([np.mean([errors.coverage for errors in proof.scores]) for proof in scored])
    half = 100 * QUANTILE * shares.std(ddof=1) / np.sqrt(len(shares)) if len(shares) > 1 else float("nan")
    return [failed, *median_and_worst, f"{100 * shares.mean():.1f} ± {half:.1f}", seconds]


def main() -> None:
    """Print a row a workflow."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=24)
    options.add_argument("--seed", type=int, default=0, help="number of the first truck")
    options.add_argument("--family", default="A", help="A, B, or h:SEED for a hybrid")
    options.add_argument("--change", action="append", choices=tuple(CHANGES), default=[], help="of the worn recordings")
    options.add_argument("--workflow", action="append", choices=tuple(WORKFLOWS), help="default: paper")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    print(f"{'workflow':<28}" + "".join(f"{title:>17}" for title in TITLES))
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        for name in chosen.workflow or ["paper"]:
            of_a_truck = partial(proof, name=name, family=chosen.family, changes=chosen.change)
            row = cells([*pool.map(of_a_truck, numbers)])
            print(f"{name:<28}" + "".join(f"{cell:>17}" for cell in row), flush=True)


if __name__ == "__main__":
    main()
