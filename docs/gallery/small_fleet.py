"""A fleet

Three virtual trucks, each calibrated once and read new and worn: the shift of the half-load
position that `clutchid.fleet` reads, with its interval, against the true wear.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import polars as pl

import clutchid

WEAR = (0.0, 1e-3)  # m

figure, axes = plt.subplots(figsize=(7, 3.6))
with TemporaryDirectory() as folder:
    root = Path(folder)
    (root / "calibrations").mkdir()
    for number in range(3):
        vehicle = f"truck_{number}"
        (root / "trucks" / vehicle).mkdir(parents=True)
        fit = clutchid.calibrate(clutchid.drive(number, seconds=6, seed=number).log)
        clutchid.write_parameters(clutchid.parameter_file(fit), root / "calibrations" / f"{vehicle}.toml")
        for visit, wear in enumerate(WEAR):
            run = clutchid.drive(number, seconds=6, seed=10 * number + visit, wear=wear, pressure=False)
            clutchid.write(run.log, root / "trucks" / vehicle / f"visit_{visit}.parquet")
    clutchid.fleet(root / "trucks", root / "calibrations", root / "result", verb="track")
    rows = pl.read_parquet(root / "result" / "results.parquet").sort("vehicle", "recording")

for number, ((vehicle,), own) in enumerate(rows.group_by("vehicle", maintain_order=True)):
    wear = [1e3 * WEAR[int(name[-1])] + 0.01 * number for name in own["recording"]]
    axes.errorbar(wear, own["shift_mm"], 1.96 * own["shift_std_mm"], marker="o", capsize=3, label=vehicle)
axes.set(xlabel="true wear [mm]", ylabel="shift of the half-load position [mm]")
axes.legend()
