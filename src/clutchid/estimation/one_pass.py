"""A load read from position alone in one pass of the joint filter: fast, and where a search may start from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.windows import Track
from clutchid.smoother.problem import FitProblem, prior_rows

#: Parameters that adapt beside the load, if they are free. Provenance: docs/derivations.md, chosen on the seven trucks
#: of its table.
ADAPTED = ("F_C", "V_0A", "y_max", "s_pwm")

#: Correlation time in s of what the model misses in a measurement, as in the search by shooting.
MEMORY = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class OnePass:
    """What one pass found: free parameters x (k,), their covariance (k, k), states at the window starts of each track.

    What did not adapt has the mean of its prior, and no covariance.
    """

    x: FloatArray
    covariance: FloatArray
    X: tuple[FloatArray, ...]


def one_pass(problem: FitProblem, settings: JointSettings | None = None) -> OnePass | Failure:
    """Read the load of the only recording of `problem` in one pass of the joint filter.

    Parameters
    ----------
    problem : FitProblem
        With a calibrated actuator; all its tracks are of one recording, over whose segments the parameters go on.
    settings : JointSettings, optional

    Returns
    -------
    found : OnePass, or Failure if the filter diverges.
    """
    adapted = {*ADAPTED, *problem.actuator.load.names}
    at = [i for i, c in enumerate(problem.coordinates) if c.base in adapted]
    mean, T = _prior(problem, at)
    low, high = problem.bounds()
    free, X = [problem.coordinates[i] for i in at], []
    theta, spacing = mean, float(np.median(np.concatenate([track.segment.dt for track in problem.tracks])))
    joint = joint_filter(
        problem.actuator, free, (low[at], high[at]), problem.measure, replace(problem.noise, memory=MEMORY),
        settings or JointSettings(spacing=spacing),
    )  # fmt: skip
    for track in map(with_window_steps, problem.tracks):
        state = init(joint, track.segment, theta, T)
        found = follow(joint, state, inputs(joint, track), (0, len(track.segment)))
        if isinstance(found, Failure):
            return found
        theta, T = found.state.theta, found.state.T
        X.append(found.states[[window.start - track.segment.start for window in track.windows]])
    x, covariance = np.zeros(len(problem.coordinates)), np.zeros((len(problem.coordinates),) * 2)
    x[at], covariance[np.ix_(at, at)] = theta, T @ T.T
    return OnePass(x, covariance, tuple(X))


def _prior(problem: FitProblem, at: list[int]) -> tuple[FloatArray, FloatArray]:
    """Mean and square root of the covariance of the coordinates `at`."""
    k = len(problem.coordinates)
    factor = triangular(prior_rows(problem, np.zeros(k)))
    inverse = np.linalg.inv(factor[:k, :k])
    mean: FloatArray = -inverse @ factor[:k, k]
    root: FloatArray = np.linalg.cholesky((inverse @ inverse.T)[np.ix_(at, at)])
    return mean[at], root


def with_window_steps(track: Track) -> Track:
    """`track` with the integration steps of its windows, which are fewer than those of the plan."""
    substeps = track.segment.substeps.copy()
    for window in track.windows:
        begin = window.start - track.segment.start
        substeps[begin : begin + len(window.substeps)] = window.substeps
    return replace(track, segment=replace(track.segment, substeps=substeps))
