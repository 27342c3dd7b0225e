"""How often the intervals hold

One recording of the paper's model with 200 draws of white noise, fitted 200 times: where the model is right, a 95 %
interval holds the true load weight 95 times of 100, and estimates scatter as their standard deviation says.
"""

import matplotlib.pyplot as plt
import numpy as np

import clutchid

log = clutchid.bundled_recording().slice(0, 2000)
truth = clutchid.Actuator(load=clutchid.Load((8.5e5, -4e4, 0.0)))
position = clutchid.simulate(truth, log).log["position"]
errors = []
for seed in range(200):
    noise = 2e-5 * np.random.default_rng(seed).standard_normal(len(log))
    fit = clutchid.fit(log.with_columns(position=position + noise), free="theta_1,theta_2")
    errors.append([(e.value - truth.value(name), e.std) for name, e in fit.parameters.items()])
error, std = np.transpose(errors, (2, 1, 0))

figure, axes = plt.subplots(figsize=(7, 3.6))
for name, own, stated in zip(("theta_1", "theta_2"), error, std, strict=True):
    held = 100 * np.mean(np.abs(own) < 1.96 * stated)
    axes.plot(np.sort(own / stated), np.linspace(0, 1, own.size), label=f"{name}: {held:.0f} % in their interval")
for limit in (-1.96, 1.96):
    axes.axvline(limit, color="k", linestyle=":")
axes.set(xlabel="error in stated standard deviations [1]", ylabel="share of the fits [1]")
axes.legend()
