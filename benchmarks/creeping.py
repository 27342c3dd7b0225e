"""Pistons that creep back, on line: ``python benchmarks/creeping.py --family A --family h:21 --trucks 2 --seed 5100``.

The vented rest alone is watched (`clutchid.observer.rest`), without a filter. A truck gives a calibration and drives of
all manoeuvres, with rests of 0.2 to 2 s, with rests that become longer or shorter, with exhausts that close at some or
at all rests where the piston has come to 0.7 to 2.5 mm, with half of the return force, also cold, and with each change.
Each is watched from its start at the stop, and from its 9th second on, as after a hole. "Creeping" is the same where
the piston lags behind below 3 mm, as no truck of the families does: 80 to 95 % of it with 0.05 to 0.4 s, the rest with
0.5 to 2 s. The calibration creeps as well ("always"), or does not ("since"), or has a hold at 1.8 mm for its rests
after a stroke ("a hold").

False is a shift more than 0.1 mm off, at which the observer forgets, in recordings, and in those at whose end it still
is, with the share of the time. Moved are sensors by 0.3 mm either way, at the start, in a stroke after 12 s, or in a
hole: found to 0.1 mm, and after how many seconds (median, 90 %). ``--limit STOPPED=inf`` repeats it with another
constant. ``--closed`` is another table: positions held for 60 s with both valves closed after they were reached, to
which a rate of the sensor is added; found is a rise of 0.1 mm above the lowest median of 0.5 s since the second one.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator
from inspect import getsource
from typing import Any

import numpy as np

from clutchid.codegen.records import new_record
from clutchid.errors import ParameterError
from clutchid.log import FloatArray, Log
from clutchid.observer import rest_rule
from clutchid.observer.inputs import window_size
from clutchid.observer.rest import WRONG, Rest, RestBefore
from clutchid.strokes.rest_shift import level_interval
from clutchid.strokes.vented_rest import VentedRest, vented_rest
from clutchid.truck import MANOEUVRES, Vehicle, drive, truck
from clutchid.truck.assembly import at_rest, load_curve
from clutchid.truck.changes import CHANGES, changed
from clutchid.truck.manoeuvres import ClutchPoints, hold, ramp
from clutchid.truck.running import run_truck
from clutchid.truck.settings import Course

#: Length of a drive in s, first sample after the hole, and the position in m below which a piston creeps.
SECONDS, HOLE, CREEPS = 40, 9000, 3e-3

#: The text of the rule that is compiled, so that its constants can be others.
RULE: dict[str, Any] = {"__name__": "rule"}
exec(compile(getsource(rest_rule), "rule", "exec"), RULE)

#: Position in m and duty cycles.
Drive = tuple[FloatArray, FloatArray]


def course(points: ClutchPoints, random: np.random.Generator, rests: list[tuple[float, float]]) -> FloatArray:
    """Set points in m of strokes with rests of so many seconds, least and most, in one part after the other."""
    parts, until = [hold(0.0, 0.3)], 0.0
    for least, most in rests:
        until += 1e3 * SECONDS / len(rests)
        while sum(part.size for part in parts) < until:
            top = points.full - random.uniform(0.0, 2e-3)
            parts.append(hold(top, random.uniform(0.4, 0.8)))
            if random.random() < 0.5:
                above, below = points.touch + random.uniform(5e-4, 2.5e-3), max(points.touch - 3e-3, 1e-3)
                parts += [ramp(top, above, 0.15), ramp(above, below, random.uniform(0.25, 0.8))]
            parts.append(hold(0.0, float(np.exp(random.uniform(np.log(least), np.log(most))))))
    return np.concatenate(parts)[: 1000 * SECONDS]


def driven(kind: Vehicle, seed: int, rests: list[tuple[float, float]], early: float = 0.0) -> Drive:
    """A drive with such rests; at a share of them the exhaust closes early."""
    random, curve = np.random.default_rng(seed), load_curve(kind)
    wanted = course(ClutchPoints(curve.touch - curve.rest, kind.y_max - curve.rest - 2e-3), random, rests)
    noise, forced = kind.parts.sensor.position_noise(kind, wanted.size, random), np.full((wanted.size, 2), np.nan)
    supply, working = kind.parts.supply.start(kind, random)
    start = at_rest(kind, curve, supply)
    outputs = run_truck(kind, Course(wanted, forced, noise), start=start, working=working).outputs
    edges = np.flatnonzero(np.diff(wanted < 1e-4)) + 1
    for a, b in zip(edges, [*edges[1:], wanted.size], strict=True):
        low = np.flatnonzero(outputs.measured[a:b] < random.uniform(0.7e-3, 2.5e-3))
        if wanted[a] < 1e-4 and low.size and random.random() < early:
            forced[a + low[0] : b] = 0.0
            outputs = run_truck(kind, Course(wanted, forced, noise), start=start, working=working).outputs
    return outputs.measured, outputs.duties


def drives(kind: Vehicle) -> Iterator[tuple[str, Drive]]:
    """Drives of a truck by name."""
    for seed, name in enumerate(MANOEUVRES):
        log = drive(kind, seconds=30, seed=2 + seed, manoeuvre=name, pressure=False).log
        yield name, (log["position"], log.duties())
    half = kind.replace({"F_r": max(1.0, kind.F_r / 2), "k_r": kind.k_r / 2})
    any_rest, short, usual, long = (0.2, 2.0), (0.2, 0.5), (0.3, 1.2), (0.6, 2.0)
    yield "rests of 0.2 to 2 s", driven(kind, 20, [any_rest])
    yield "short, long, short", driven(kind, 21, [short, long, short])
    yield "half the return force", driven(half, 22, [any_rest])
    yield "half, long, short, long", driven(half, 23, [long, short, long])
    yield "exhausts close early", driven(kind, 24, [usual], 0.4)
    yield "all exhausts close early", driven(kind, 25, [usual], 1.0)
    yield "half, exhausts close early", driven(half, 26, [usual], 0.4)
    for seed, name in enumerate(CHANGES):
        try:
            yield name, driven(changed(half if name == "cold" else kind, name), 30 + seed, [any_rest])
        except ParameterError:  # the truck does not admit it
            continue


def crept(position: FloatArray, random: np.random.Generator) -> FloatArray:
    """The position of a piston that lags behind where it is low, in steps of 12 µm."""
    quick, slow = float(np.exp(random.uniform(np.log(0.05), np.log(0.4)))), random.uniform(0.5, 2.0)
    share = random.uniform(0.05, 0.2)
    after = (1.0 - share) * lagging(position, 1e-3 / quick) + share * lagging(position, 1e-3 / slow)
    return np.round(after / 12e-6) * 12e-6


def lagging(position: FloatArray, rate: float) -> FloatArray:
    """The position, which it comes nearer to by a share at each sample where it is low and above it."""
    after, y = [], float(position[0])
    for at in position.tolist():
        y = at if at > CREEPS or at >= y else y - (y - at) * rate
        after.append(y)
    return np.array(after)


def shift(before: VentedRest, position: FloatArray, duties: FloatArray) -> FloatArray:
    """The shift in m as known at each sample."""
    size, shifts = window_size(1e-3), np.zeros(position.size)
    level = level_interval(before.quantum)
    calibrated = new_record(
        RestBefore, exists=1, lowest=before.lowest, returned=before.returned, level=level, range=1.25e-4, bin=size.bin,
        bins=size.bins, vents=50,
    )  # fmt: skip
    rest, memory = new_record(Rest, lowest=np.nan), (np.zeros(size.bin), np.zeros(size.bins))
    watch_rest: Callable[..., bool] = RULE["watch_rest"]
    for i, (y, (supply, exhaust)) in enumerate(zip(position.tolist(), duties.tolist(), strict=True)):
        shifts[i] = rest.shift
        watch_rest(rest, calibrated, *memory, y, supply, exhaust)
    return shifts


class Table:
    """False shifts and moved sensors of trucks."""

    def __init__(self) -> None:
        self.false: dict[str, list[FloatArray]] = defaultdict(list)
        self.moved: dict[str, list[tuple[float, bool]]] = defaultdict(list)

    def add(self, row: str, before: VentedRest | None, drive: Drive) -> None:
        """Watch a drive against a calibration."""
        if before is None:
            return
        position, duties = drive
        for begin, name in ((0, "from the stop"), (HOLE, "after a hole")):
            off = np.abs(shift(before, position[begin:], duties[begin:])) > WRONG
            self.false[f"{row}, {name}"].append(off)
        strokes = np.flatnonzero(position > 1e-2)
        in_stroke = int(strokes[min(np.searchsorted(strokes, 12000), strokes.size - 1)])
        for by in (3e-4, -3e-4):
            for name, begin, at in (("start", 0, 0), ("stroke", 0, in_stroke), ("hole", HOLE, HOLE)):
                moved = position + by * (np.arange(position.size) >= at)
                right = np.abs(shift(before, moved[begin:], duties[begin:]) - by)[at - begin :] <= WRONG
                seconds = 1e-3 * float(np.argmax(right)) if right.any() else np.inf
                self.moved[f"{row}, {name}"].append((seconds, bool(right[-1])))

    def __str__(self) -> str:
        lines = ["| false | recordings | false | at the end | time [%] |", "|---|---|---|---|---|"]
        for name, rows in self.false.items():
            some, last = sum(bool(off.any()) for off in rows), sum(bool(off[-1]) for off in rows)
            lines.append(f"| {name} | {len(rows)} | {some} | {last} | {100 * np.concatenate(rows).mean():.1f} |")
        lines += ["", "| moved by 0.3 mm | recordings | right at the end | after [s] |", "|---|---|---|---|"]
        for name, cases in self.moved.items():
            seconds = np.array([after for after, _ in cases])
            times = seconds[np.isfinite(seconds)]
            after = ", ".join(f"{np.quantile(times, q):.1f}" for q in (0.5, 0.9)) if times.size else "-"
            lines.append(f"| {name} | {len(cases)} | {sum(last for _, last in cases)} | {after} |")
        return "\n".join(lines)


def watch(table: Table, kind: Vehicle, seed: int) -> None:
    """Add the drives of a truck."""

    def calibrated(change: Callable[[FloatArray], FloatArray]) -> VentedRest | None:
        log: Log = drive(kind, seconds=30, seed=1, pressure=False).log
        return vented_rest(log.with_columns(position=change(log["position"])))

    before = calibrated(lambda y: y)
    for number, (_, (position, duties)) in enumerate(drives(kind)):
        creeping = crept(position, np.random.default_rng([seed, number]))
        table.add("usual", before, (position, duties))
        table.add("creeping since", before, (creeping, duties))
        always = calibrated(lambda y, n=number: crept(y, np.random.default_rng([seed, n])))
        table.add("creeping always", always, (creeping, duties))
        if before is not None:
            wrong = before._replace(returned=before.lowest + 1.8e-3)
            table.add("creeping, calibrated with a hold", wrong, (creeping, duties))


def closed(kind: Vehicle) -> Iterator[FloatArray]:
    """Medians of half a second, one a second, of positions held with closed valves, but for the first second."""
    for name in (None, *CHANGES):
        try:
            changing = kind if name is None else changed(kind, name)
        except ParameterError:
            continue
        for level in (3e-3, 8e-3, 15e-3):
            random, curve = np.random.default_rng(1), load_curve(changing)
            wanted, forced = np.r_[hold(0.0, 0.3), hold(level, 63.0)], np.full((63300, 2), np.nan)
            forced[3000:] = 0.0
            noise = changing.parts.sensor.position_noise(changing, wanted.size, random)
            supply, working = changing.parts.supply.start(changing, random)
            begin = at_rest(changing, curve, supply)
            run = run_truck(changing, Course(wanted, forced, noise), start=begin, working=working)
            yield np.median(run.outputs.measured[4000:63000].reshape(-1, 1000)[:, :500], axis=1)


def rates(held: list[FloatArray]) -> list[str]:
    """Rows of the table of rates."""
    rows = [f"| rate [mm/s], {len(held)} holds | found | after [s] |", "|---|---|---|"]
    for rate in (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1):
        times = []
        for levels in held:
            shown = levels + 1e-3 * rate * np.arange(levels.size)
            above = shown - np.minimum.accumulate(shown) > 1e-4
            times += [1 + int(np.argmax(above))] if above.any() else []
        after = f"{np.median(times):.0f}, {np.quantile(times, 0.9):.0f}" if times else "-"
        rows.append(f"| {rate} | {len(times)} | {after} |")
    rises = [float((levels - np.minimum.accumulate(levels)).max()) for levels in held]
    return [*rows, f"largest rise without a fault: {1e3 * max(rises):.3f} mm"]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--family", action="append", help="A, B or h:SEED; default: A, B")
    parser.add_argument("--trucks", type=int, default=2)
    parser.add_argument("--seed", type=int, default=5100, help="number of the first truck")
    parser.add_argument("--limit", action="append", default=[], help="NAME=VALUE of a constant of the rule in m")
    parser.add_argument("--closed", action="store_true", help="positions that creep with closed valves")
    arguments = parser.parse_args()
    for name, value in (limit.split("=") for limit in arguments.limit):
        RULE[name] = float(value)
    table, held = Table(), list[FloatArray]()
    for family in arguments.family or ["A", "B"]:
        for number in range(arguments.seed, arguments.seed + arguments.trucks):
            if arguments.closed:
                held += closed(truck(number, family))
            else:
                watch(table, truck(number, family), number)
            print(f"{family} {number}", flush=True)
    print("\n".join(rates(held)) if arguments.closed else table)


if __name__ == "__main__":
    main()
