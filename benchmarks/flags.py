"""Faults of signals in the exported C: ``python benchmarks/flags.py --calibrations FOLDER [--trucks A0,B0]``.

Each truck is calibrated on 30 s with pressure and the conditions. A clutch worn by 2 mm is then followed for 100 s by
the C in float, with supply pressure and air temperature recorded; from 40 s on the inputs have a fault, for 5 s or for
good. Flags are those that no sample of the drive has without the fault: each after how many seconds, and how long the
last one stays after the fault (worst of the trucks). Trust is that before the fault, and the least below that of the
drive without it, by truck; back is the time from the end of the fault until it is that again, inf where it is not at
the end. Load is its error at the end over 5 to 8 mm, rms in % of the peak, and the share of its points in the band, by
truck.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from online import calibrated

from clutchid.exports.c99 import CStyle, compiler, observer_c99
from clutchid.exports.outputs import OUTPUTS
from clutchid.exports.parity import begins_us, begun, replay_program, replayed
from clutchid.log import FloatArray, Log
from clutchid.observer.by_stroke import curve_positions
from clutchid.observer.configuration import Observer, observer, start
from clutchid.observer.flags import FLAGS
from clutchid.truck import GRID, drive, truck

#: Seconds of a drive, at which a fault begins, and for which it lasts unless for good.
SECONDS, BEGINS, LASTS = 100.0, 40.0, 5.0

#: Samples by which an input is changed, by the samples of the fault.
Fault = Callable[[dict[str, FloatArray], FloatArray], None]


def _set(name: str, value: float) -> Fault:
    def change(columns: dict[str, FloatArray], at: FloatArray) -> None:
        columns[name][at] = value

    return change


def _add(name: str, value: float) -> Fault:
    def change(columns: dict[str, FloatArray], at: FloatArray) -> None:
        columns[name][at] += value

    return change


def _scale(name: str, factor: float) -> Fault:
    def change(columns: dict[str, FloatArray], at: FloatArray) -> None:
        columns[name][at] *= factor

    return change


def _held(name: str, noise: float = 0.0) -> Fault:
    def change(columns: dict[str, FloatArray], at: FloatArray) -> None:
        columns[name][at] = columns[name][at[0]] + noise * np.random.default_rng(0).standard_normal(at.size)

    return change


def _some(of: Fault, every: int) -> Fault:
    """A fault of one in so many samples."""
    return lambda columns, at: of(columns, at[::every])


def _noisy(columns: dict[str, FloatArray], at: FloatArray) -> None:
    columns["position"][at] += 1e-4 * np.random.default_rng(0).standard_normal(at.size)


def _creeping(columns: dict[str, FloatArray], at: FloatArray) -> None:
    columns["position"][at] += 1e-7 * np.arange(at.size)


def _late(columns: dict[str, FloatArray], at: FloatArray) -> None:
    for name in ("duty_supply", "duty_exhaust"):
        columns[name][at] = columns[name][at - 1]


def _repeated(columns: dict[str, FloatArray], at: FloatArray) -> None:
    for values in columns.values():
        values[at] = values[at[0]]


#: Faults by name: what changes, and whether for good.
FAULTS: dict[str, tuple[Fault, bool]] = {
    "position missing": (_set("position", np.nan), False),
    "position missing, 1 of 100": (_some(_set("position", np.nan), 100), True),
    "position equal to the last digit": (_held("position"), False),
    "position stuck, with noise of 10 um": (_held("position", 1e-5), False),
    "position 0.4 m": (_set("position", 0.4), False),
    "position 6 mm higher": (_add("position", 6e-3), False),
    "position 0.3 mm higher": (_add("position", 3e-4), False),
    "position 0.3 mm higher, for good": (_add("position", 3e-4), True),
    "position 0.1 mm higher, for good": (_add("position", 1e-4), True),
    "position 2 % too large, for good": (_scale("position", 1.02), True),
    "position 5 % too large, for good": (_scale("position", 1.05), True),
    "position with noise of 100 um": (_noisy, False),
    "position that creeps by 0.1 mm/s": (_creeping, False),
    "spikes of 5 mm, 1 of 100": (_some(_add("position", 5e-3), 100), False),
    "supply duty cycle missing": (_set("duty_supply", np.nan), False),
    "supply duty cycle 1.5": (_set("duty_supply", 1.5), False),
    "supply duty cycle 0": (_set("duty_supply", 0.0), False),
    "supply duty cycle 1": (_set("duty_supply", 1.0), False),
    "exhaust duty cycle 0": (_set("duty_exhaust", 0.0), False),
    "exhaust duty cycle 1": (_set("duty_exhaust", 1.0), False),
    "duty cycles a sample late, for good": (_late, True),
    "samples repeated": (_repeated, False),
    "supply pressure missing": (_set("pressure_supply", np.nan), False),
    "supply pressure missing, for good": (_set("pressure_supply", np.nan), True),
    "supply pressure 0": (_set("pressure_supply", 0.0), False),
    "supply sensor 3 % too high, for good": (_scale("pressure_supply", 1.03), True),
    "supply sensor 7 % too high, for good": (_scale("pressure_supply", 1.07), True),
    "supply sensor 12 % too high, for good": (_scale("pressure_supply", 1.12), True),
    "air 1000 K": (_set("temperature_ambient", 1000.0), False),
    "air 20 K warmer at once, for good": (_add("temperature_ambient", 20.0), True),
    "air missing, for good": (_set("temperature_ambient", np.nan), True),
}

#: Samples that are lost, of those of the fault; whether the time since the last sample has them; whether for good.
LOST: dict[str, tuple[Callable[[FloatArray], FloatArray], bool, bool]] = {
    "1 of 100 samples lost, in dt": (lambda at: at[::100], True, True),
    "1 of 100 samples lost, not in dt": (lambda at: at[::100], False, True),
    "1 of 20 samples lost, not in dt": (lambda at: at[::20], False, True),
    "50 ms lost a second": (lambda at: at[at % 1000 < 50], True, True),
    "no samples": (lambda at: at, True, False),
}


class Case(NamedTuple):
    """A recording with a fault: its samples, with the time since the last one, and where the fault begins and ends."""

    log: Log
    begin: int
    end: int


def cases(log: Log) -> dict[str, Case]:
    """The recordings by their faults."""
    spacing = log.time[1] - log.time[0]
    whole = np.arange(round(BEGINS / spacing), len(log))
    short = whole[: round(LASTS / spacing)]
    recordings = {"nothing": Case(log, int(short[0]), int(short[-1]) + 1)}
    for name, (fault, good) in FAULTS.items():
        columns, at = {key: values.copy() for key, values in log.columns.items()}, whole if good else short
        fault(columns, at)
        recordings[name] = Case(Log(log.time, columns, log.name, log.metadata), int(at[0]), int(at[-1]) + 1)
    for name, (lost, said, good) in LOST.items():
        at = whole if good else short
        keep = np.ones(len(log), dtype=bool)
        keep[lost(at)] = False
        columns = {key: values[keep] for key, values in log.columns.items()}
        time = log.time[keep] if said else log.time[: int(keep.sum())]
        end = int(keep[: at[-1] + 1].sum())
        recordings[name] = Case(Log(time, columns, log.name, log.metadata), int(keep[: at[0]].sum()), end)
    return recordings


class Sound(NamedTuple):
    """Flags that a drive without a fault has after its first quarter, and its trust by time."""

    flags: int
    time: FloatArray
    trust: FloatArray


class Row(NamedTuple):
    """What the C showed in a recording with a fault; NaN where there is nothing."""

    flags: dict[str, float]
    stays: float
    before: int
    least: int
    back: float
    error: float
    inside: float


def followed(program: Path, observed: Observer, case: Case, sound: Sound, truth: FloatArray) -> Row:
    """The C on a recording, beside what it shows without a fault."""
    in_c = replayed(program, observed, case.log)
    column = {name: in_c.outputs[:, i] for i, name in enumerate(OUTPUTS)}
    flags, trust = column["flags"].astype(np.int64), column["trust"].astype(np.int64)
    raised = flags & ~sound.flags
    shown = np.flatnonzero(raised[case.begin :] != 0) + case.begin
    time, over = case.log.time, min(case.end, len(case.log) - 1)
    firsts = {name: np.flatnonzero(raised[case.begin :] >> bit & 1)[:1] for bit, name in enumerate(FLAGS)}
    lower = trust < np.round(np.interp(time, sound.time, sound.trust))
    after = np.flatnonzero(lower[over:]) + over
    force, low, high = in_c.load[:, 0], in_c.load[:, 1], in_c.load[:, 2]
    at = curve_positions(observed)
    engaging, right = (at >= 5e-3) & (at <= 8e-3), np.interp(at, GRID, truth)
    return Row(
        {name: float(time[case.begin + at[0]] - time[case.begin]) for name, at in firsts.items() if at.size},
        max(float(time[shown[-1]] - time[over]), 0.0) if shown.size else 0.0,
        int(trust[case.begin - 1]),
        int(min(trust[case.begin :][lower[case.begin :]], default=trust[case.begin - 1])),
        0.0 if not after.size else np.inf if after[-1] >= len(time) - 1 else float(time[after[-1]] - time[over]),
        100.0 * float(np.sqrt(np.mean((force - right)[engaging] ** 2)) / truth.max()),
        100.0 * float(np.mean(((low <= right) & (right <= high))[engaging])),
    )


def of_truck(name: str, calibrations: Path, chosen: Sequence[str]) -> dict[str, Row]:
    """A row a fault."""
    kind = truck(0, name) if name.startswith("h:") else truck(int(name[1:]), name[0])
    content = calibrated(kind, 1, calibrations / f"{name.replace(':', '')}_seed1.toml", conditions=True)
    worn = drive(kind, seconds=SECONDS, seed=2, wear=2e-3, conditions=True, pressure=False)
    followed_by = observer(content.actuator, "joint", calibration=content.calibration)
    style, truth = CStyle(), worn.truth.load(GRID)
    modules = observer_c99(followed_by, begun(followed_by, start(followed_by)), style, "benchmark")
    with tempfile.TemporaryDirectory() as folder:
        program = replay_program(followed_by, modules, style, begins_us(worn.log), compiler() or "cc", Path(folder))
        whole = replayed(program, followed_by, worn.log).outputs
        flags = whole[whole.shape[0] // 4 :, [*OUTPUTS].index("flags")].astype(np.int64)
        sound = Sound(int(np.bitwise_or.reduce(flags)), worn.log.time, whole[:, [*OUTPUTS].index("trust")])
        recordings = {fault: case for fault, case in cases(worn.log).items() if not chosen or fault in chosen}
        return {fault: followed(program, followed_by, case, sound, truth) for fault, case in recordings.items()}


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    options.add_argument("--trucks", default="A0,B0")
    options.add_argument("--fault", action="append", default=[])
    parsed = options.parse_args()
    trucks = [of_truck(name, parsed.calibrations, parsed.fault) for name in parsed.trucks.split(",")]
    print("| fault | flags, first after [s] | stay [s] | trust | back after [s] | load error, in its band [%] |")
    print("|---|---|---|---|---|---|")
    for fault in trucks[0]:
        rows = [rows[fault] for rows in trucks]
        names = sorted(
            set().union(*(row.flags for row in rows)), key=lambda name: min(r.flags.get(name, 1e9) for r in rows)
        )
        flags = [
            f"`{name}` {max(row.flags[name] for row in rows if name in row.flags):.3g}"
            f"{'' if all(name in row.flags for row in rows) else ' (not all)'}"
            for name in names
        ]
        stays, back = (max(getattr(row, name) for row in rows) for name in ("stays", "back"))
        trust = ", ".join(f"{row.before} to {row.least}" for row in rows)
        error = "; ".join(f"{row.error:.1f}, {row.inside:.0f}" for row in rows)
        print(f"| {fault} | {', '.join(flags)} | {stays:.3g} | {trust} | {back:.3g} | {error} |", flush=True)


if __name__ == "__main__":
    main()
