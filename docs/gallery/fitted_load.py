"""A load with its band

The paper's method on the bundled recording, beside the load that the simulated truck really has. The band is the 95 %
interval of noise and fit; the truck has more physics than the model, which the verdict says.
"""

import matplotlib.pyplot as plt

import clutchid
from clutchid.study.bundled import true_load

log = clutchid.bundled_recording()
fit = clutchid.fit(log)
curve, truth = fit.load_curve, true_load(log)
print(fit.verdict.trust)

figure, axes = plt.subplots(figsize=(7, 3.6))
axes.fill_between(curve.position * 1e3, curve.low, curve.high, alpha=0.3)
axes.plot(curve.position * 1e3, curve.force, label="estimated from the position")
axes.plot(truth.position * 1e3, truth.force, "k:", label="true")
axes.set(xlabel="position [mm]", ylabel="load [N]", xlim=(0, 22), ylim=(0, None))
axes.legend()
