"""Which trucks have a carrier, and whether it is found: ``python benchmarks/carriers.py --family B --trucks 24``.

A line a truck: its valves, the period of its duty cycles, and the period of the carrier that is found in its
calibration recording, in ms, 0 for none; in the last column without the conditions on the response to the pulses and on
periods that are out of step. Family h: hybrids h:0 and on.
"""

from __future__ import annotations

import argparse
from unittest.mock import patch

from prove import SECONDS
from widening import seeds

from clutchid.estimation.automatic import WITH_CARRIER
from clutchid.model.actuator import Actuator
from clutchid.preparation import pulses
from clutchid.truck import drive, truck


def main() -> None:
    """Print a line a truck."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="B", choices=("A", "B", "h"))
    options.add_argument("--trucks", type=int, default=24)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    actuator = Actuator(model=WITH_CARRIER)
    print(f"{'truck':<8}{'valves':<24}{'period':>8}{'found':>8}{'without':>9}")
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        hybrid = chosen.family == "h"
        kind = truck(0, f"h:{number}") if hybrid else truck(number, chosen.family)
        log = drive(kind, seconds=SECONDS, seed=seeds(0 if hybrid else number)[0], conditions=True).log
        carrier, _ = pulses.find_carrier(log, actuator)
        with patch.multiple(pulses, RESPONSE=-float("inf"), IN_STEP=0.0):
            before, _ = pulses.find_carrier(log, actuator)
        valves = ", ".join(str(getattr(kind, name)) for name in ("valve", "duty", "drive") if hasattr(kind, name))
        cells = f"{1e3 * kind.T_pwm:>8.1f}{1e3 * carrier:>8.1f}{1e3 * before:>9.1f}"
        print(f"{chosen.family}{number:<7}{valves:<24}{cells}", flush=True)


if __name__ == "__main__":
    main()
