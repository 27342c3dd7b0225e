r"""Evidence of one vehicle on its wear and its use, for each node of the variances of its type.

Gaussian processes in closed form. Wear :math:`u = a + \int r\,ds + w` over the clutches of a vehicle: its rate r walks,
and goes on where a clutch is replaced. The use, in strokes or km a day, is level, walk and scatter of a logarithm. A
single vehicle cannot say how large walk and scatter are: what is kept is the state at the last recording, with its
likelihood at each node, from which `clutchid.wear.pooling` learns them by type.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import SHARES_BY, Measurement
from clutchid.log import FloatArray, IntArray
from clutchid.wear.history import History, RecordingJob
from clutchid.wear.trend import (
    CHANGE_OUTCOMES,
    CHANNELS,
    GROWTH,
    LIFE,
    NEW,
    TrendModel,
    TrendStep,
    errors_in,
    linearised,
    state_before,
)


class WearNode(NamedTuple):
    """Variances of independent and of shared errors over the stated ones; walk and scatter in usual rates."""

    noise: float
    shared: float
    walk: float
    scatter: float


class UseNode(NamedTuple):
    """Standard deviations of the logarithm of the use: from interval to interval, and of its walk in a year."""

    scatter: float
    walk: float


#: Nodes of the variances, factors of 2.5 to 4 apart, on both sides of the guesses for a single vehicle.
WEAR_NODES = tuple(
    map(WearNode._make, product((1 / 16, 1 / 4, 1.0), (1 / 4, 1.0), (0.05, 0.2, 0.8), (0.015, 0.05, 0.15)))
)
USE_NODES = tuple(map(UseNode._make, product((0.08, 0.2, 0.5), (0.03, 0.1, 0.3))))

#: Standard deviations, before any reading, of a rate in usual rates and of a level of the use: wide, as the type's own
#: takes their place.
WIDE_RATE, WIDE_LEVEL = 10.0, 5.0

#: Logarithm of a usual use in lives a day and a km: a life of three years and 400,000 km.
USUAL_USE = np.log([1 / LIFE["days"], 1 / LIFE["km"]])

#: Shortest time in days over which a use is a rate.
_WEEK = 7.0

#: Range of logarithms of a use that is a mere unit, as where days are the axis.
_SAME = 1e-9

#: Most recordings of a vehicle, the last ones, that are used: the cost grows with the cube.
_MOST = 120

_YEAR = 365.25


class LifeEvidence(NamedTuple):
    """State at the last recording, by node; of many vehicles with a first axis for these.

    Lengths are shares of the usual wear in a life (`clutchid.wear.trend.GROWTH`), in the direction of the limit, and
    times are lives.

    Attributes
    ----------
    wear : (nodes, 6)
        Logarithm of the likelihood; mean of wear and rate; their variances, and the covariance.
    limit
        Wear that ends the life.
    constant
        Standard deviation of the wear by the error that all vehicles of a calibration share, at the most likely node
        and as large as stated.
    interval : days
        Mean time between two recordings; NaN where it is not known.
    use : (2, nodes, 3)
        Of the logarithms of the life a day, and a km: logarithm of the likelihood, mean and variance of the level.
    """

    wear: FloatArray
    limit: FloatArray
    constant: FloatArray
    interval: FloatArray
    use: FloatArray

    def at(self, places: slice | None) -> LifeEvidence:
        """That of some vehicles; with None of a single one as that of one among many."""
        return LifeEvidence(*(part[places] for part in self))

    @property
    def packed(self) -> str:
        """As text, for a table."""
        return b64encode(np.concatenate([np.ravel(part) for part in self]).astype("<f4").tobytes()).decode()


#: Shapes of the fields of the evidence of one vehicle.
_SHAPES = ((len(WEAR_NODES), 6), (), (), (), (2, len(USE_NODES), 3))


def evidence_from(texts: Sequence[str]) -> LifeEvidence:
    """The evidence of vehicles from their texts, whose lengths are multiples of four."""
    table = np.frombuffer(b64decode("".join(texts)), "<f4").astype(np.float64).reshape(len(texts), -1)
    ends = np.cumsum([int(np.prod(shape)) for shape in _SHAPES])
    parts = np.split(table, ends[:-1], axis=1)
    return LifeEvidence(*(part.reshape(len(texts), *shape) for part, shape in zip(parts, _SHAPES, strict=True)))


def life_evidence(
    model: TrendModel,
    history: History,
    measurements: Sequence[Measurement | None],
    steps: Sequence[TrendStep],
    states: Sequence[tuple[FloatArray, FloatArray]],
    ends: tuple[str, float],
) -> LifeEvidence | None:
    """The evidence of a vehicle along a path of its trend, with the quantity and the value that end its life.

    `states` are the smoothed ones of the path. None where no measurement counts on the path.
    """
    name, limit = ends
    per_life = float(np.copysign(GROWTH[name].rate, limit))
    rows = _rows(model, history.s, measurements, steps, states, model.quantities.index(name))
    if rows is None:
        return None
    dated = [history.dated[i] for i in history.order]
    lives, days, km = (
        history.s / model.life,
        *(np.array(column) for column in zip(*map(_day_and_km, dated), strict=True)),
    )
    use = np.stack([_level(lives, x, days, usual) for x, usual in zip((days, km), USUAL_USE, strict=True)])
    gaps = np.diff(days)
    interval = np.array(gaps.mean() if gaps.size else np.nan)
    wear, constant = _wear(rows, per_life)
    return LifeEvidence(wear, np.array(limit / per_life), np.array(constant), interval, use)


def _day_and_km(job: RecordingJob) -> tuple[float, float]:
    return job.begin.timestamp() / 86400.0 if job.begin else np.nan, job.odometer


class _Rows(NamedTuple):
    """Values that were measured in a quantity, where, since when its clutch was there, and their errors.

    The last row of `s`, `new` and `clutch` is the end, without a value: `values` and `slopes` have one less. `clutch`
    is the number of the clutch, `new` where on the axis it was new, `start` the variance of its quantity there.
    `shared` is the covariance of the errors that recordings share, `constant` the part of it that is the same at any
    temperature, the error of the calibration, and `own` the variance of each one's own.
    """

    values: FloatArray
    slopes: FloatArray
    s: FloatArray
    new: FloatArray
    clutch: IntArray
    start: FloatArray
    shared: FloatArray
    constant: FloatArray
    own: FloatArray


def _rows(
    model: TrendModel,
    s: FloatArray,
    measurements: Sequence[Measurement | None],
    steps: Sequence[TrendStep],
    states: Sequence[tuple[FloatArray, FloatArray]],
    quantity: int,
) -> _Rows | None:
    """The measurements of a quantity that count, in lives; those since a sudden change do not."""
    channels = [c for c, (q, _) in enumerate(model.channels) if q == quantity]
    growth, (_, covariance) = GROWTH[model.quantities[quantity]], state_before(model, measurements)
    rows: list[tuple[float, float, float, FloatArray, float, int]] = []
    new, starts = list[float](), list[float]()
    last, changed = np.nan, False
    for at, now, step, (mean, P) in zip(s.tolist(), measurements, steps, states, strict=True):
        if now is None:
            continue
        since, last = at - last, at
        if step.outcome not in ("used", *CHANGE_OUTCOMES):
            continue
        if not new:
            new, starts = [at], [growth.start**2]
        if step.outcome == "replaced":
            new.append(at - since / 2)
            starts.append((NEW * growth.start) ** 2 + (float(mean[2 * quantity + 1]) * since) ** 2 / 12)
        changed = (changed or step.outcome == "sudden") and step.outcome != "replaced"
        if not changed:
            slopes, offsets = linearised(model, mean, P)
            errors, shares = errors_in(model, now), SHARES_BY[now.by]
            for c in channels:
                value, std = ((now.shift, now.shift_std), (now.load, now.load_std))[c]
                own = (shares[CHANNELS[c]].independent * std) ** 2
                rows.append((at, value - offsets[c], slopes[c, 2 * quantity], errors[c], own, len(new) - 1))
    if not rows:
        return None
    places, values, slope, shares_of, variances, numbers = (
        np.array(column) for column in zip(*rows[-_MOST * len(channels) :], strict=True)
    )
    clutch = np.append(numbers, len(new) - 1)
    places_of = [k for reader in model.readers for k in range(model.size)[model.errors_by(reader)[0]]]
    constants = shares_of[:, places_of]
    return _Rows(
        values, slope, np.append(places, s[-1]) / model.life, np.array(new)[clutch] / model.life, clutch,
        np.array(starts)[clutch], shares_of @ covariance @ shares_of.T,
        constants @ covariance[np.ix_(places_of, places_of)] @ constants.T, variances,
    )  # fmt: skip


def _wear(rows: _Rows, usual: float) -> tuple[FloatArray, float]:
    """`LifeEvidence.wear` and `constant` from values whose usual growth over a life is given, below 0 if it falls."""
    z, since = rows.s[-1] - rows.s, rows.s[-1] - rows.new
    age, same = rows.s - rows.new, rows.clutch[:, None] == rows.clutch
    start = same * rows.start / usual**2 + WIDE_RATE**2 * np.outer(age, age)
    walked = _walk(since, since) - _walk(since, z) - _walk(z, since) + _walk(z, z)
    scattered = same * np.maximum(np.minimum(age[:, None], age), 0.0)
    slopes, nodes = usual * rows.slopes, np.array(WEAR_NODES)[:, :, None, None]
    K = start + nodes[:, 2] ** 2 * walked + nodes[:, 3] ** 2 * scattered
    of_values = slopes[:, None] * K[:, :-1, :-1] * slopes + nodes[:, 1] * rows.shared + nodes[:, 0] * np.diag(rows.own)
    rate = np.broadcast_to(WIDE_RATE**2 * age[:-1], K[:, :-1, -1].shape)
    to_values = np.stack([slopes * K[:, :-1, -1], slopes * rate], axis=-1)
    prior = np.empty((len(WEAR_NODES), 2, 2))
    prior[:, 0, 0], prior[:, 1, 1] = K[:, -1, -1], WIDE_RATE**2
    prior[:, 0, 1] = prior[:, 1, 0] = WIDE_RATE**2 * age[-1]
    log, mean, P = _conditioned(rows.values, of_values, to_values, prior)
    best = int(np.argmax(log))
    gain = np.linalg.solve(of_values[best], to_values[best, :, 0])
    return np.column_stack([log, mean, P[:, 0, 0], P[:, 1, 1], P[:, 0, 1]]), float(np.sqrt(gain @ rows.constant @ gain))


def _walk(a: FloatArray, b: FloatArray) -> FloatArray:
    """Covariance of the integrals of a random walk to a and to b, (a, b)."""
    low, high = np.minimum(a[:, None], b), np.maximum(a[:, None], b)
    return np.asarray(low**2 * (3 * high - low) / 6)


def _conditioned(
    values: FloatArray, of_values: FloatArray, to_values: FloatArray, prior: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithm of the density of values, and mean and covariance of states given these, all of mean 0, by node.

    Parameters
    ----------
    values : (m,)
        Same for all nodes.
    of_values, to_values, prior : (nodes, m, m), (nodes, m, states), (nodes, states, states)
        Covariance of the values, of these with the states, and of the states.
    """
    L = np.linalg.cholesky(of_values)
    white = np.linalg.solve(L, np.concatenate([np.broadcast_to(values, L.shape[:2])[..., None], to_values], axis=-1))
    y, gain = white[..., :1], white[..., 1:]
    log = -0.5 * np.square(y[..., 0]).sum(axis=-1) - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=-1)
    across = np.swapaxes(gain, 1, 2)
    return log, (across @ y)[..., 0], prior - across @ gain


