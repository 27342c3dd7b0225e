"""Load errors of the paper's method on recordings with a known load: ``python benchmarks/trucks.py FOLDER``.

FOLDER holds a folder a truck with recordings (CSV) and ``truth.json``: ``{"position_m": [...], "logs": {NAME:
{"load_N": [...]}}}``. Errors are rms over the grid in % of the true peak, over 0.5 to 20 mm and over 5 to 8 mm.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import numpy as np

from clutchid import Partition, fit, read

METHODS = {
    "ballistic": None,
    "every 200, p": Partition(every=200),
    "every 200, q": Partition(every=200, carry="q"),
    "8 parts, p": Partition(parts=8),
    "32 parts, p": Partition(parts=32),
}


def main() -> None:
    """Print a row a recording and method, then medians and worst cases."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    folder = options.parse_args().folder
    whole: dict[str, list[float]] = {name: [] for name in METHODS}
    touch: dict[str, list[float]] = {name: [] for name in METHODS}
    print(
        f"{'recording':<22}{'method':<14}{'position [mm]':>14}{'0.5-20 mm [%]':>15}{'5-8 mm [%]':>12}{'time [s]':>10}"
    )
    for truth_file in sorted(folder.glob("*/truth.json")):
        truth = json.loads(truth_file.read_text())
        y = np.array(truth["position_m"])
        near = (y > 4.999e-3) & (y < 8.001e-3)
        for stem, known in truth["logs"].items():
            log = read(truth_file.parent / f"{stem}.csv")
            load = np.array(known["load_N"])
            for name, partition in METHODS.items():
                begin = time.perf_counter()
                result = fit(log, partition=partition)
                elapsed = time.perf_counter() - begin
                error = (result.actuator.load.force(y) - load) / load.max() * 100
                rms = np.sqrt(np.mean(error**2)), np.sqrt(np.mean(error[near] ** 2))
                whole[name].append(float(rms[0]))
                touch[name].append(float(rms[1]))
                label = f"{truth_file.parent.name}/{stem}"
                position = result.errors.position_rms * 1e3
                print(f"{label:<22}{name:<14}{position:>14.3f}{rms[0]:>15.1f}{rms[1]:>12.1f}{elapsed:>10.2f}")
    for name in METHODS:
        print(
            f"{'median / worst':<22}{name:<14}{'':>14}"
            f"{statistics.median(whole[name]):>8.1f} /{max(whole[name]):>5.1f}"
            f"{statistics.median(touch[name]):>7.1f} /{max(touch[name]):>5.1f}"
        )


if __name__ == "__main__":
    main()
