"""States and sensor outputs along the recordings at a solution, and noise scales from the residuals."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.simulation.run import KernelArrays, run
from clutchid.simulation.sensors import sensor_output
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution
from clutchid.uncertainty.noise import noise_scale


def trajectory(problem: FitProblem, solution: ShootingSolution, log: int) -> FloatArray:
    """States of recording `log` at its samples, shape (n, n_states); NaN between segments."""
    mine = [(track, X) for track, X in zip(problem.tracks, solution.X, strict=True) if track.log == log]
    n = len(mine[0][0].measured) if mine else 0
    states = np.full((n, len(problem.actuator.states)), np.nan)
    arrays = KernelArrays.of(problem.actuator_of(solution.x, problem.stems[log]))
    for track, X in mine:
        for window, start in zip(track.windows, X, strict=True):
            out, _ = run(window, arrays, start)
            states[window.start : window.stop] = out
    return states


def sensor_outputs(
    problem: FitProblem, solution: ShootingSolution, log: int, states: FloatArray
) -> dict[str, FloatArray]:
    """Outputs of the sensors along `states`, with their lags and offsets."""
    p = problem.actuator_of(solution.x, problem.stems[log]).parameters
    names = problem.actuator.states
    y, p_A = (states[:, names.index(name)] for name in ("y", "p_A"))
    time = next(track.measured.time for track in problem.tracks if track.log == log)
    return {"position": sensor_output(y, time, p.tau_y, p.e_y), "pressure_a": sensor_output(p_A, time, p.tau_p, p.e_p)}


def noise_scales(problem: FitProblem, solution: ShootingSolution) -> dict[str, float]:
    """Noise scale of each measured column, from the residuals of all recordings."""
    scales = {}
    for name in problem.measure:
        residuals = [
            sensor_outputs(problem, solution, log, trajectory(problem, solution, log))[name] - measured[name]
            for log, measured in {track.log: track.measured for track in problem.tracks}.items()
        ]
        scales[name] = noise_scale(np.concatenate(residuals), problem.noise.measured[name])
    return scales
