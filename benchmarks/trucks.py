"""Load errors of every method on recordings with a known load: ``python benchmarks/trucks.py FOLDER``.

FOLDER holds a folder a truck with recordings (CSV) and ``truth.json``: ``{"position_m": [...], "logs": {NAME:
{"load_N": [...]}}}``. Errors are rms over the grid in % of the true peak, over 0.5 to 20 mm and over 5 to 8 mm, and of
the position where the rising load passes half its peak. ``calibration`` has a pressure and calibrates the truck for the
method "calibrated"; its own row is the calibration. Covered: share of the grid where the band holds the true load.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from clutchid import Fit, FitRequest, Partition, fit, read
from clutchid.estimation.assess.comparison import half_load

PARTITIONS = {
    "ballistic": None,
    "every 200, p": Partition(every=200),
    "every 200, q": Partition(every=200, carry="q"),
    "8 parts, p": Partition(parts=8),
    "32 parts, p": Partition(parts=32),
}


CALIBRATED = "calibrated"


def main() -> None:
    """Print a row a recording and method, then medians and worst cases."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--only", default="", help="one method")
    chosen = options.parse_args()
    methods = [name for name in (*PARTITIONS, CALIBRATED) if chosen.only in ("", name)]
    rows: dict[str, list[list[float]]] = {name: [] for name in methods}
    head = ("recording", "method", "0.5-20 mm [%]", "5-8 mm [%]", "half load [mm]", "covered [%]", "time [s]")
    print(f"{head[0]:<22}{head[1]:<14}" + "".join(f"{title:>16}" for title in head[2:]))
    for truth_file in sorted(chosen.folder.glob("*/truth.json")):
        truth = json.loads(truth_file.read_text())
        once = None
        for stem, truth_of_log in truth["logs"].items():
            log = read(truth_file.parent / f"{stem}.csv")
            for name in methods:
                begin = time.perf_counter()
                if name != CALIBRATED:
                    result = fit(log, request=FitRequest(partition=PARTITIONS[name]))
                elif "pressure_a" in log:
                    result = once = fit(log, measure=("position", "pressure_a"), free=("auto",))
                else:
                    assert once is not None
                    result = fit(log, once.actuator, request=FitRequest(calibration=once.calibration))
                elapsed = time.perf_counter() - begin
                row = errors(result, np.array(truth["position_m"]), np.array(truth_of_log["load_N"]))
                label = f"{truth_file.parent.name}/{stem}"
                print(f"{label:<22}{name:<14}" + "".join(f"{value:>16.2f}" for value in (*row, elapsed)))
                if "pressure_a" not in log:
                    rows[name].append(row)
    for name in methods:
        table = np.abs(rows[name])
        cells = [f"{np.median(column):.2f} /{column.max():6.2f}" for column in table[:, :3].T]
        print(f"{'worn, median / worst':<22}{name:<14}" + "".join(f"{cell:>16}" for cell in cells))


def errors(result: Fit, y: np.ndarray, load: np.ndarray) -> list[float]:
    """Errors of a fit against the known `load` at the positions `y`."""
    error = (result.actuator.load.force(y) - load) / load.max() * 100
    near = (y > 4.999e-3) & (y < 8.001e-3)
    curve = result.load_curve
    low, high = np.interp(y, curve.position, curve.low), np.interp(y, curve.position, curve.high)
    halves = [half_load(y, result.actuator.load.force(y)), half_load(y, load)]
    covered = 100 * np.mean((low <= load) & (load <= high))
    rms = [float(np.sqrt(np.mean(part**2))) for part in (error, error[near])]
    return [*rms, (halves[0] - halves[1]) * 1e3, float(covered)]


if __name__ == "__main__":
    main()
