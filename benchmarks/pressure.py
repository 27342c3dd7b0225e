"""Pressure from the position alone, five ways: ``python benchmarks/pressure.py --family A --trucks 4 --seed 0``.

Every truck is calibrated once with pressure. Its worn clutch is followed for 30 s by the observer 'joint'; then, over
the next 30 s, the pressure in chamber A follows from the load found so far by Eq. (26), by the balance of forces with
friction along the measured motion, by the observer 'states' with that load, and by 'joint', which goes on; and by
'states' with the load of the new clutch. Errors are rms in kPa, median / worst over the trucks, while the piston is
held (slower than 5 mm/s, off its rest), while it moves, and over all; covered is the share of the samples in the 95 %
band. With ``--figure FILE`` a stroke of the first truck is drawn.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from online import WEAR, calibrated
from prove import STROKES_A_METRE

from clutchid import Actuator
from clutchid.documents.figures import draw, fill, label, legend, new_figure
from clutchid.documents.style import STYLE, Line
from clutchid.log import FloatArray, Log
from clutchid.model.compiled import kernels
from clutchid.numerics.interval import QUANTILE
from clutchid.observer import ObservedRecording, observe, observe_recording, observer, start
from clutchid.study.pressure import measured_motion
from clutchid.truck import drive, truck

SECONDS = 30.0

#: Slower than this in m/s the piston is held, beyond this position in m.
HELD, OFF_REST = 5e-3, 5e-4

WAYS = ("Eq. (26)", "balance of forces", "states, new load", "states", "joint")
COLOURS = (STYLE.orange, STYLE.purple, STYLE.measured, STYLE.green, STYLE.blue)

#: Largest error in kPa that the figure shows.
LARGEST = 120.0

#: Steps of Newton's method to the pressure that balances the forces: friction depends on it a little.
STEPS = 3


class Way(NamedTuple):
    """Pressure in chamber A and half the width of its 95 % band by sample, in Pa."""

    pressure: FloatArray
    half: FloatArray


def balance(actuator: Actuator, log: Log, states: FloatArray) -> FloatArray:
    """Pressure that moves the piston as measured, with all other states of an observer, shape (n, states)."""
    x = states.copy()
    names, load = actuator.states, actuator.load
    y, v, a = measured_motion(log)
    at, by = names.index("v"), names.index("p_A")
    x[:, names.index("y")], x[:, at] = y, v
    u = np.zeros((len(log), len(kernels(actuator.model).INPUTS)))
    rates, jacobian = np.empty_like(x), np.empty((*x.shape, x.shape[1]))
    for _ in range(STEPS):
        kernels(actuator.model).linearise(x, u, actuator.array(), load.breakpoints, load.combined(), rates, jacobian)
        x[:, by] += (a - rates[:, at]) / jacobian[:, at, by]
    return x[:, by]


def one_truck(number: int, family: str, calibrations: Path | None) -> tuple[Log, FloatArray, dict[str, Way]]:
    """The second half of a recording, its true pressure, and the pressure in every way."""
    kind = truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    content = calibrated(kind, seeds[0], calibrations / f"{family}{number}.toml" if calibrations else None)
    new = content.actuator
    worn = drive(
        kind, seconds=2 * SECONDS, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False, name="worn"
    )
    joint = observer(new, calibration=content.calibration)
    half = len(worn.log) // 2
    observed, _ = observe(joint, start(joint), worn.log.slice(0, half))
    later = worn.log.slice(half, len(worn.log))
    adapted = replace(joint.joint.actuator(observed.theta), load=joint.load(observed))
    runs = {
        "states, new load": observe_recording(observer(new, "states"), later),
        "states": observe_recording(observer(adapted, "states"), later),
        "joint": observe_recording(joint, later, observed),
    }
    p, y, _ = adapted.parameters, *measured_motion(later)[:2]
    band = QUANTILE * joint.load_deviation(observed, y) / p.A_A
    ways = {
        "Eq. (26)": Way(p.P_0 + joint.load(observed).force(y) / p.A_A, band),
        "balance of forces": Way(balance(adapted, later, runs["states"].samples.states), band),
        **{name: of_observer(run) for name, run in runs.items()},
    }
    return later, worn.truth.states["pressure_a"][half:], ways


def of_observer(run: ObservedRecording) -> Way:
    """Pressure and band of an observer."""
    at = run.observer.actuator.states.index("p_A")
    return Way(run.samples.states[:, at], QUANTILE * run.deviation("p_A"))


def errors(log: Log, truth: FloatArray, way: Way) -> list[float]:
    """Rms in kPa while held, while moving and over all, and the covered share in %."""
    y, v, _ = measured_motion(log)
    off, slow = way.pressure - truth, np.abs(v) < HELD
    parts = (slow & (y > OFF_REST), ~slow, np.ones(len(log), dtype=bool))
    rms = [float(np.sqrt(np.nanmean(off[part] ** 2))) * 1e-3 for part in parts]
    return [*rms, 100 * float(np.mean(np.abs(off) <= way.half))]


def figure(log: Log, truth: FloatArray, ways: dict[str, Way], file: Path) -> None:
    """A stroke: pressures with the band of 'joint', and their errors."""
    end = int(np.argmax(log["position"])) + 700
    at = slice(max(0, end - 1800), end)
    t = log.time[at]
    drawn, axes = new_figure([1.2, 2.6, 2.2])
    draw(axes[0], t, log["position"][at] * 1e3, Line(STYLE.ink, "position", width=1.4))
    draw(axes[1], t, truth[at] * 1e-5, Line(STYLE.ink, "true pressure", width=2.2))
    joint = ways["joint"]
    low, high = ((joint.pressure + side * joint.half)[at] * 1e-5 for side in (-1, 1))
    fill(axes[1], t, low, high, Line(STYLE.blue, "", opacity=0.25))
    for (name, way), colour in zip(ways.items(), COLOURS, strict=True):
        draw(axes[1], t, way.pressure[at] * 1e-5, Line(colour, name, width=1.2))
        draw(axes[2], t, (way.pressure - truth)[at] * 1e-3, Line(colour, name, width=1.2))
    label(axes[0], y="position [mm]")
    label(axes[1], y="pressure A [bar]")
    label(axes[2], "time [s]", "error [kPa]")
    axes[2].set_ylim(-LARGEST, LARGEST)
    legend(axes[1], 3)
    drawn.savefig(file)


def main() -> None:
    """Print a row a way."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=4)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--calibrations", type=Path, help="folder in which calibrations are kept for the next run")
    options.add_argument("--figure", type=Path, help="PNG of a stroke of the first truck")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    rows: dict[str, list[list[float]]] = {name: [] for name in WAYS}
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        log, truth, ways = one_truck(number, chosen.family, chosen.calibrations)
        for name in WAYS:
            rows[name].append(errors(log, truth, ways[name]))
        if chosen.figure and number == chosen.seed:
            figure(log, truth, {name: ways[name] for name in WAYS}, chosen.figure)
    print(f"{'':<20}" + "".join(f"{title:>18}" for title in ("held [kPa]", "moving [kPa]", "all [kPa]", "covered [%]")))
    for name, values in rows.items():
        table = np.array(values)
        cells = [f"{np.median(column):.1f} / {column.max():.1f}" for column in table.T[:3]]
        print(f"{name:<20}" + "".join(f"{cell:>18}" for cell in (*cells, f"{table[:, 3].mean():.0f}")))


if __name__ == "__main__":
    main()
