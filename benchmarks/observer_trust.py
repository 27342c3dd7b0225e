"""Trust in the load of an observer against its error: ``python benchmarks/observer_trust.py --family A --trucks 4``.

Every truck is calibrated once with pressure, as in ``online.py``. Its worn clutch is then observed for several lengths,
undisturbed and with each fault, with and without the supply pressure recorded. A line a recording: the indicators, the
error of the load over 5 to 8 mm (rms in % of the peak), the error as a multiple of the half width of the band (largest
over 5 to 8 mm), and the trust; then a line a trust: recordings, median and worst error, and the share whose truth lies
in the band over 5 to 8 mm.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
from online import ANOTHER, FAULTS, WEAR, calibrated
from prove import STROKES_A_METRE

from clutchid.estimation.assess.observed import engaging_load, indicators, observed_verdict
from clutchid.observer.configuration import observer
from clutchid.observer.run import observe_recording
from clutchid.truck import GRID, drive, truck


def rows(number: int, family: str, lengths: list[float], faults: list[str], calibrations: Path) -> list[tuple]:
    """Fault, length in s, indicators, errors and trust of the recordings of one truck."""
    kind, rows_of_truck = truck(number, family), []
    seeds = np.random.default_rng([number, 2]).integers(0, 2**31, 2).tolist()
    content = calibrated(kind, seeds[0], calibrations / f"{family}{number}_supply.toml", conditions=True)
    joint = observer(content.actuator, "joint", calibration=content.calibration)
    for fault in faults:
        of_truck, of_log = FAULTS[fault]
        driven = truck(number + 1, family) if fault == ANOTHER else kind
        worn = drive(
            of_truck(driven), seconds=max(lengths), seed=seeds[1], wear=WEAR, cycles=WEAR * STROKES_A_METRE,
            pressure=False, conditions=True,
        )  # fmt: skip
        for length in lengths:
            whole = of_log(worn.log)
            log = whole.slice(0, int(np.searchsorted(whole.time, length)))
            for assumed in (False, True):
                if assumed and fault not in ("nothing", "supply 5 % lower"):
                    continue
                recording = log.with_columns(pressure_supply=np.full(len(log), np.nan)) if assumed else log
                run = observe_recording(joint, recording)
                load, truth = engaging_load(run), worn.truth.load(GRID)
                off = load.force - np.interp(load.position, GRID, truth)
                error = 100 * float(np.sqrt(np.mean(off**2))) / float(truth.max())
                sigma = float(np.max(np.abs(off) / ((load.high - load.low) / 2)))
                seen = indicators(run)
                rows_of_truck.append((fault, length, seen, error, sigma, observed_verdict(seen).trust))
    return rows_of_truck


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=4)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--fault", action="append", choices=tuple(FAULTS), help="default: all")
    options.add_argument("--seconds", type=float, action="append", help="lengths of the worn recording; 2, 5, 10, 30")
    options.add_argument("--calibrations", type=Path, required=True, help="folder in which calibrations are kept")
    chosen = options.parse_args()
    by_trust: dict[str, list[tuple[float, float]]] = defaultdict(list)
    print("truck fault                    s strokes  half %   NIS  supply  error %  /half  trust; flags")
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        for fault, length, seen, error, sigma, trust in rows(
            number,
            chosen.family,
            chosen.seconds or [2.0, 5.0, 10.0, 30.0],
            chosen.fault or list(FAULTS),
            chosen.calibrations,
        ):
            flags = ", ".join(f"{name} {100 * share:.2g} %" for name, share in seen.flagged.items() if share > 0.0)
            supply = "assumed" if seen.supply != "measured" else ""
            print(
                f"{chosen.family}{number:<5}{fault:<22}{length:>4g}{seen.strokes:>8}{100 * seen.half_width:>8.1f}"
                f"{seen.mismatch:>6.2f}{supply:>8}{error:>9.2f}{sigma:>7.2f}  {trust}; {flags}",
                flush=True,
            )
            by_trust[trust].append((error, sigma))
    for trust, pairs in by_trust.items():
        error, sigma = np.array(pairs).T
        print(
            f"{trust:<10} {error.size:>4} recordings, error {np.median(error):.2f} / {error.max():.2f} %, truth in the "
            f"band {100 * np.mean(sigma <= 1.0):.0f} %"
        )


if __name__ == "__main__":
    main()
