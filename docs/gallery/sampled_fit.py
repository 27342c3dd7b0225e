"""A sampler beside the intervals

Two weights of the load and the supply pressure, drawn by emcee from `fit.problem.log_density`: its standard deviations
are those that the fit states, on data of the model itself with white noise.
"""

import emcee
import matplotlib.pyplot as plt
import numpy as np

import clutchid

log = clutchid.bundled_recording().slice(0, 3000)
truth = clutchid.Actuator(load=clutchid.Load((8.5e5, -4e4, 0.0)))
noise = 2e-5 * np.random.default_rng(3).standard_normal(len(log))
log = log.with_columns(position=clutchid.simulate(truth, log).log["position"] + noise)
fit = clutchid.fit(log, free="theta_1,theta_2,P_S")
problem = fit.problem

walkers = np.random.default_rng(0).multivariate_normal(problem.x, problem.covariance, 12)
np.random.seed(0)  # noqa: NPY002, emcee's own generator
sampler = emcee.EnsembleSampler(len(walkers), problem.x.size, problem.log_density)
sampler.run_mcmc(walkers, 400)
draws = (sampler.get_chain(discard=100, flat=True) - problem.x) * problem.slopes(problem.x)

figure, axes = plt.subplots(figsize=(7, 3.6))
for name, drawn in zip(problem.names, draws.T, strict=True):
    stated = fit.parameters[name].std
    share = f"{name}: {drawn.std() / stated:.2f} of the stated"
    axes.hist(drawn / stated, 40, density=True, histtype="step", label=share)
z = np.linspace(-4, 4, 200)
axes.plot(z, np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi), "k:", label="as stated")
axes.set(xlabel="drawn less estimated, in stated standard deviations [1]", ylabel="density [1]")
axes.set(xlim=(-4, 4), ylim=(0, 0.6))
axes.legend(title="standard deviation")
