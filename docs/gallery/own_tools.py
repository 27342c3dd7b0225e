"""A fit in your own tools

From one fit: its problem minimised by SciPy and drawn by emcee, the drawn actuators simulated, what the data determine,
a profile, and another friction law compared on strokes that neither was fitted to. Cells begin at `# %%`.
"""

# %%
import emcee
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

import clutchid

log = clutchid.bundled_recording()
first, later = log.slice(0, 4000), log.slice(8000, 12_000)
request = clutchid.FitRequest(("position", "pressure_a"), ("load", "C_vs", "F_C"), profile=("F_C",), bootstrap=50)
fit = clutchid.fit(first, request=request, verify=later)
fit

# %%
problem = fit.problem
end = least_squares(problem.residuals, problem.x + 0.1, problem.jacobian, bounds=problem.bounds)
{name: f"{value:.4g}, in the fit {fit.parameters[name].value:.4g}" for name, value in problem.values(end.x).items()}

# %%
walkers = np.random.default_rng(0).multivariate_normal(problem.x, 0.3 * problem.covariance, 12)
walkers = np.clip(walkers, *problem.bounds)
sampler = emcee.EnsembleSampler(len(walkers), problem.x.size, problem.log_density)
sampler.run_mcmc(walkers, 12)
draws = sampler.get_chain(discard=6, flat=True)
runs = clutchid.simulate_many([problem.actuator_of(x) for x in draws[::3]], later)
runs.column("pressure_a").shape

# %%
fit.identifiability.ranking

# %%
fit.profiles["F_C"].shape, fit.draws.std(axis=0) / [e.std for e in fit.parameters.values()]

# %%
stribeck = clutchid.Actuator(model="energy-balance-stribeck", load=fit.actuator.load)
other = clutchid.fit(first, stribeck, request, verify=later)
for name, one_fit in (("isothermal, LuGre", fit), ("energy balance, Stribeck", other)):
    criteria = one_fit.evidence.criteria(len(one_fit.parameters), like=fit.evidence)
    rms = 1e3 * next(iter(one_fit.verification.values())).errors.position_rms
    print(f"{name}: AIC {criteria.aic:.0f}, later strokes to {rms:.2f} mm rms")

# %%
figure, axes = plt.subplots(figsize=(7, 3.6))
axes.plot(later.time, runs.column("pressure_a").T / 1e5, color="C0", alpha=0.2)
axes.plot(later.time, later["pressure_a"] / 1e5, "k", linewidth=1)
axes.set(xlabel="time [s]", ylabel="pressure in chamber A, absolute [bar]")
