"""Rules for innovations that contradict the inputs: ``python benchmarks/contradictions.py --calibrations FOLDER``.

Trucks are calibrated once with pressure and the supply pressure. Their worn clutch is observed over 20 s: *sound*
(unchanged, 5 % less supply, valves that pass 7 % less, cold, warm); with a *poor* calibration (friction, grease,
valves, dead volume or load of it are others); and *hostile*, where for 2 s duty cycles are held, as they are, from an
opening or from a venting on, or the position is stuck, clean or with noise, each twice. A line a rule and group:
recordings with the flag, error of the load over 5 to 8 mm, rms in % of the peak, and share of those above 5 %.

Rules: `none`; `count N`, N outliers in a row (beyond 4 standard deviations); `moving N`, as many while the parameters
learn; `sum H`, that of `clutchid.observer.contradiction` with a limit of H s; `moving sum H`, of it while they learn.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from observer_band import CASES
from online import WEAR, calibrated
from prove import STROKES_A_METRE

from clutchid.inference.filter.joint_filter import JointPass
from clutchid.log import Log
from clutchid.observer import following
from clutchid.observer.configuration import Observer, observer
from clutchid.observer.contradiction import LARGEST_EXCESS, LEARNING, STANDING
from clutchid.observer.run import observe_recording
from clutchid.truck import GRID, drive, truck

#: Trucks that the rule was chosen on, and those that it was reported on, by family and number.
CHOSEN = "A3606,A3607,A3609,B3606,B3608,B3609,h8,h10,h11"
RULES = "none", "count 13", "moving 6", "moving 9", "moving sum 0.3", "sum 0.15", "sum 0.3", "sum 0.5"

#: Factors on parameters of a poor calibration.
POOR = {
    "friction": {"F_C": 1.4}, "grease": {"D_v": 1.6}, "wider valves": {"C_vs": 1.08, "C_ve": 1.08},
    "narrower valves": {"C_vs": 0.88, "C_ve": 0.88}, "dead volume": {"V_0A": 1.15}, "exhaust": {"C_ve": 0.9},
    "larger load": {"load": 1.4}, "smaller load": {"load": 0.7},
}  # fmt: skip


def hostile(log: Log) -> Iterator[Log]:
    """The recording with each fault, from 7 and from 12 s on."""
    noise = 2e-5 * np.random.default_rng(0).standard_normal(2000)
    for at in (7000, 12000):
        open_, vents = (at + int(np.argmax(log[name][at:] > 0.5)) for name in ("duty_supply", "duty_exhaust"))
        for begin in (at, open_, vents):
            span = (np.arange(len(log)) >= begin) & (np.arange(len(log)) < begin + 2000)
            held = {name: np.where(span, log[name][begin], log[name]) for name in ("duty_supply", "duty_exhaust")}
            yield log.with_columns(**held)
        for added in (0.0, noise):
            position = log["position"].copy()
            position[at : at + 2000] = position[at] + added
            yield log.with_columns(position=position)


def changed(content: object, factors: dict[str, float]) -> Observer:
    """An observer of a calibration whose parameters are others."""
    actuator, values = content.actuator, {}
    for name, factor in factors.items():
        names = actuator.load.names if name == "load" else (name,)
        values |= {parameter: factor * actuator.value(parameter) for parameter in names}
    return observer(actuator.replace(values), calibration=content.calibration)


def rule(words: str) -> Callable[..., tuple[int, float]]:
    """The rule of a name, in place of `following._contradiction`."""
    kind, _, limit = words.rpartition(" ")

    def first(observed: Observer, total: float, joint: JointPass | None, least_speed: float) -> tuple[int, float]:
        if joint is None or kind == "":
            return 0 if joint is None else len(joint.states), 0.0
        at = np.flatnonzero(np.isfinite(joint.errors[:, 0, 0]))
        sizes = np.abs(joint.errors[at, 0, 0]) / np.sqrt(joint.errors[at, 0, 1])
        learns = np.abs(joint.states[at, observed.actuator.states.index("v")]) > least_speed
        seconds = observed.joint.settings.every * observed.joint.settings.spacing
        for i, size, moves in zip(at.tolist(), sizes.tolist(), learns.tolist(), strict=True):
            if kind.startswith("moving") and not moves:
                continue
            if kind.endswith("sum"):
                allowance = LEARNING if moves else STANDING
                total = max(0.0, total + seconds * min(size - allowance, LARGEST_EXCESS))
            else:
                total = total + 1.0 if size > LEARNING else 0.0
            if total >= float(limit):
                return i, total
        return len(joint.states), total

    return first


def recordings(family: str, number: int, folder: Path) -> Iterator[tuple[str, Observer, Log, np.ndarray]]:
    """Group, observer, recording and true load of each case on a truck."""
    kind = truck(0, f"h:{number}") if family == "h" else truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    mark = f"h{number}0" if family == "h" else f"{family}{number}"
    content = calibrated(kind, seeds[0], folder / f"{mark}_supply.toml", conditions=True)
    sound = observer(content.actuator, calibration=content.calibration)
    for name, (share, sensor, change) in CASES.items():
        if name == "supply +5 %" or sensor != 1.0:
            continue
        worn = drive(
            kind.replace({"P_S": share * kind.P_S}), seconds=20.0, seed=seeds[1], wear=WEAR,
            cycles=WEAR * STROKES_A_METRE, pressure=False, change=change,
        )  # fmt: skip
        truth = worn.truth.load(GRID)
        yield "sound", sound, worn.log, truth
        if name == "unchanged":
            yield from (("hostile", sound, log, truth) for log in hostile(worn.log))
            yield from (("poor", changed(content, factors), worn.log, truth) for factors in POOR.values())


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    options.add_argument("--trucks", default=CHOSEN)
    options.add_argument("--rule", action="append", help="default: all")
    chosen = options.parse_args()
    rows, touch = defaultdict(list), (GRID >= 5e-3) & (GRID <= 8e-3)
    for name in chosen.trucks.split(","):
        for group, observed, log, truth in recordings(name[0], int(name[1:]), chosen.calibrations):
            for words in chosen.rule or RULES:
                following._contradiction = rule(words)
                run = observe_recording(observed, log)
                off = (observed.load(run.after).force(GRID) - truth)[touch]
                error = 100.0 * float(np.sqrt(np.mean(off**2))) / truth.max()
                rows[words, group].append((error, run.health["contradiction"] > 0.0))
    print("| rule | group | flagged | error, median / worst [%] | above 5 % [%] |\n|---|---|---|---|---|")
    for (words, group), rows_of_group in sorted(rows.items(), key=lambda item: item[0][1]):
        errors, flags = (np.array(column) for column in zip(*rows_of_group, strict=True))
        share = 100.0 * np.mean(errors > 5.0)
        words_of = f"{np.median(errors):.1f} / {errors.max():.1f} | {share:.0f}"
        print(f"| {words} | {group} | {flags.sum()} of {len(rows_of_group)} | {words_of} |")


if __name__ == "__main__":
    main()
