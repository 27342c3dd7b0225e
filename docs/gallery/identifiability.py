"""What a recording determines

The parameters of a calibration in the order in which its data determine them: standard deviations by the data with all
others known, with those before it estimated too, and as stated, over the size of its value. Far apart, others make up
for it; the last ones keep their prior.
"""

import matplotlib.pyplot as plt

import clutchid

fit = clutchid.calibrate(clutchid.bundled_recording().slice(0, 8000))
weights = fit.actuator.load.names
rows = [row for row in fit.identifiability.ranking if row.name not in weights and fit.parameters[row.name].value]
for group in fit.identifiability.dependencies:
    names = {"load" if name in weights else name: None for name in group.names}
    print(f"condition index {group.condition:.0f}: {', '.join(names)}")

figure, axes = plt.subplots(figsize=(9, 4.2))
sizes = [abs(fit.parameters[row.name].value) for row in rows]
for label, values, mark in (
    ("by the data, all others known", [row.alone for row in rows], "v"),
    ("by the data, with those before it", [row.ranked for row in rows], "o"),
    ("stated, with priors", [fit.parameters[row.name].std for row in rows], "_"),
):
    axes.semilogy(range(len(rows)), [v / s for v, s in zip(values, sizes, strict=True)], mark, label=label)
axes.set_xticks(range(len(rows)), [row.name for row in rows], rotation=90)
axes.set(xlabel="parameter [by rank]", ylabel="standard deviation over value [1]")
axes.legend()
