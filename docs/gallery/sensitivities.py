"""What moves the piston

Exact derivatives of the position to parameters, each times a tenth of its value: where curves have one shape, a
recording of the position cannot tell the parameters apart.
"""

import matplotlib.pyplot as plt

import clutchid

log = clutchid.bundled_recording().slice(0, 3000)
names = ("theta_1", "P_S", "C_vs", "F_C", "D_v")
actuator = clutchid.fit(log).actuator
stroke = clutchid.simulate(actuator, log, sensitivities=names)

figure, axes = plt.subplots(figsize=(7, 3.6))
for name in names:
    change = 0.1 * actuator.value(name) * stroke.sensitivities[name][:, 0]
    axes.plot(log.time, change * 1e3, label=name)
axes.set(xlabel="time [s]", ylabel="change of the position by 10 % [mm]")
axes.legend(ncols=3)
