"""Two cylinders

The cylinder of docs/actuators, which lifts a mass while its 3/2 valve is on, and one of twice its area and volume: the
larger one lifts faster, and takes longer to vent before the mass returns.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import clutchid

file = Path(__file__).resolve().parents[1] / "actuators" / "cylinder.toml"
small = clutchid.read_parameters(file).actuator
large = small.replace(A_A=2 * small.value("A_A"), V_0A=2 * small.value("V_0A"))

time = np.arange(0.0, 1.0, 1e-3)
lifts = (time > 0.05) & (time < 0.15)
pulse = clutchid.Log(time, {"duty_supply": 1.0 * lifts}, "pulse")

figure, (upper, lower) = plt.subplots(2, figsize=(7, 4.8), sharex=True)
for name, cylinder in (("bore 20 mm", small), ("bore 28 mm", large)):
    run = clutchid.simulate(cylinder, pulse).log
    upper.plot(time, 1e3 * run["position"], label=name)
    lower.plot(time, run["pressure_a"] / 1e5)
upper.set(xlabel="time [s]", ylabel="position [mm]")
lower.set(xlabel="time [s]", ylabel="pressure, absolute [bar]")
upper.legend()
