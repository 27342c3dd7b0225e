"""Residuals at a solution: states and outputs along the recordings, noise scales, and scatter from block to block."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import Chain, LinearisedProblem
from clutchid.inference.smoother.rows import eliminate, stacked_factor
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.log import FloatArray
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.noise import noise_scale
from clutchid.simulation.run import KernelArrays, run
from clutchid.simulation.sensors import sensor_output
from clutchid.simulation.windows import units


def trajectory(problem: Problem, solution: ShootingSolution, log: int) -> FloatArray:
    """States of recording `log` at its samples, shape (n, n_states); NaN between segments."""
    mine = [(track, X) for track, X in zip(problem.tracks, solution.at.X, strict=True) if track.log == log]
    n = len(mine[0][0].measured) if mine else 0
    states = np.full((n, len(problem.actuator.states)), np.nan)
    arrays = KernelArrays.of(problem.actuator_of(solution.x, problem.stems[log]))
    for track, X in mine:
        for window, start in zip(track.windows, X, strict=True):
            out, _ = run(window, arrays, start)
            states[window.start : window.stop] = out
    return states


def sensor_outputs(problem: Problem, solution: ShootingSolution, log: int, states: FloatArray) -> dict[str, FloatArray]:
    """Outputs of the sensors along `states`, with their lags and offsets."""
    p = problem.actuator_of(solution.x, problem.stems[log]).parameters
    names = problem.actuator.states
    y, p_A = (states[:, names.index(name)] for name in ("y", "p_A"))
    time = next(track.measured.time for track in problem.tracks if track.log == log)
    return {"position": sensor_output(y, time, p.tau_y, p.e_y), "pressure_a": sensor_output(p_A, time, p.tau_p, p.e_p)}


def noise_scales(problem: Problem, solution: ShootingSolution) -> dict[str, float]:
    """Noise scale of each measured column, from the residuals of all recordings."""
    scales = {}
    for name in problem.measure:
        residuals = [
            sensor_outputs(problem, solution, log, trajectory(problem, solution, log))[name] - measured[name]
            for log, measured in {track.log: track.measured for track in problem.tracks}.items()
        ]
        scales[name] = noise_scale(np.concatenate(residuals), problem.noise.measured[name])
    return scales


#: Blocks of a recording: with ten of 3 s each has a stroke or two.
BLOCKS = 10

#: Factor on the mean scatter: that of the directions of the load is larger. Chosen on family A, see
#: docs/derivations.md.
LOAD_FACTOR = 3.0

#: Least information about a direction of the parameters, in that of the prior, for it to count.
_LEAST_INFORMATION = 1.0


def dispersion(problem: Problem, linear: LinearisedProblem) -> float:
    """Variance of the scores of the blocks over the information, mean over the directions that the data determine.

    1 for white residuals of the assumed variance, above it where neighbouring residuals are alike or the model errs
    differently from stroke to stroke; 1 as well where nothing is determined.

    Parameters
    ----------
    problem : Problem
        Of the recordings.
    linear : LinearisedProblem
        At the solution, with free theta.
    """
    rows = [block for chain in linear.chains for block in _block_factors(problem, chain)]
    scores = np.array([block[:, :-1].T @ block[:, -1] for block in rows])
    values, vectors = np.linalg.eigh(sum((block[:, :-1].T @ block[:, :-1] for block in rows), np.zeros(())))
    informed = values > _LEAST_INFORMATION
    if len(rows) < 2 or not informed.any():
        return 1.0
    whitened = (scores - scores.mean(axis=0)) @ vectors[:, informed] / np.sqrt(values[informed])
    return LOAD_FACTOR * float(np.sum(whitened**2) / informed.sum() * len(rows) / (len(rows) - 1))


def _block_factors(problem: Problem, chain: Chain) -> list[FloatArray]:
    """Triangular factors ``[theta | r]`` of the blocks of a chain, each with an unknown first state."""
    n, states, linearised = len(problem.actuator.states), chain.windows.linearised.state_rows, chain.windows.linearised
    count, own = states.shape[0], linearised.theta_rows
    unknown = np.zeros_like(chain.first)
    spread = np.array([row.unknown_start for row in problem.actuator.state_rows.values()])
    unknown[:, :n] = np.diag(units(problem.actuator) / spread)
    factors = []
    for a, b in pairwise(np.linspace(0, count, min(BLOCKS, count) + 1).astype(int).tolist()):
        first = chain.first if a == 0 else unknown
        eliminated = eliminate(first, states[a:b], chain.links[a : b - 1])
        factors.append(triangular(np.vstack([stacked_factor(own[a:b]), eliminated.rows])))
    return factors
