"""Bootstrap over excursions from rest: scatter of the estimate where they are resampled.

The covariance assumes a fixed number of correlated samples. The bootstrap does not: the residuals of an excursion are
resampled together, with their autocorrelation. It does not detect model errors that are the same in every excursion.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import LinearisedProblem
from clutchid.inference.smoother.rows import eliminate, stacked_factor
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.log import FloatArray
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.windows import Track

#: The piston is at rest below this fraction of its travel.
_REST_SHARE = 0.1

#: Fewest excursions for a bootstrap over them: 8 give a standard deviation with a relative error of 1/sqrt(2 x 7), a
#: quarter. A recording with fewer is cut into pieces of this length in s.
FEWEST_EXCURSIONS, _PIECE_LENGTH = 8, 1.0

ExcursionNumbers: TypeAlias = tuple[NDArray[np.int64], ...]


def excursions(problem: Problem) -> ExcursionNumbers:
    """Number of the excursion of each window, one array per track, consecutive over all tracks.

    An excursion begins with the first window in which the piston is back at rest, and ends before the next such window.
    The chamber is vented there, so that excursions are nearly independent. A rest after the last one belongs to it.

    A recording with fewer than `FEWEST_EXCURSIONS` excursions, or without a return to rest, is cut into equal pieces of
    about `_PIECE_LENGTH`. The blocks of a bootstrap must be longer than the correlation time of the residuals; a second
    is longer than the lags of sensors and valves and the stick-slip that cause it.

    Parameters
    ----------
    problem : Problem
        With its tracks in the order of the recordings.

    Returns
    -------
    numbers : one array per track
        From 0, without gaps.
    """
    result: list[NDArray[np.int64]] = []
    first = 0
    for log in dict.fromkeys(track.log for track in problem.tracks):
        mine = [track for track in problem.tracks if track.log == log]
        cut = [_by_returns(track, _REST_SHARE * problem.actuator.parameters.y_max) for track in mine]
        if sum(int(numbers[-1]) + 1 for numbers in cut) < FEWEST_EXCURSIONS:
            cut = [_equal_pieces(track) for track in mine]
        for numbers in cut:
            result.append(first + numbers)
            first += int(numbers[-1]) + 1
    return tuple(result)


def _by_returns(track: Track, rest: float) -> NDArray[np.int64]:
    """Number of the excursion of each window, by the returns below the position `rest` in m; 0 without a position."""
    level = np.full(len(track.windows), np.nan)
    for i, window in enumerate(track.windows):
        position = track.measured["position"][window.start : window.stop]
        if np.isfinite(position).any():
            level[i] = np.nanmedian(position)
    measured = np.flatnonzero(np.isfinite(level))
    if measured.size == 0:
        return np.zeros(level.size, dtype=np.int64)
    at_rest = np.interp(np.arange(level.size), measured, level[measured]) < rest
    begins = np.zeros(level.size, dtype=np.int64)
    begins[1:] = at_rest[1:] & ~at_rest[:-1]
    outside = np.flatnonzero(~at_rest)
    begins[(int(outside[-1]) if outside.size else 0) + 1 :] = 0
    return np.cumsum(begins)


def _equal_pieces(track: Track) -> NDArray[np.int64]:
    """Numbers of equal pieces of a track, of about `_PIECE_LENGTH`."""
    windows = len(track.windows)
    pieces = min(windows, max(1, round(float(track.segment.dt.sum()) / _PIECE_LENGTH)))
    return np.arange(windows, dtype=np.int64) * pieces // windows


def bootstrap(problem: Problem, solution: ShootingSolution, draws: int = 200, seed: int = 0) -> FloatArray:
    """Estimates of the free parameters x from excursions drawn with replacement, shape (draws, k).

    Each is one Gauss-Newton step from the solution, so that no simulation is repeated. The bounds of x are ignored, as
    in the covariance that the bootstrap checks.

    Parameters
    ----------
    problem : Problem
        Free parameters and recordings.
    solution : ShootingSolution
        Its solution.
    draws : 1
        Number of draws, above 0; 200 give a standard deviation to 5 %, apart from the small number of excursions.
    seed : 1
        Of the random generator.

    Returns
    -------
    x : (draws, k)
        NaN for a single one.

    References
    ----------
    Block bootstrap: Künsch 1989. Resampled gradients with fixed information matrix: Kline and Santos 2012.
    """
    numbers = excursions(problem)
    prior_step, excursion_steps = gauss_newton_steps(solution.at, numbers)
    count = excursion_steps.shape[1]
    if count < 2:
        return np.full((draws, solution.x.size), np.nan)
    times = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), size=draws)
    return solution.x + prior_step + times @ excursion_steps.T


def gauss_newton_steps(linear: LinearisedProblem, numbers: ExcursionNumbers) -> tuple[FloatArray, FloatArray]:
    """The Gauss-Newton step, split into the parts due to the prior, shape (k,), and to each excursion, (k, excursions).

    An excursion that is drawn n times contributes n times its gradient; the information matrix stays that of all.
    Resampling the rows instead would cut the chain at every omitted excursion, and with it the link to the vented rest
    that determines the pressure: for recordings simulated with the model itself, the load then scattered two to three
    times too much.

    The residuals of each excursion have a column of their own, so that one elimination serves all draws.
    """
    k = linear.prior.shape[1] - 1
    count = 2 + max(int(track.max()) for track in numbers)
    parts = [_by_excursion(linear.prior, 0, count)]
    for chain, track in zip(linear.chains, numbers, strict=True):
        linearised, at = chain.windows.linearised, track + 1
        windows, links = _by_excursion(linearised.state_rows, at, count), _by_excursion(chain.links, at[:-1], count)
        parts.append(eliminate(_by_excursion(chain.first, 0, count), windows, links).rows)
        parts.append(stacked_factor(_by_excursion(linearised.theta_rows, at, count)))
    factor = triangular(np.vstack(parts))[:k]
    contributions = -np.linalg.lstsq(factor[:, :k], factor[:, k:], rcond=None)[0].astype(np.float64)
    return contributions[:, 0], contributions[:, 1:]


def _by_excursion(rows: FloatArray, places: NDArray[np.int64] | int, count: int) -> FloatArray:
    """`rows` with their residual in column `places` of `count`, one place for each element of the first axis."""
    residual = np.zeros((*rows.shape[:-1], count))
    residual[np.arange(rows.shape[0]), ..., places] = rows[..., -1]
    return np.concatenate([rows[..., :-1], residual], axis=-1)


def scatter_ratio(problem: Problem, x: FloatArray, noise_root: FloatArray) -> float:
    """Ratio of the standard deviation of the load over the draws `x` to that of the covariance due to noise.

    The median over the points of the load's grid that the piston has passed; beyond, the prior determines the load. It
    is 1 if the assumed number of correlated samples is right, and proportional to the square root of the actual number.
    A strong prior makes it too small, and 8 excursions determine it to a quarter only.

    Parameters
    ----------
    problem : Problem
        Free parameters and recordings.
    x : (draws, k)
        Draws of `bootstrap`.
    noise_root : (k, m)
        Square root of the covariance due to noise, `Posterior.noise_root`.

    Returns
    -------
    ratio : 1
        NaN if no load is free, the draws are NaN, or no position is measured.
    """
    load = problem.actuator.load
    places = [(i, load.names.index(c.base)) for i, c in enumerate(problem.coordinates) if c.base in load.names]
    y = _passed_positions(problem)
    if not places or not y.size or not np.isfinite(x).all():
        return float("nan")
    rows, columns = (list(side) for side in zip(*places, strict=True))
    phi = load.phi(y)[:, columns] * problem.slopes(np.mean(x, axis=0))[rows]
    drawn, expected = np.std(phi @ x[:, rows].T, axis=1), np.linalg.norm(phi @ noise_root[rows], axis=1)
    determined = expected > 0.0
    return float(np.median(drawn[determined] / expected[determined]))


def _passed_positions(problem: Problem) -> FloatArray:
    """Points of the load's grid, in m, between the lowest and the highest measured position."""
    y = np.linspace(0.0, problem.actuator.parameters.y_max, 101)
    measured = [track.measured["position"][track.segment.start : track.segment.stop] for track in problem.tracks]
    position = np.concatenate(measured)
    position = position[np.isfinite(position)]
    return y[(y >= position.min()) & (y <= position.max())] if position.size else y[:0]
