"""Two cylinders

The cylinder of docs/actuators, which lifts a mass while its 3/2 valve is on, and one of twice its area and volume: the
larger one lifts faster, and takes longer to vent before the mass returns.
"""

import matplotlib.pyplot as plt
import numpy as np

import clutchid
from clutchid.model.equipment import Equipment

values = {
    "A_A": 3.14e-4, "V_0A": 4e-5, "M": 1.47, "y_max": 0.125, "P_0": 1e5, "P_S": 3e5, "C_vs": 5e-8, "C_ve": 5e-8,
    "B_vs": 0.0, "B_ve": 0.0, "R_0vs": 0.0, "R_1vs": 1.0, "R_0ve": 0.0, "R_1ve": 1.0, "D_v": 30.0, "F_C": 12.0,
    "K_z": 2e4, "D_zdot": 30.0, "K_stop": 1e6, "D_stop": 300.0,
}  # fmt: skip
weight = clutchid.Load((14.4,) * 4, knots=(0.0, 0.125), basis="b-spline")  # N, M g
lift = clutchid.Actuator(load=weight, equipment=Equipment(name="lift", chamber_b=False, valves="3/2"))
small = lift.replace(values)
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
