"""Phase of the carrier from position alone: ``python benchmarks/phase.py --trucks 6 --seed 0``.

Every truck of the proving ground is calibrated once with pressure; then its worn clutch is recorded under one change at
a time. The duty cycles of these trucks change on the grid of the carrier, which gives the true phase; here it is
hidden, as on a control unit whose duty cycles are not latched. Compared are `find_phase`, which simulates the
calibrated actuator, and `filtered_phase`, which adapts load and friction: error of the phase in periods, and of the
load read with it, rms over 0.5 to 20 mm in % of the peak.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
from widening import CASES, WEAR

import clutchid
from clutchid.estimation import phase as estimated
from clutchid.preparation import pulses
from clutchid.preparation.pulses import centred
from clutchid.strokes.duty_cycle import grid_phase
from clutchid.study.proving.ground import STROKES
from clutchid.study.proving.scores import Answer, score
from clutchid.truck import Drive, drive, truck

USED = ("nothing", "cold", "warm", "supply", "cold and valves")


def recordings(number: int, seconds: float) -> Iterator[tuple[str, Drive]]:
    """The calibration recording of a truck, then its worn clutch under every change."""
    kind = truck(number)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    yield "calibration", drive(kind, seconds=seconds, seed=seeds[0], name="calibration")
    for change in USED:
        changes, _ = CASES[change]
        yield change, drive(
            kind, seconds=seconds, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES, pressure=False, change=changes,
            name="worn",
        )  # fmt: skip


def load_error(driven: Drive, once: clutchid.Fit, phase: float) -> float:
    """Error of the load that is read with a phase, in % of the peak."""

    kept, estimated.filtered_phase = estimated.filtered_phase, lambda _log, _actuator, **_known: phase
    try:
        found = clutchid.fit(driven.log, once.actuator, request=clutchid.FitRequest(calibration=once.calibration))
    finally:
        estimated.filtered_phase = kept
    curve = found.load_curve
    pressure = found.recordings[driven.log.name].simulated["pressure_a"]
    answer = Answer(curve.position, curve.force, curve.low, curve.high, pressure)
    return float(score(answer, driven.truth, driven.log.time).load)


def main() -> None:
    """Print a row a truck and change, then medians and worst by change."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=6)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--seconds", type=float, default=15.0)
    chosen = options.parse_args()
    rows: dict[str, list[tuple[float, ...]]] = {change: [] for change in USED}
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        (_, first), *worn = recordings(number, chosen.seconds)
        once = clutchid.fit(first.log, measure="position,pressure_a", free="auto")
        for change, driven in worn:
            true = grid_phase(driven.log, once.actuator.parameters.T_pwm)
            if true is None or once.calibration is None:
                continue
            pulses.grid_phase = lambda _log, _period: None
            begin = time.perf_counter()
            before = pulses.find_phase(driven.log, once.actuator)
            middle = time.perf_counter()
            after = estimated.filtered_phase(driven.log, once.actuator, once.calibration)
            end = time.perf_counter()
            errors = [load_error(driven, once, phase) for phase in (before, after)]
            row = (centred(before - true), centred(after - true), *errors, middle - begin, end - middle)
            pulses.grid_phase = grid_phase
            rows[change].append(row)
            print(f"{number:5d}  {change:<20}" + "".join(f"{value:+8.2f}" for value in row), flush=True)
    print(f"\n{'median / worst of':<22}{'phase, simulated':>18}{'phase, filtered':>18}{'load [%]':>16}{'load [%]':>16}")
    for change, found in rows.items():
        table = np.abs(np.array(found))
        if table.size:
            cells = [f"{np.median(column):.2f} / {column.max():.2f}" for column in table.T[:4]]
            print(f"{change:<22}{cells[0]:>18}{cells[1]:>18}{cells[2]:>16}{cells[3]:>16}")


if __name__ == "__main__":
    main()
