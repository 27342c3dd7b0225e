"""The pressure without its sensor

An observer follows position and duty cycles sample by sample, as on a control unit, and knows the pressure with a
band. The sensor is shown, but not used.
"""

import matplotlib.pyplot as plt

import clutchid

log = clutchid.bundled_recording()
calibration = clutchid.calibrate(log.slice(0, 4000))
later = log.slice(4000, 12_000)
estimates = clutchid.observe(later.without("pressure_a"), calibration).estimates()

figure, axes = plt.subplots(figsize=(7, 3.6))
axes.plot(later.time, later["pressure_a"] / 1e5, color="0.6", label="sensor, not used")
axes.plot(estimates.time, estimates["pressure_a"] / 1e5, label="observed")
axes.fill_between(
    estimates.time, estimates["pressure_a low"] / 1e5, estimates["pressure_a high"] / 1e5, alpha=0.3, label="95 %"
)
axes.set(xlabel="time [s]", ylabel="pressure, absolute [bar]")
axes.legend()
