"""A new clutch and a worn one

A virtual truck is calibrated with its pressure sensor; then 1.5 mm of the facing are gone, the sensor too, and the
load is estimated from the position alone. Dotted are the true loads.
"""

import matplotlib.pyplot as plt

import clutchid

new = clutchid.drive(7, seconds=6, seed=1)
worn = clutchid.drive(7, seconds=6, seed=2, wear=1.5e-3, pressure=False)
calibration = clutchid.calibrate(new.log)
reading = clutchid.estimate(worn.log, calibration)

figure, axes = plt.subplots(figsize=(7, 3.6))
for name, driven, fit in (("new, with pressure", new, calibration), ("worn, from position", worn, reading)):
    curve = fit.load_curve
    (line,) = axes.plot(curve.position * 1e3, curve.force, label=name)
    axes.fill_between(curve.position * 1e3, curve.low, curve.high, alpha=0.3, color=line.get_color())
    axes.plot(curve.position * 1e3, driven.truth.load(curve.position), ":", color=line.get_color())
axes.set(xlabel="position [mm]", ylabel="load [N]", xlim=(0, 22), ylim=(0, None))
axes.legend()
