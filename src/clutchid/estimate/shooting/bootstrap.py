"""Bootstrap over strokes: how far a fit moves when it is repeated on strokes drawn at random from those recorded.

The covariance counts a fixed number of neighbouring residuals as one. The bootstrap does not: residuals of one stroke
are drawn together, coloured as they are. What the model gets wrong in the same way in every stroke it does not see.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.windows import Track
from clutchid.smoother.elimination import eliminate
from clutchid.smoother.problem import FitProblem, LinearisedProblem
from clutchid.smoother.projection import ShootingSolution

#: Below this share of its stroke the piston rests.
REST = 0.1

#: Fewest strokes that say how they scatter: 8 know a deviation to 1/sqrt(2 x 7), a quarter. Else pieces of `PIECE` s.
FEWEST, PIECE = 8, 1.0

Numbers = tuple[NDArray[np.int64], ...]


def strokes(task: FitProblem) -> Numbers:
    """The stroke that each window belongs to, an array a track; numbers go on from track to track.

    A stroke begins with the first window in which the piston is back at rest, and ends before the next such one: the
    chamber is vented there, so strokes tell little of each other. A rest after the last stroke belongs to that stroke.

    A recording of fewer than `FEWEST` strokes, or one that never returns to rest, is cut into equal pieces of about
    `PIECE` instead. Blocks must be longer than residuals are correlated, or the bootstrap takes for independent what is
    not; a second is long against what colours them, the lags of sensors and valves and the slip of the friction.

    Parameters
    ----------
    task : FitProblem
        The problem, its tracks in the order of their recordings.

    Returns
    -------
    numbers : array a track
        From 0, without gaps.
    """
    found: list[NDArray[np.int64]] = []
    first = 0
    for log in dict.fromkeys(track.log for track in task.tracks):
        mine = [track for track in task.tracks if track.log == log]
        cut = [_excursions(track, REST * task.actuator.parameters.y_max) for track in mine]
        if sum(int(numbers[-1]) + 1 for numbers in cut) < FEWEST:
            cut = [_pieces(track) for track in mine]
        for numbers in cut:
            found.append(first + numbers)
            first += int(numbers[-1]) + 1
    return tuple(found)


def _excursions(track: Track, rest: float) -> NDArray[np.int64]:
    """Strokes of a track by its returns below the position `rest` in m; one stroke where no position is measured."""
    level = np.full(len(track.windows), np.nan)
    for i, window in enumerate(track.windows):
        position = track.measured["position"][window.start : window.stop]
        if np.isfinite(position).any():
            level[i] = np.nanmedian(position)
    known = np.flatnonzero(np.isfinite(level))
    if known.size == 0:
        return np.zeros(level.size, dtype=np.int64)
    at_rest = np.interp(np.arange(level.size), known, level[known]) < rest
    begins = np.zeros(level.size, dtype=np.int64)
    begins[1:] = at_rest[1:] & ~at_rest[:-1]
    outside = np.flatnonzero(~at_rest)
    begins[(int(outside[-1]) if outside.size else 0) + 1 :] = 0
    return np.cumsum(begins)


def _pieces(track: Track) -> NDArray[np.int64]:
    """Equal pieces of a track of about `PIECE`."""
    windows = len(track.windows)
    pieces = min(windows, max(1, round(float(track.segment.dt.sum()) / PIECE)))
    return np.arange(windows, dtype=np.int64) * pieces // windows


def bootstrap(task: FitProblem, found: ShootingSolution, draws: int = 200, seed: int = 0) -> FloatArray:
    """Free numbers x as they would be found on strokes drawn with replacement, shape (draws, k).

    Each is one Gauss-Newton step from the end of the search, so no simulation is repeated. Bounds of x are not kept:
    the covariance, which this is to check, does not know them either.

    Parameters
    ----------
    task : FitProblem
        The problem.
    found : ShootingSolution
        Where its search ended.
    draws : 1
        How many, above 0; 200 know a deviation to 5 %, the strokes seldom do.
    seed : 1
        Of the generator.

    Returns
    -------
    x : (draws, k)
        NaN where there is one stroke only: it does not say how strokes scatter.

    References
    ----------
    Blocks of coloured residuals: Künsch 1989. Resampled gradients at a fixed information: Kline and Santos 2012.
    """
    numbers = strokes(task)
    known, moves = steps(found.at, numbers)
    count = moves.shape[1]
    if count < 2:
        return np.full((draws, found.x.size), np.nan)
    times = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), size=draws)
    return found.x + known + times @ moves.T


def steps(linear: LinearisedProblem, numbers: Numbers) -> tuple[FloatArray, FloatArray]:
    """The Gauss-Newton step as the sum of what is known before the data, shape (k,), and of each stroke, (k, strokes).

    A stroke that is drawn n times pulls n times; the information, so how far a pull moves, stays that of all strokes.
    To draw the rows themselves would cut the chain at every stroke that is left out, and with it the tie to the vented
    rest that tells the pressure: on recordings of the model itself the load then scattered two to three times too far.

    A residual stands in the column of its stroke, so one elimination serves all draws.
    """
    k = linear.prior.shape[1] - 1
    count = 2 + max(int(track.max()) for track in numbers)
    parts = [_spread_out(linear.prior, 0, count)]
    for chain, track in zip(linear.chains, numbers, strict=True):
        linearised, at = chain.windows.linearised, track + 1
        own, links = _spread_out(linearised.of_states, at, count), _spread_out(chain.links, at[:-1], count)
        parts.append(eliminate(_spread_out(chain.first, 0, count), own, links).rows)
        alone = linearised.of_theta
        parts.append(_spread_out(alone, np.repeat(at, alone.shape[0] // at.size), count))
    factor = triangular(np.vstack(parts))[:k]
    pulls = -np.linalg.lstsq(factor[:, :k], factor[:, k:], rcond=None)[0].astype(np.float64)
    return pulls[:, 0], pulls[:, 1:]


def _spread_out(rows: FloatArray, places: NDArray[np.int64] | int, count: int) -> FloatArray:
    """`rows` with their residual in column `places` of `count`; places are those of the first axis."""
    residual = np.zeros((*rows.shape[:-1], count))
    residual[np.arange(rows.shape[0]), ..., places] = rows[..., -1]
    return np.concatenate([rows[..., :-1], residual], axis=-1)


def ratio(task: FitProblem, x: FloatArray, known: FloatArray) -> float:
    """How many times wider the load scatters in the draws `x` than the covariance of the noise says.

    The median over those points of the load's grid that the piston has passed: beyond, what was known before stands,
    which no draw moves. 1 where the covariance counts coloured residuals rightly; the number of residuals that it
    counts as one is to be taken by the square. It reads low where much was known before, and 8 strokes tell it to a
    quarter only.

    Parameters
    ----------
    task : FitProblem
        The problem.
    x : (draws, k)
        Draws of `bootstrap`.
    known : (k, m)
        Square root of the covariance that the recording's noise leaves, as `Spread.known`.

    Returns
    -------
    ratio : 1
        NaN where no load is free, the draws are NaN, or no position is measured.
    """
    load = task.actuator.load
    places = [(i, load.names.index(c.base)) for i, c in enumerate(task.coordinates) if c.base in load.names]
    y = _moved_windows(task)
    if not places or not y.size or not np.isfinite(x).all():
        return float("nan")
    rows, columns = (list(side) for side in zip(*places, strict=True))
    phi = load.phi(y)[:, columns] * task.slopes(np.mean(x, axis=0))[rows]
    drawn, expected = np.std(phi @ x[:, rows].T, axis=1), np.linalg.norm(phi @ known[rows], axis=1)
    known_at = expected > 0.0
    return float(np.median(drawn[known_at] / expected[known_at]))


def _moved_windows(task: FitProblem) -> FloatArray:
    """Points of the load's grid, in m, between the lowest and the highest measured position."""
    y = np.linspace(0.0, task.actuator.parameters.y_max, 101)
    measured = [track.measured["position"][track.segment.start : track.segment.stop] for track in task.tracks]
    position = np.concatenate(measured)
    position = position[np.isfinite(position)]
    return y[(y >= position.min()) & (y <= position.max())] if position.size else y[:0]
