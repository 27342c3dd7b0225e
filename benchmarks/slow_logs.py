"""What a log at 100 Hz lacks against one at 1 kHz: ``python benchmarks/slow_logs.py --trucks 0 3 4 5 7 8``.

Every truck is calibrated once at 1 kHz with pressure. Each recording of its worn clutch is read from position alone
twice, as the controller and as the bus recorded the same drive, with ambient temperature and supply pressure. The last
table has the bands of the slow logs with several shares of the load in place of that of
`clutchid.estimation.verification`. Error and band are in % of the peak over 0.5 to 20 mm: error and expected error rms,
z their ratio rms over the points, width the median of the band from low to high, score the mean logarithm of
the density of the true load in the band. Seconds are those of a processor.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bands import QUANTILE, rms
from widening import CASES, calibrated, worn_clutch

from clutchid import DataError, FitRequest, fit, parameter_file, read_parameters, write_parameters
from clutchid.estimation.verification import MISSED
from clutchid.log import FloatArray
from clutchid.truck import GRID, Drive

#: Shares of the load that are compared.
SHARES = (0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04)

#: Least density in a score, so that one truck does not decide.
FLOOR = 1e-2

RECORDERS = {"1 kHz": False, "100 Hz": True}


class Reading(NamedTuple):
    """Error of a load, its standard deviation without what a slow log lacks, and the load, in % of the peak."""

    error: FloatArray
    std: FloatArray
    load: FloatArray
    trust: str
    method: str
    seconds: float

    def deviation(self, share: float) -> FloatArray:
        """Standard deviation with a share of the load."""
        together: FloatArray = np.hypot(self.std, share * self.load)
        return together

    def row(self, share: float) -> str:
        """Error, expected error, their ratio, trust, method and seconds."""
        std = self.deviation(share)
        numbers = f"{rms(self.error):7.2f}{rms(std):7.2f}{rms(self.error / std):7.2f}"
        return f"{numbers}  {self.trust:<11}{self.method:<18}{self.seconds:5.1f} s"


def calibration(number: int, family: str, folder: Path) -> Path:
    """The file of a truck's calibration; made where the folder lacks it."""
    path = folder / f"{family}{number}.toml"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_parameters(parameter_file(calibrated(number, family, (), "shooting")), path)
    return path


def reading(start: Path, worn: Drive, bus: bool) -> Reading:
    """The load of a worn clutch, read with the calibration in a file from a recording of the controller or the bus."""
    content = read_parameters(start)
    begin = time.process_time()
    result = fit(worn.log, content.actuator, request=FitRequest(calibration=content.calibration))
    seconds = time.process_time() - begin
    curve, true = result.load_curve, worn.truth.load(GRID)
    load, low, high = (
        100.0 / true.max() * np.interp(GRID, curve.position, side) for side in (curve.force, curve.low, curve.high)
    )
    missed = MISSED * load if bus else 0.0 * load
    std = np.sqrt(np.maximum(((high - low) / (2 * QUANTILE)) ** 2 - missed**2, 0.0))
    return Reading(load - 100.0 * true / true.max(), std, load, result.verdict.trust, result.method, seconds)


def summary(readings: Sequence[Reading], share: float) -> str:
    """Ratio of error and standard deviation, share covered, width, score, and median and worst error."""
    stds = [r.deviation(share) for r in readings]
    z = [r.error / std for r, std in zip(readings, stds, strict=True)]
    score = np.mean([np.mean(np.log(np.exp(-0.5 * e**2) / std + FLOOR)) for e, std in zip(z, stds, strict=True)])
    covered, width = 100 * np.mean(np.abs(z) <= QUANTILE), np.median([2 * QUANTILE * np.median(s) for s in stds])
    errors = [rms(r.error) for r in readings]
    return (
        f"z {rms(np.array(z)):.2f}  covered {covered:3.0f} %  width {width:4.1f} %  score {score:5.2f}  "
        f"error {np.median(errors):.2f} / {max(errors):.2f} %"
    )


def main() -> None:
    """Print a row a truck, case and recorder, and a table of shares."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--family", default="A", choices=("A", "B"))
    options.add_argument("--trucks", type=int, nargs="+", default=[0, 3, 4, 5, 7, 8])
    options.add_argument("--case", action="append", choices=tuple(CASES), help="default: nothing")
    options.add_argument("--recordings", type=int, default=1, help="of each truck and case")
    options.add_argument("--calibrations", type=Path, default=Path("slow_logs"), help="folder that keeps them")
    chosen = options.parse_args()
    readings: dict[str, list[Reading]] = {name: [] for name in RECORDERS}
    print(f"{'truck, case, recording':<34}{'log':<8}  error   std      z  trust      method")
    items = product(chosen.trucks, chosen.case or ["nothing"], range(chosen.recordings))
    for number, case, k in items:
        start = calibration(number, chosen.family, chosen.calibrations)
        drives = {name: worn_clutch(number, chosen.family, case, bus, k) for name, bus in RECORDERS.items()}
        label = f"{chosen.family}{number} {case} {k}"
        try:
            pair = {name: reading(start, worn, RECORDERS[name]) for name, worn in drives.items()}
        except DataError as refused:
            print(f"{label}: {refused}", flush=True)
            continue
        for name, of_logger in pair.items():
            readings[name].append(of_logger)
            print(f"{label:<34}{name:<8}{of_logger.row(MISSED if RECORDERS[name] else 0.0)}", flush=True)
    if readings["1 kHz"]:
        print(f"\n1 kHz                {summary(readings['1 kHz'], 0.0)}")
        for share in SHARES:
            print(f"100 Hz, share {100 * share:3.1f} %  {summary(readings['100 Hz'], share)}")


if __name__ == "__main__":
    main()
