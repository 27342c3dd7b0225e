"""How soon faults are found, and trust comes back after them: ``python benchmarks/healing.py --calibrations FOLDER``.

Trucks are calibrated once with pressure, supply pressure and air temperature. Their worn clutch is followed for 60 s;
from 20 to 25 s a fault disturbs what is recorded. A line a fault, median / worst over the trucks whose trust was good
before it: seconds from its beginning to the first flag that counts, and by how much the load at the end is off more
than without the fault, in % of the peak; seconds from its end until trust is good again (inf: not in 35 s); the
mismatch when it ends; the mismatch that a control unit stores then, and the seconds until trust is good where it starts
anew from the store; the flags that count.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from online import WEAR, calibrated
from prove import STROKES_A_METRE

from clutchid.estimation.assess.observed import FLAGGED, indicators, observed_verdict
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.observer.configuration import Observer, observer, start
from clutchid.observer.mismatch import mismatch_from
from clutchid.observer.run import follow_block
from clutchid.observer.state import ObserverState
from clutchid.truck import GRID, drive, truck

#: Seconds of the drive, of the fault, and of a block after which trust is looked at.
SECONDS, BEGIN, END, BLOCK = 60.0, 20.0, 25.0, 0.25

#: A fault: columns by name, with the samples that it disturbs, to what is recorded of them.
Fault = Callable[[dict[str, FloatArray], FloatArray], Mapping[str, FloatArray]]


def _position(change: Callable[[FloatArray], FloatArray]) -> Fault:
    return lambda columns, at: {"position": np.where(at, change(columns["position"]), columns["position"])}


def _both_duties(change: Callable[[FloatArray], FloatArray]) -> Fault:
    return lambda columns, at: {name: np.where(at, change(columns[name]), columns[name]) for name in INPUTS}


def _column(name: str, change: Callable[[FloatArray], FloatArray]) -> Fault:
    return lambda columns, at: {name: np.where(at, change(columns[name]), columns[name])}


def _stuck(values: FloatArray) -> FloatArray:
    return np.full_like(values, values[round(1e3 * BEGIN)])


def _spikes(position: FloatArray) -> FloatArray:
    at = np.random.default_rng(1).random(position.size) < 0.01
    return np.asarray(position + 5e-3 * at)


def _noise(position: FloatArray) -> FloatArray:
    return np.asarray(position + 3e-4 * np.random.default_rng(2).standard_normal(position.size))


def _missing(values: FloatArray) -> FloatArray:
    return np.full_like(values, np.nan)


def _late(samples: int) -> Callable[[FloatArray], FloatArray]:
    return lambda values: np.roll(values, samples)


FAULTS: Mapping[str, Fault] = {
    "nothing": _position(lambda y: y),
    "position stuck": _position(_stuck),
    "position missing": _position(_missing),
    "1 of 100 positions 5 mm off": _position(_spikes),
    "noise of 0.3 mm": _position(_noise),
    "position off by 1 mm": _position(lambda y: y + 1e-3),
    "gain of the position 5 % off": _position(lambda y: 1.05 * y),
    "duties missing": _both_duties(_missing),
    "duties stuck": _both_duties(_stuck),
    "duties 3 ms late": _both_duties(_late(3)),
    "duties 10 ms late": _both_duties(_late(10)),
    "supply sensor 15 % low": _column("pressure_supply", lambda p: 0.85 * p),
    "supply sensor missing": _column("pressure_supply", _missing),
    "air 30 K too warm": _column("temperature_ambient", lambda T: T + 30.0),
}


#: End in s of each block, whether trust is good then, and the flags that count.
Blocks = list[tuple[float, bool, set[str]]]


class Row(NamedTuple):
    """Times in s and mismatches; and the flags that counted while or after the fault."""

    found: float
    off: float
    healed: float
    mismatch: float
    stored: float
    restarted: float
    flags: tuple[str, ...]


def trusted(made: Observer, state: ObserverState, log: Log) -> tuple[ObserverState, Blocks]:
    """The state after a recording; and by block its end in s, whether trust is good, and the flags that count."""
    blocks, first = [], float(log.time[0])
    for begin in np.arange(first, float(log.time[-1]), BLOCK):
        block = log.slice(*np.searchsorted(log.time, [begin - 1e-6, begin + BLOCK - 1e-6]).tolist())
        if not len(block):
            continue
        run = follow_block(made, state, block)
        state = run.after
        flags = {name for name in FLAGGED if run.health[name] > 0.0}
        blocks.append((begin + BLOCK, observed_verdict(indicators(run)).trust == "good", flags))
    return state, blocks


def restarted(made: Observer, state: ObserverState) -> ObserverState:
    """The state of a control unit that starts with what one in a state has stored."""
    fresh = start(made)
    fresh.inputs.rest.shift = state.rest_shift
    return fresh._replace(
        **state.sound._asdict(), sound=state.sound, strokes=state.strokes, nis=mismatch_from(state.nis.kept)
    )


def rows(family: str, number: int, calibrations: Path) -> dict[str, Row]:
    """Every fault on one truck; none where trust was not good before it."""
    kind = truck(0, f"h:{number}") if family == "h" else truck(number, family)
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    content = calibrated(kind, seeds[0], calibrations / f"{family}{number}_supply.toml", conditions=True)
    made = observer(content.actuator, calibration=content.calibration)
    worn = drive(
        kind, seconds=SECONDS, seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False, conditions=True
    )
    log, truth = worn.log, worn.truth.load(GRID)
    touch = (GRID >= 5e-3) & (GRID <= 8e-3)
    at = (log.time >= BEGIN) & (log.time < END)
    cuts = [0, *np.searchsorted(log.time, [BEGIN, END]).tolist(), len(log)]
    before, blocks = trusted(made, start(made), log.slice(*cuts[:2]))
    if not blocks[-1][1]:
        return {}
    results, sound, usual = {}, np.nan, Blocks()
    for name, fault in FAULTS.items():
        disturbed = log.with_columns(**fault(dict(log.columns), at))
        during, while_on = trusted(made, before, disturbed.slice(*cuts[1:3]))
        after, then = trusted(made, during, disturbed.slice(*cuts[2:]))
        _, anew = trusted(made, restarted(made, during), disturbed.slice(*cuts[2:]))
        error = 100 * (made.load(after).force(GRID)[touch] - truth[touch]) / truth.max()
        off = float(np.sqrt(np.mean(error**2)))
        sound, usual = (off, then) if name == "nothing" else (sound, usual)
        flagged = [time for time, _, flags in [*while_on, *then] if flags]
        results[name] = Row(
            flagged[0] - BEGIN if flagged else np.nan, off - sound, healed(then, usual), during.mismatch,
            float(during.nis.kept), healed(anew, usual),
            tuple(sorted(set().union(*(flags for _, _, flags in [*while_on, *then])))),
        )  # fmt: skip
    return results


def healed(blocks: Blocks, undisturbed: Blocks) -> float:
    """Seconds from the end of the fault after which trust stays good where it is without; infinite: not at the end."""
    usual = {time for time, good, _ in undisturbed if good}
    bad = [time for time, good, _ in blocks if not good and time in usual]
    return np.inf if bad and bad[-1] == max(usual) else bad[-1] - END if bad else 0.0


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", default="A3606,A3607,B3606,B3607,h6,h7", help="family and number of each")
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    chosen = options.parse_args()
    by_truck = [rows(name[0], int(name[1:]), chosen.calibrations) for name in chosen.trucks.split(",")]
    good = [row for row in by_truck if row]
    print(f"{len(good)} of {len(by_truck)} trucks with good trust before the fault")
    for fault in FAULTS:
        table = np.array([row[fault][:-1] for row in good], dtype=float)
        flags = sorted({flag for row in good for flag in row[fault].flags})
        cells = [f"{np.nanmedian(c):.2f} / {np.nanmax(c):.2f}" if np.isfinite(c).any() else "-" for c in table.T]
        print(f"| {fault} | {' | '.join(cells)} | {', '.join(flags)} |")


if __name__ == "__main__":
    main()