def _level(lives: FloatArray, x: FloatArray, days: FloatArray, usual: float) -> FloatArray:
    """`LifeEvidence.use` of lives over x; wide without two recordings, and NaN where x is not known."""
    if not np.isfinite(x).all() or not np.isfinite(days).all():
        return np.full((len(USE_NODES), 3), np.nan)
    ends = [0]
    for k, day in enumerate(days):
        if day - days[ends[-1]] >= _WEEK:
            ends.append(k)
    dx, ds, middle = np.diff(x[ends]), np.diff(lives[ends]), (days[ends[1:]] + days[ends[:-1]]) / 2
    counts = (dx > 0.0) & (ds > 0.0)
    y, z = np.log(ds[counts] / dx[counts])[-_MOST:], days[-1] - middle[counts][-_MOST:]
    if y.size and np.ptp(y) < _SAME:
        return np.tile([0.0, y[0], 0.0], (len(USE_NODES), 1))
    nodes = np.array(USE_NODES)[:, :, None, None]
    K = WIDE_LEVEL**2 + nodes[:, 1] ** 2 * np.minimum(z[:, None], z) / _YEAR + nodes[:, 0] ** 2 * np.eye(y.size)
    shared = np.full((len(USE_NODES), 1, 1), WIDE_LEVEL**2)
    log, mean, P = _conditioned(y - usual, K, np.broadcast_to(shared, (len(USE_NODES), y.size, 1)), shared)
    return np.column_stack([log, mean + usual, P[:, 0]])
