"""A position zero that moves: ``python benchmarks/zero.py --family A --trucks 8``, and with ``--loads`` what it costs.

First the level of the vented rest against that of a calibration, when nothing has moved: error in µm and the half width
of its interval, for recordings with and without a rest at the stop, over changes of the truck. With ``--loads`` every
truck is calibrated once with pressure, and its clutch read from position alone with a zero that is learned or kept,
with and without wear and an offset of the sensor, subtracted or kept: error of the load over 5 to 8 mm in % of the peak
(median / worst), points from 0.5 to 20 mm in the 95 % band, and the shift of half-load (median / worst error in µm).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any, Literal, NamedTuple

import numpy as np

from clutchid import Fit, FitRequest, fit
from clutchid.errors import ClutchidError
from clutchid.estimation.assess.comparison import ENGAGING, half_load
from clutchid.strokes.vented_rest import rest_shift, vented_rest
from clutchid.truck import GRID, MANOEUVRES, Drive, drive, truck

#: Length of a recording in s, and strokes for a metre of wear.
SECONDS, STROKES = 30.0, 3e8

#: The truck and its sensor, for the levels.
LEVELS: Mapping[str, Mapping[str, Any]] = {
    "the same": {},
    "worn by 3 mm": {"wear": 3e-3, "cycles": 9e5},
    "supply": {"change": "supply"},
    "cold": {"change": "cold"},
    "warm": {"change": "warm"},
    "valves": {"change": "valves"},
    "seals": {"change": "seals"},
    "offset +0.3 mm": {"offset": 3e-4},
    "offset -0.3 mm, seals": {"offset": -3e-4, "change": "seals"},
    "kept zero, worn by 2 mm": {"sensor_zero": "kept", "wear": 2e-3, "cycles": 6e5},
}

#: The truck and its sensor, for the loads, and whether a moved rest is subtracted.
LOADS: Mapping[str, tuple[Mapping[str, Any], Literal["subtract", "keep"]]] = {
    "new, learned": ({}, "subtract"),
    "new, offset +0.3 mm": ({"offset": 3e-4}, "subtract"),
    "new, offset +0.3 mm, kept": ({"offset": 3e-4}, "keep"),
    "worn by 2 mm, learned": ({"wear": 2e-3}, "subtract"),
    "worn by 2 mm, kept zero": ({"wear": 2e-3, "sensor_zero": "kept"}, "subtract"),
    "worn by 2 mm, offset +0.3 mm": ({"wear": 2e-3, "offset": 3e-4}, "subtract"),
    "worn by 2 mm, offset +0.3 mm, kept": ({"wear": 2e-3, "offset": 3e-4}, "keep"),
    "worn by 2 mm, kept zero, offset -0.3 mm": ({"wear": 2e-3, "sensor_zero": "kept", "offset": -3e-4}, "subtract"),
}


#: Parts of recordings of 20 s, in samples.
CUTS = ((0, 20000), (1000, 20000), (5000, 9000), (9000, 16000), (3300, 5200), (12000, 20000))


class Read(NamedTuple):
    """A load that was read: error in % of the peak, share of points covered, error of half-load in µm, and trust."""

    error: float
    covered: float
    half: float
    trust: str


def recording(number: int, family: str, case: int, options: Mapping[str, Any]) -> Drive:
    """A drive of a case; cases have seeds of their own, alike for all trucks."""
    wear = options.get("wear", 0.0)
    return drive(
        truck(number, family), seconds=SECONDS, seed=100 + case, pressure=False, **{"cycles": wear * STROKES, **options}
    )


def levels(family: str, numbers: Sequence[int]) -> list[str]:
    """Rows of the table of levels."""
    rows = [f"{'levels of the rest':<26}{'at the stop':>34}{'after strokes only':>40}"]
    rows += [
        f"{'':<26}{'rms, worst [µm]':>18}{'± [µm]':>8}{'covered':>8}"
        + f"{'rms, worst [µm]':>24}{'± [µm]':>8}{'covered':>8}"
    ]
    before = {n: vented_rest(drive(truck(n, family), seconds=SECONDS, seed=1).log) for n in numbers}
    for case, (name, options) in enumerate(LEVELS.items()):
        row = f"{name:<26}"
        for begin in (0, 1000):
            errors, halves, covered = [], [], 0
            for n in numbers:
                driven = recording(n, family, case, options)
                now, usual = vented_rest(driven.log.slice(begin, len(driven.log))), before[n]
                shift = rest_shift(usual, now) if usual and now else None
                if shift is not None:
                    errors.append(1e6 * (shift.value - driven.truth.shift))
                    halves.append(1e6 * (shift.high - shift.low) / 2)
                    covered += shift.low <= driven.truth.shift <= shift.high
            rms, worst = float(np.sqrt(np.mean(np.square(errors)))), max(errors, key=abs)
            row += f"{f'{rms:.0f}, {worst:+.0f}':>{18 if begin == 0 else 24}}{median(halves):>8.0f}"
            row += f"{f'{covered}/{len(errors)}':>8}"
        rows.append(row)
    return rows


def cuts(family: str, numbers: Sequence[int]) -> list[str]:
    """How often a rest that has not moved is taken to have, in any manoeuvre, and in parts cut out anywhere."""
    moved, compared = [], 0
    for n in numbers:
        before = vented_rest(drive(truck(n, family), seconds=SECONDS, seed=1).log)
        for manoeuvre in MANOEUVRES:
            log = drive(truck(n, family), seconds=20.0, seed=7, manoeuvre=manoeuvre, pressure=False).log
            for begin, end in CUTS:
                now = vented_rest(log.slice(begin, end))
                shift = rest_shift(before, now) if before and now else None
                compared += shift is not None
                if shift is not None and shift.moved:
                    moved.append(f"truck {n}, {manoeuvre}, {begin} to {end} ms: {1e3 * shift.value:+.3f} mm")
    return [f"{len(moved)} of {compared} parts seem to have moved", *moved]


def read(driven: Drive, once: Fit, zero: Literal["subtract", "keep"]) -> Read | None:
    """A load from position alone against the truth; None where it cannot be read."""
    try:
        result = fit(driven.log, once.actuator, request=FitRequest(calibration=once.calibration), zero=zero)
    except ClutchidError:
        return None
    curve, truth = result.load_curve, driven.truth.load(GRID)
    force, low, high = (np.interp(GRID, curve.position, side) for side in (curve.force, curve.low, curve.high))
    engaging = (ENGAGING[0] <= GRID) & (ENGAGING[1] >= GRID)
    error = 100.0 * float(np.abs(force - truth)[engaging].max() / truth.max())
    fine = np.linspace(0.0, 0.02, 4001)
    at = half_load(fine, driven.truth.load(fine))
    compared = result.comparison
    half = 1e6 * (compared.half_now.position - at) if compared else float("nan")
    return Read(error, float(np.mean((low <= truth) & (truth <= high))), half, result.verdict.trust)


def loads(family: str, numbers: Sequence[int]) -> list[str]:
    """Rows of the table of loads."""
    by_name: dict[str, list[Read | None]] = {name: [] for name in LOADS}
    for n in numbers:
        log = drive(truck(n, family), seconds=SECONDS, seed=1, name="calibration").log
        once = fit(log, measure=("position", "pressure_a"), free=("auto",))
        for name, (options, zero) in LOADS.items():
            case = 50 + int(bool(options.get("wear")))  # the same drive with every sensor
            by_name[name].append(read(recording(n, family, case, options), once, zero))
        print(
            f"truck {n}: {', '.join(f'{own[-1].error:.2f}' if own[-1] else '-' for own in by_name.values())}",
            flush=True,
        )
    rows = [f"{'load':<42}{'error [%]':>14}{'covered':>9}{'half-load [µm]':>18}{'good':>6}{'refused':>9}"]
    for name, results in by_name.items():
        readings = [reading for reading in results if reading is not None]
        if not readings:
            rows.append(f"{name:<42}{'':>47}{len(results):>9}")
            continue
        errors, halves = [reading.error for reading in readings], [reading.half for reading in readings]
        rows.append(
            f"{name:<42}{f'{median(errors):.2f} / {max(errors):.2f}':>14}"
            f"{f'{100 * np.mean([reading.covered for reading in readings]):.0f} %':>9}"
            f"{f'{median(np.abs(halves)):.0f} / {max(np.abs(halves)):.0f}':>18}"
            f"{sum(reading.trust == 'good' for reading in readings):>6}{len(results) - len(readings):>9}"
        )
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--family", default="A", choices=("A", "B"))
    parser.add_argument("--trucks", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0, help="number of the first truck")
    parser.add_argument("--loads", action="store_true", help="calibrate and read as well")
    parser.add_argument(
        "--cuts", action="store_true", help="any manoeuvre, cut anywhere, with a zero that has not moved"
    )
    arguments = parser.parse_args()
    numbers = range(arguments.seed, arguments.seed + arguments.trucks)
    rows = (cuts if arguments.cuts else loads if arguments.loads else levels)(arguments.family, numbers)
    print(f"family {arguments.family}, trucks {numbers[0]} to {numbers[-1]}", *rows, sep="\n")


if __name__ == "__main__":
    main()
