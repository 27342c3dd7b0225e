"""A load law of your own

The law of Almen and Laszlo for a diaphragm spring behind a cushion spring, five parameters in place of 22 weights: the
load is data, so a law is a way to choose its weights, and SciPy minimises over the law through `clutchid.problem`.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import approx_fprime, least_squares

import clutchid
from clutchid.study.bundled import true_load

log = clutchid.bundled_recording().slice(0, 12_000)
calibrated = clutchid.calibrate(log.slice(0, 8000))
load = calibrated.actuator.load
request = clutchid.FitRequest(measure=("position", "pressure_a"), free=("load",), method="shooting")
problem = clutchid.problem(log, calibrated.actuator, request)
weights = [problem.names.index(name) for name in load.names]
grid = np.linspace(0.0, 0.022, 200)


# load in N: force of the diaphragm [kN], its height over thickness, deflections [mm], rise of the cushion [mm]
def law(p):
    force, height, first, scale, rise = p
    deflection = (first + 1e3 * grid) / scale
    diaphragm = deflection * ((height - deflection) * (height - deflection / 2) + 1)
    return 1e3 * force * diaphragm * (1 - np.exp(-1e3 * grid / rise))


# the weights whose splines come closest to the law, as the problem has them
def x_of(p):
    x, theta = problem.x.copy(), np.linalg.lstsq(load.phi(grid), law(p), rcond=None)[0]
    x[weights] += (theta - load.theta) / problem.slopes(x)[weights]
    return x


# chain rule: exact derivatives to the weights, differences of the law alone
def jacobian(p):
    return problem.jacobian(x_of(p)) @ approx_fprime(p, x_of, 1e-6)


limits = [0.1, 0.5, 0.0, 1.0, 0.3], [50.0, 3.0, 20.0, 50.0, 10.0]
near = least_squares(lambda p: law(p) - load.force(grid), [2.0, 1.5, 4.0, 8.0, 2.0], bounds=limits).x
end = least_squares(lambda p: problem.residuals(x_of(p)), near, jacobian, bounds=limits, x_scale="jac")

figure, axes = plt.subplots(figsize=(7, 3.6))
truth, curve = true_load(log), calibrated.load_curve
error = np.interp(grid, truth.position, truth.force) - law(end.x)
print(f"law: rms {100 * np.sqrt(np.mean(error**2)) / truth.force.max():.1f} % of the peak from the true load")
axes.fill_between(curve.position * 1e3, curve.low, curve.high, alpha=0.3, label="calibration, 22 weights")
axes.plot(grid * 1e3, law(end.x), color="C1", label="law of Almen and Laszlo, 5 parameters")
axes.plot(truth.position * 1e3, truth.force, "k:", label="true")
axes.set(xlabel="position [mm]", ylabel="load [N]", xlim=(0, 22), ylim=(0, None))
axes.legend(loc="lower right")
