"""What a second calibration recording is worth: ``python benchmarks/two_calibrations.py --family A --number 3700``.

A truck is calibrated from one recording of 30 s, and from two of which the second has the same conditions, a lower
supply pressure, or cold air; the supply pressure is recorded. Its worn clutch is then read under four cases. Printed
are the trust in the calibration, and error, share of points in the band and its width as in `bands.py`.
"""

from __future__ import annotations

import argparse

from bands import Stored, band, score
from prove import SECONDS
from readings import observed, reading
from widening import seeds, worn_clutch

from clutchid import fit
from clutchid.errors import ClutchidError
from clutchid.estimation.filtered_load import FILTER_WEIGHT
from clutchid.estimation.hypotheses import WITH_SUPPLY
from clutchid.log import Log
from clutchid.strokes.vented_rest import from_rest
from clutchid.truck import GRID, drive, truck

#: Changes of the second recording; None without one.
SECOND = {"one": None, "two alike": (), "one with a lower supply": ("supply",), "one in cold air": ("cold",)}

CASES = ("nothing", "supply", "cold", "valves")


def main() -> None:
    """Calibrate, read and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--number", type=int, default=3700)
    chosen = options.parse_args()
    kind, seed = truck(chosen.number, chosen.family), seeds(chosen.number)[0]

    def recording(at: int, name: str, change: tuple[str, ...] = ()) -> Log:
        log = drive(kind, seconds=SECONDS, seed=at, name=name, conditions=True, change=change).log
        return log.without("temperature_ambient")

    for name, change in SECOND.items():
        second = [] if change is None else [recording(seed + 1, "second", change)]
        logs = [recording(seed, "calibration"), *second]
        result = fit(logs, measure=("position", "pressure_a"), free=("auto",), method="shooting")
        calibration = result.calibration
        assert calibration is not None, "a calibration with pressure keeps one"
        print(f"{name}: {result.verdict.trust}", flush=True)
        for case in CASES:
            worn = worn_clutch(chosen.number, chosen.family, case)
            log = worn.log.without("temperature_ambient")
            try:
                arrays = reading(from_rest(log, calibration.rest, "subtract").log, result.actuator, calibration)
            except ClutchidError as error:
                print(f"  {case}: {error}")
                continue
            arrays |= observed(log, result.actuator, calibration) | {"truth": worn.truth.load(GRID)}
            own = Stored(kind.parts.letters, case, arrays)
            scores = score(own, band(own, WITH_SUPPLY, FILTER_WEIGHT))
            print(f"  {case}: {scores.error:.2f} % off, {scores.covered:.0f} % in the band, {scores.width:.1f} % wide")


if __name__ == "__main__":
    main()
