"""How well the wear of a fleet is followed: a run of `clutchid fleet --verb track` against the truth of its fleet.

    clutchid drive --fleet 4 --months 5 --types 4 --seed 40 --out trucks
    clutchid fit trucks/calibrations/A0000.parquet ... --save trucks/calibrations/A0000.toml    (each type)
    clutchid fleet trucks --start trucks/calibrations --verb track --out result
    python benchmarks/wear.py trucks result

First the readings, in their own standard deviations: what is common to all of a vehicle, what 10 K of air temperature
change, and what is left; then the trend.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import polars as pl

from clutchid.log import FloatArray
from clutchid.wear.trend import REFERENCE

#: Channels: column of the measurement, its truth, and the unit of the truth in that of the measurement.
CHANNELS = {
    "shift": ("shift_mm", "shift_std_mm", "shift [mm]", 1.0),
    "load": ("load_change_percent", "load_change_std_percent", "load change [1]", 100.0),
}


def shares(rows: pl.DataFrame, channel: str) -> tuple[float, float, float, float]:
    """Constant error, error by 10 K, what is left, all in standard deviations, and the median of these in SI."""
    value, deviation, truth, unit = CHANNELS[channel]
    std = rows[deviation].to_numpy()
    error = (rows[value].to_numpy() - unit * rows[truth].to_numpy()) / std
    warmer = (rows["temperature_ambient [K]"].to_numpy() - REFERENCE) / 10.0
    basis = np.column_stack([np.ones_like(warmer), warmer - warmer.mean()])
    weights, *_ = np.linalg.lstsq(basis, error, rcond=None)
    return float(weights[0]), float(weights[1]), rms(error - basis @ weights), float(np.median(std))


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fleet", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument("--after", type=int, default=10, help="recordings before the trend is compared")
    options = parser.parse_args()
    truth = pl.read_csv(options.fleet / "truth.csv", infer_schema_length=None).rename({"vehicle": "of"})
    files = [path for path in (options.result / "vehicles").glob("*.parquet") if ".load." not in path.name]
    wear = pl.concat(map(pl.read_parquet, files), how="diagonal_relaxed").join(truth, on="recording", how="left")
    late: list[FloatArray] = []
    covered: list[FloatArray] = []
    for (vehicle,), rows in wear.group_by("vehicle", maintain_order=True):
        read = rows.filter(pl.col("shift_mm").is_not_null() & pl.col("shift [mm]").is_not_null())
        if read.is_empty():
            print(f"{vehicle} has no reading")
            continue
        words = []
        for name in CHANNELS:
            constant, warm, left, std = shares(read, name)
            words.append(f"{name} {std:.2g}: {constant:+.2f} {warm:+.2f} {left:.2f}")
        after = rows.filter(pl.col("shift [mm]").is_not_null())[options.after :]
        true = after["shift [mm]"].to_numpy()
        late.append(after["shift_filtered_mm"].to_numpy() - true)
        low, high = (after[f"shift_filtered_{side}_mm"].to_numpy() for side in ("low", "high"))
        covered.append((low <= true) & (true <= high))
        events = "; ".join(f"{r['event']} before {r['recording']}" for r in rows.iter_rows(named=True) if r["event"])
        alarms = "; ".join(f"{r['alarm']} before {r['recording']}" for r in rows.iter_rows(named=True) if r["alarm"])
        print(f"{vehicle} {len(read):4} readings  {'  '.join(words)}  events: {events or '-'}  alarms: {alarms or '-'}")
    errors = np.abs(np.concatenate(late))
    print(
        f"shift after {options.after} recordings: {np.median(errors):.3f} mm off in the median, "
        f"{errors.max():.3f} at worst; covered {100 * np.mean(np.concatenate(covered)):.0f} %"
    )


if __name__ == "__main__":
    main()
