"""Phase of the carrier from position alone: ``python benchmarks/phase.py --family h --trucks 24``.

Every truck is calibrated once with pressure (kept in ``--folder``); its worn clutch is then recorded under one change
at a time. Compared are a pass of the filter with derivatives for each of ten phases and two steps, as in a slow
recording, and `filtered_phase`, in which the phases share gains and derivatives: both phases in periods, their
difference, the error of each where the duty cycles change on the grid of the carrier, which is hidden here, and the
processor's time in s. Trucks without a carrier are left out. With ``--bus`` the recordings have 100 Hz; there is no
grid to compare with, and trucks whose pulses the bus loses are left out too.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from readings import LACKING, calibration_of
from widening import worn_clutch

from clutchid.estimation import phase as estimated
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.estimation.prediction import predict_errors
from clutchid.inference.problem import Problem
from clutchid.log import FloatArray, Log, sample_interval
from clutchid.numerics.failure import Failure
from clutchid.preparation.prepare import CALIBRATED_MARGIN
from clutchid.preparation.pulses import Duties, centred, duties_in
from clutchid.simulation.stiffness import stiffness
from clutchid.strokes.duty_cycle import grid_phase
from clutchid.strokes.vented_rest import from_rest


class Row(NamedTuple):
    """Phases with gains of their own and with shared ones, that of the grid, and seconds of the processor."""

    own: float
    shared: float
    grid: float
    seconds_own: float
    seconds_shared: float


def _adapted(problem: Problem, x: FloatArray) -> estimated.Adapted:
    """A Gauss-Newton step with derivatives of its own; the cost is infinite if the filter fails."""
    prediction = predict_errors(problem, x)
    if isinstance(prediction, Failure):
        return estimated.Adapted(np.inf, x)
    at, most = prediction.linearisation(), estimated._LARGEST_STEP
    step = np.clip(np.linalg.lstsq(at.R, -at.q, rcond=None)[0], -most, most)
    after = at.R @ step + at.q
    cost = prediction.cost - float(at.q @ at.q - after @ after)
    return estimated.Adapted(cost, np.clip(x + step, *problem.bounds()))


def with_own_gains(log: Log, calibrated: ParameterFile, bus: bool) -> float:
    """The phase by two passes with derivatives at each of ten phases."""
    assert calibrated.calibration is not None, "the calibration had pressure"
    actuator, seconds = calibrated.actuator, estimated._DURATION_SLOW if bus else estimated.DURATION
    part = log.slice(0, min(len(log), round(seconds / sample_interval(log.time))))
    once = estimated._problem(part, actuator, calibrated.calibration)
    at_phase = partial(estimated._at_phase, once)
    if bus:
        at_phase = partial(estimated._on_grid, once, part, actuator, CALIBRATED_MARGIN * stiffness(actuator))
    start, count = np.zeros(len(once.coordinates)), estimated.PHASES
    problems = [at_phase(centred(at / count)) for at in range(count)]
    first = [_adapted(problem, start).x for problem in problems]
    costs = np.array([_adapted(problem, x).cost for problem, x in zip(problems, first, strict=True)])
    return centred((int(np.argmin(costs)) + estimated._vertex(costs)) / count)


def rows(number: int, family: str, changes: list[str], folder: Path, bus: bool) -> Iterator[tuple[str, Row]]:
    """A row a change of a truck; none without a carrier."""
    calibrated = calibration_of(number, family, folder / f"{family.replace(':', '')}_{number:05d}.toml")
    period = calibrated.actuator.parameters.T_pwm
    assert calibrated.calibration is not None, "the calibration had pressure"
    for change in changes if period > 0.0 else ():
        log = worn_clutch(number, family, change, bus).log.without(*LACKING["position"])
        log = from_rest(log, calibrated.calibration.rest, "subtract").log
        if bus and duties_in(log, calibrated.actuator) in (Duties.RECORDED, Duties.UNKNOWN):
            continue
        grid = None if bus else grid_phase(log, period)
        begin = time.process_time()
        own = with_own_gains(log, calibrated, bus)
        middle = time.process_time()
        shared = estimated.filtered_phase(log, calibrated.actuator, calibrated.calibration)
        end = time.process_time()
        yield change, Row(own, shared, np.nan if grid is None else centred(grid), middle - begin, end - middle)


def main() -> None:
    """Print a row a truck and change, then the worst of all."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B", "h"))
    options.add_argument("--trucks", type=int, default=6)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--changes", default="nothing,cold,warm")
    options.add_argument("--folder", type=Path, default=Path("calibrations"))
    options.add_argument("--bus", action="store_true", help="recordings at 100 Hz")
    chosen = options.parse_args()
    chosen.folder.mkdir(exist_ok=True)
    compared = []
    for seed in range(chosen.seed, chosen.seed + chosen.trucks):
        number, family = (0, f"h:{seed}") if chosen.family == "h" else (seed, chosen.family)
        for change, row in rows(number, family, chosen.changes.split(","), chosen.folder, chosen.bus):
            compared.append(row)
            apart = centred(row.shared - row.own)
            cells = "".join(f"{value:+9.3f}" for value in (row.own, row.shared, apart, row.grid))
            print(
                f"{chosen.family}{seed:<6}{change:<10}{cells}{row.seconds_own:8.2f}{row.seconds_shared:8.2f}",
                flush=True,
            )
    own, shared, grid, *seconds = np.transpose(compared)
    worst = [np.fmax.reduce(np.abs(centred(a - b))) for a, b in ((shared, own), (own, grid), (shared, grid))]
    print(f"worst: apart {worst[0]:.3f}, from the grid {worst[1]:.3f} and {worst[2]:.3f} of a period")
    ratio = np.median(seconds[1] / seconds[0])
    print(f"seconds: {np.median(seconds[0]):.2f} and {np.median(seconds[1]):.2f}, ratio {ratio:.2f}")


if __name__ == "__main__":
    main()
