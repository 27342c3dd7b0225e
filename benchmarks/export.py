"""The exported observer in C against the one in Python, on calibrated trucks of both families.

    python benchmarks/export.py [--trucks 24 | --numbers 3,5] [--families A,B] [--seconds 60]

Each truck is calibrated on 30 s with pressure and the conditions; then a clutch worn by 2 mm is followed from position
alone by Python and by the C: in double, in float, and in float with two rates, of which the slow task runs after every
sample. Theta is in prior standard deviations, the load in % of its peak, the pressure in Pa rms.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import clutchid
from clutchid.exports.c99 import CStyle, compiler, observer_c99
from clutchid.exports.parity import begun, parity, replay
from clutchid.observer import observer, start
from clutchid.truck import drive, truck

STYLES = {
    "double": CStyle(real="double"),
    "float": CStyle(real="float"),
    "float, two rates": CStyle(real="float", rates="two"),
}


def compared(family: str, number: int, seconds: float) -> dict[str, tuple[float, float, float, bool]]:
    """Theta, load, pressure, and whether all flags and strokes are alike, by style."""
    kind = truck(number, family)
    fit = clutchid.calibrate(drive(kind, seconds=30.0, seed=1, conditions=True).log)
    log = drive(kind, seconds=seconds, seed=2, wear=2e-3, conditions=True, pressure=False).log
    content = clutchid.parameter_file(fit)
    one = observer(content.actuator, "joint", calibration=content.calibration)
    state, found = begun(one, start(one)), {}
    for name, style in STYLES.items():
        got = parity(one, state, log, replay(one, observer_c99(one, state, style, "benchmark"), style, log, compiler()))
        alike = not got.flags and got.strokes[0] == got.strokes[1]
        found[name] = got.theta, 100.0 * got.load, got.pressure, alike
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trucks", type=int, default=24)
    parser.add_argument("--numbers", default="", help="trucks by number, in place of the first ones")
    parser.add_argument("--families", default="A,B")
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args()
    numbers = [int(n) for n in options.numbers.split(",") if n] or range(options.trucks)
    print("| family | C | theta median, worst | load % median, worst | p_A Pa rms median, worst | flags alike |")
    print("|---|---|---|---|---|---|")
    for family in options.families.split(","):
        begin, rows = time.perf_counter(), [compared(family, n, options.seconds) for n in numbers]
        for name in STYLES:
            values = np.array([row[name] for row in rows])
            pairs = [f"{np.median(column):.2g}, {column.max():.2g}" for column in values[:, :3].T]
            print(f"| {family} | {name} | {' | '.join(pairs)} | {int(values[:, 3].sum())} of {len(rows)} |", flush=True)
        print(f"{family}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
