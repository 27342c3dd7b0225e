r"""Trend of a clutch's wear over its recordings: Kalman filters and smoothers over hypotheses about each recording.

A quantity grows at a rate that walks, :math:`du = r\,ds + dw_u, \; dr = dw_r`, over strokes, distance or time s. Each
channel (shift, load) measures :math:`f(u) + a + b + g\,(T - T_{ref}) + v`: the constant error b and that by temperature
g are the same for all recordings of a vehicle that `observe` has read, or `estimate`, v is not; a is the sum of the
sudden changes of this clutch.

Before each measurement the clutch may have been replaced, or its load changed suddenly, or the measurement may be an
outlier. A sequence of these is a path with a filter of its own; the posterior probabilities of the paths, by Bayes'
rule, are those of the alarms (multiple hypothesis tracking: Reid, 1979, IEEE Trans. Automatic Control 24(6), 843-854).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Literal, NamedTuple

import numpy as np
from scipy import special

from clutchid.estimation.assess.comparison import SHARES_BY, WORTH, By, Measurement
from clutchid.log import FloatArray


class Growth(NamedTuple):
    """Growth of a quantity: standard deviations of its first value, of its rate over a life, and of a jump.

    `walk` is the standard deviation of the rate's random walk over a life, as a share of `rate`.
    """

    start: float
    rate: float
    jump: float
    walk: float


#: Shift [m] and relative load: guesses from the virtual trucks' full range, 0 to 0.7 mm and 0 to 18 %; and wear of the
#: facing [m], where a calibration of load against wear is given. The walk was chosen on types 4 to 7 of both families,
#: so that forecasts hold (`benchmarks/wear_drawn.py`): shift and load go with wear along a curve, wear does not.
GROWTH = {
    "shift": Growth(0.5e-3, 0.7e-3, 0.5e-3, 0.4),
    "load": Growth(0.2, 0.2, 0.2, 0.4),
    "wear": Growth(4e-3, 6e-3, 4e-3, 0.25),
}

#: A life, in which the rate of a quantity may double or vanish: strokes, km, days; a facing of 3.5 mm in the virtual
#: fleet, as trucks in distribution traffic have.
LIFE = {"strokes": 1e6, "km": 4e5, "days": 1100.0, "recordings": 150.0}

#: Standard deviation of the scatter of wear over a life, as a share of the rate over a life. A guess.
_SCATTER = 0.05


#: Correlation of the constant errors of two readers, which have the calibration in common: benchmarks/results/wear.md,
#: "By observe".
_ALIKE = 0.5

#: Air temperature in K that counts as that of the calibration where it had none.
REFERENCE = 293.15


class Occurrence(NamedTuple):
    """Frequencies of events: a replaced clutch and a sudden change in a life, an outlier in a recording."""

    replaced: float
    sudden: float
    outlier: float


#: Guesses on the generous side: a clutch is replaced once in a life, has a fault once in twenty, and one reading in a
#: hundred misses.
_OCCURRENCE = Occurrence(1.0, 0.05, 0.01)

#: Spread of new clutches of a type around the calibrated one, as a share of that of a first value; and of the rate of
#: the next clutch of a vehicle around that of the one before, as a share of that of a first rate and of it. Guesses.
NEW, _NEXT_RATE = 0.05, 0.25

#: Scale of the error of an outlier in standard deviations of its reading; it has the tails of a Cauchy distribution.
#: A guess.
_OUTLYING = 3.0

#: Probability above which the kind of a change is stated, else it is unknown.
SURE = 0.95

#: False alarms in a recording, at most: benchmarks/results/wear.md, "Alarms by kind", has none to 1 in 1,000.
FALSE_ALARMS = 1e-3

#: Share of the measurements of an unchanged clutch that are used without a look at what else they may be.
_EXPECTED = 0.95

#: Measurements after which a decision is final, and the least probability and the largest number of paths that are
#: followed. Guesses on the generous side.
_LAG, _LEAST, _PATHS = 4, 1e-4, 16

#: Fall of the vented rest in m over a life of a clutch without an adjuster, whose rest falls by 6.3 times the wear of a
#: facing of 3.5 mm; and how many times faster than so far the rest may fall. Guesses on the generous side.
FALL, FALL_FACTOR = 22e-3, 5.0

#: Recordings in a row that read a leak, with a probability above the second: by chance alone at most `FALSE_ALARMS`.
LEAKS, LEAKING = 2, 1.0 - FALSE_ALARMS**0.5

#: A leak below this in m³/(Pa·s), 0.04 g/s at 5 bar, is that of seals that age: of virtual trucks 7e-12 after a life.
AGED = 1e-11

#: Recordings in a row that are farther from the calibration than a change explains.
DEPARTED = 3


_Function = Callable[[FloatArray], FloatArray]

#: Outcomes of a recording in the trend; those that are a change of the clutch.
Outcome = Literal["used", "left out", "replaced", "sudden", "missing"]
CHANGE_OUTCOMES: tuple[Outcome, Outcome] = ("replaced", "sudden")

#: The channels of a measurement, with the state that their constant error takes first.
CHANNELS = ("shift", "load")


class Interval(NamedTuple):
    """A value with its interval; NaN is unknown.

    Attributes
    ----------
    value, low, high
        In the unit of the quantity.
    """

    value: float
    low: float
    high: float


class Band(NamedTuple):
    """A quantity by recording.

    Attributes
    ----------
    value : (n,)
        In SI.
    low, high : (n,)
        95 % band.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def last(self) -> Interval:
        """The quantity at the last recording; unknown without one."""
        return Interval(*(float(side[-1]) if side.size else float("nan") for side in self))


class WearTable(NamedTuple):
    """Half-load position and load against the wear of the facing, all against the new clutch: arrays (n,) in SI."""

    wear: FloatArray
    shift: FloatArray
    load: FloatArray


class LaterCalibration(NamedTuple):
    """Load of a later calibration of a vehicle against that of its first one, with standard deviations.

    `shift` [m] is that of the half-load position, `load` the relative change of the mean load over 5 to 8 mm.
    """

    shift: float
    shift_std: float
    load: float
    load_std: float

    def since_first(self, now: Measurement, number: int) -> Measurement:
        """A change since this calibration, which is that with a number, as one since the first."""
        load = (1.0 + self.load) * (1.0 + now.load) - 1.0
        return now._replace(shift=self.shift + now.shift, load=load, calibration=number)


@dataclass(frozen=True, slots=True, eq=False)
class TrendModel:
    """Quantities that grow, and which one each channel measures, by a function of it.

    The state is (value, rate) of each quantity, then for each of `readers`, which read the recordings, (constant error,
    error in 10 K) of each channel, then the sum of the sudden changes of each channel, then the error with which each
    of `later` calibrations was compared with the first one, by channel. `life` is how much of s a life has.
    """

    quantities: tuple[str, ...]
    channels: tuple[tuple[int, _Function], ...]
    life: float
    readers: tuple[By, ...]
    later: tuple[LaterCalibration, ...] = ()

    @property
    def errors(self) -> int:
        """Index of the first errors in the state."""
        return 2 * len(self.quantities)

    def errors_by(self, reader: By) -> tuple[slice, slice]:
        """Places of the constant errors of a reader in the state, by channel, and of those by temperature."""
        first = self.errors + 2 * len(self.channels) * self.readers.index(reader)
        last = first + 2 * len(self.channels)
        return slice(first, last, 2), slice(first + 1, last, 2)

    @property
    def changes(self) -> int:
        """Index of the first channel's sudden changes in the state."""
        return self.errors + 2 * len(self.channels) * len(self.readers)

    def offsets(self, calibration: int) -> slice:
        """Places of the errors of a calibration after the first one in the state, by channel."""
        first = self.changes + len(self.channels) * calibration
        return slice(first, first + len(self.channels))

    @property
    def size(self) -> int:
        """Length of the state."""
        return self.changes + len(self.channels) * (1 + len(self.later))


class TrendStep(NamedTuple):
    """A recording in the trend: state before and after it, the transition, and the outcome of its measurement.

    `outcome` is "used", "left out" (an outlier), "missing", or, where the clutch or its load changed before it,
    "replaced" or "sudden". `decided` is the probability, when the outcome became final, of the paths with it or with a
    change near it.
    """

    s: float
    predicted: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    transition: FloatArray
    outcome: Outcome
    deviance: float
    decided: float = 1.0


class Path(NamedTuple):
    """A sequence of outcomes, with its posterior probability and its steps."""

    probability: float
    steps: tuple[TrendStep, ...]


def trend_model(
    life: float,
    table: WearTable | None = None,
    readers: tuple[By, ...] = ("estimate",),
    later: tuple[LaterCalibration, ...] = (),
) -> TrendModel:
    """Shift and load as quantities of their own, or, with a table, both as functions of the wear of the facing."""
    if table is None:
        return TrendModel(CHANNELS, ((0, _itself), (1, _itself)), life, readers, later)
    by_wear = [_interpolated(table.wear, values) for values in (table.shift, table.load)]
    return TrendModel(("wear",), ((0, by_wear[0]), (0, by_wear[1])), life, readers, later)


def _itself(u: FloatArray) -> FloatArray:
    return u


def _interpolated(x: FloatArray, values: FloatArray) -> _Function:
    """Linear interpolation that goes on with its first and last slope."""
    slopes = (values[1] - values[0]) / (x[1] - x[0]), (values[-1] - values[-2]) / (x[-1] - x[-2])

    def at(u: FloatArray) -> FloatArray:
        beyond = slopes[0] * np.minimum(u - x[0], 0.0) + slopes[1] * np.maximum(u - x[-1], 0.0)
        interpolated: FloatArray = np.interp(u, x, values) + beyond
        return interpolated

    return at


def traced(model: TrendModel, s: FloatArray, measurements: Sequence[Measurement | None]) -> tuple[Path, ...]:
    """The paths along recordings at `s`, in order, the most probable first; missing measurements are only predicted."""
    tracks = [_Track(0.0, *state_before(model, measurements), _Used(0.0, 0), ())]
    measured: list[int] = []
    last = 0.0
    for k, (at, now) in enumerate(zip(s, measurements, strict=True)):
        ds = float(at - s[k - 1]) if k else 0.0
        if now is None:
            tracks = [_missed(model, track, float(at), ds) for track in tracks]
            continue
        since = float(at) - last if measured else 0.0
        tracks = [after for track in tracks for after in _branches(model, track, (float(at), ds, since), now)]
        measured, last = [*measured, k], float(at)
        tracks = _pruned(tracks, measured[-_LAG - 2 :] if len(measured) > _LAG else ())
    shares = _shares(tracks)
    paths = [Path(float(share), track.steps) for share, track in zip(shares, tracks, strict=True)]
    return tuple(sorted(paths, key=lambda path: -path.probability))


class TrendOutcome(NamedTuple):
    """Outcome of a recording in the trend given all recordings, and its probability.

    `outcome` is that of a step, or "unknown" where the load has changed and whether by a new clutch is not sure.
    `change` is the probability that the load changed here or next to it, where that is largest; else 0.
    """

    outcome: Outcome | Literal["unknown"]
    probability: float
    change: float = 0.0


def verdicts(paths: Sequence[Path]) -> list[TrendOutcome]:
    """Outcome of each recording: a change only where it is certain there, or split with a less probable neighbour."""
    measured = [k for k, step in enumerate(paths[0].steps) if step.outcome != "missing"]
    change = [probability(paths, [k], CHANGE_OUTCOMES) for k in measured]
    results = [TrendOutcome("missing", 1.0)] * len(paths[0].steps)
    for i, k in enumerate(measured):
        around = slice(max(i - 1, 0), i + 2)
        nearest = [k, *measured[around]]
        shares = {
            kind: sum(path.probability for path in paths if _change(path.steps, nearest) == kind)
            for kind in CHANGE_OUTCOMES
        }
        decided = float(np.prod([paths[0].steps[j].decided for j in measured[around]]))
        likely = decided * sum(shares.values()) if change[i] == max(change[around]) else 0.0
        if likely and sum(shares.values()) >= SURE:
            kind = max(shares, key=shares.__getitem__)
            sure = shares[kind] >= SURE
            results[k] = TrendOutcome(kind if sure else "unknown", decided * shares[kind] if sure else likely, likely)
        else:
            used, outlier = (probability(paths, [k], (name,)) for name in ("used", "left out"))
            results[k] = TrendOutcome(*(("used", used) if used >= 0.5 else ("left out", outlier)), likely)
    return results


def _change(steps: Sequence[TrendStep], recordings: Sequence[int]) -> Outcome | None:
    """First change of a path among these recordings."""
    return next((steps[k].outcome for k in recordings if steps[k].outcome in CHANGE_OUTCOMES), None)


def probability(paths: Sequence[Path], recordings: Collection[int], outcomes: Collection[str]) -> float:
    """Posterior probability that one of the recordings has one of the outcomes."""
    return sum(path.probability for path in paths if any(path.steps[k].outcome in outcomes for k in recordings))


def smoothed_states(steps: Sequence[TrendStep]) -> list[tuple[FloatArray, FloatArray]]:
    """Mean and covariance of every step given all recordings (Rauch, Tung and Striebel)."""
    moments = [(step.mean, step.covariance) for step in steps[-1:]]
    for now, then in zip(steps[-2::-1], steps[:0:-1], strict=True):
        gain = np.linalg.solve(then.predicted_covariance, then.transition @ now.covariance).T
        mean, covariance = moments[-1]
        moments.append((
            now.mean + gain @ (mean - then.predicted),
            now.covariance + gain @ (covariance - then.predicted_covariance) @ gain.T,
        ))  # fmt: skip
    return moments[::-1]


class _Used(NamedTuple):
    """Sum of the deviances, and number of values, of the measurements that were used."""

    deviance: float
    number: int

    @property
    def scale(self) -> float:
        """Variance of the independent errors, as a multiple of that in the settings."""
        return (WORTH + self.deviance) / (WORTH + self.number)

    def limit(self, values: int) -> float:
        """Deviance of `values` values that a share `_EXPECTED` of them does not exceed."""
        return values * float(special.fdtri(values, self.freedom, _EXPECTED))

    @property
    def freedom(self) -> float:
        """Degrees of freedom with which the scale is known."""
        return WORTH + self.number


def _log_density(innovation: FloatArray, S: FloatArray, freedom: float) -> float:
    """Logarithm of the density of Student's multivariate t."""
    d, deviance = innovation.size, float(innovation @ np.linalg.solve(S, innovation))
    norm = special.gammaln((freedom + d) / 2) - special.gammaln(freedom / 2) - d / 2 * np.log(freedom * np.pi)
    return float(norm - np.linalg.slogdet(S)[1] / 2 - (freedom + d) / 2 * np.log1p(deviance / freedom))


class _Track(NamedTuple):
    """A path while it is followed: logarithm of its weight, its state, its noise, and its steps."""

    weight: float
    mean: FloatArray
    covariance: FloatArray
    used: _Used
    steps: tuple[TrendStep, ...]


def _missed(model: TrendModel, track: _Track, at: float, ds: float) -> _Track:
    """A path at a recording without a measurement."""
    F, Q = _motion(model, ds)
    mean, P = F @ track.mean, F @ track.covariance @ F.T + Q
    return track._replace(
        mean=mean, covariance=P, steps=(*track.steps, TrendStep(at, mean, P, mean, P, F, "missing", float("nan")))
    )


def _branches(model: TrendModel, track: _Track, where: tuple[float, float, float], now: Measurement) -> list[_Track]:
    """Branches of a path at a measurement, one for each outcome; one only where the trend expects the measurement."""
    _, _, since = where
    expected = _branch(model, track, where, now, "used")
    if track.used.number and expected.steps[-1].deviance <= track.used.limit(len(model.channels)):
        return [expected]
    priors: dict[Outcome, float] = {"left out": _OCCURRENCE.outlier}
    if since > 0.0:  # nothing changes before the first measurement
        priors |= {name: -np.expm1(-getattr(_OCCURRENCE, name) * since / model.life) for name in CHANGE_OUTCOMES}
    others = [(_branch(model, track, where, now, outcome), prior) for outcome, prior in priors.items()]
    branches = [(expected, max(1.0 - sum(priors.values()), _OCCURRENCE.outlier)), *others]
    return [branch._replace(weight=branch.weight + float(np.log(prior))) for branch, prior in branches]


def _branch(
    model: TrendModel, track: _Track, where: tuple[float, float, float], now: Measurement, outcome: Outcome
) -> _Track:
    """A path at a measurement with an outcome, weighed by its likelihood."""
    at, ds, since = where
    F, Q = _changed(model, track.mean, (ds, since), outcome)
    mean, P = F @ track.mean, F @ track.covariance @ F.T + Q
    after, used = _corrected(model, mean, P, now, track.used.scale), track.used
    S, freedom = after.S, track.used.freedom
    if outcome == "left out":
        S, freedom = S + np.diag((_OUTLYING * np.array([now.shift_std, now.load_std])) ** 2), 1.0
        after = after._replace(mean=mean, covariance=P)
    elif outcome == "used":
        used = _Used(used.deviance + after.deviance, used.number + len(model.channels))
    step = TrendStep(at, mean, P, after.mean, after.covariance, F, outcome, after.deviance)
    weight = track.weight + _log_density(after.innovation, S, freedom)
    return _Track(weight, after.mean, after.covariance, used, (*track.steps, step))


def _pruned(tracks: Sequence[_Track], last: Sequence[int]) -> list[_Track]:
    """The most probable paths; of those that differ at the first of the `last` recordings that is not final, only the
    ones that agree with the best.

    Where that is a change whose kind is not sure, both kinds are followed.
    """
    shares = dict(zip(map(id, tracks), _shares(tracks), strict=True))
    if last:
        final, near = last[-_LAG - 1], last[: 2 - _LAG]
        by_outcome: dict[Outcome, float] = defaultdict(float)
        for track in tracks:
            by_outcome[track.steps[final].outcome] += shares[id(track)]
        best = max(by_outcome, key=by_outcome.__getitem__)
        followed = {name for name in CHANGE_OUTCOMES if best in CHANGE_OUTCOMES and by_outcome[name] > 1.0 - SURE} | {
            best
        }
        left = [track for track in tracks if track.steps[final].outcome not in followed]
        tracks = [track for track in tracks if track.steps[final].outcome in followed]
        if left:
            lost = sum(shares[id(track)] for track in left if _change(track.steps, near) is None)
            tracks = [_decided(track, final, 1.0 - lost) for track in tracks]
    weights = zip(_shares(tracks), tracks, strict=True)
    most = sorted(weights, key=lambda pair: -pair[0])[:_PATHS]
    return [track for share, track in most if share >= _LEAST * most[0][0]]


def _decided(track: _Track, final: int, share: float) -> _Track:
    """A path whose outcome at a recording became final with the probability `share`."""
    steps = track.steps
    return track._replace(steps=(*steps[:final], steps[final]._replace(decided=share), *steps[final + 1 :]))


def _shares(tracks: Sequence[_Track]) -> FloatArray:
    """Probabilities of paths."""
    weights = np.array([track.weight for track in tracks])
    shares = np.exp(weights - weights.max())
    return np.asarray(shares / shares.sum(), dtype=np.float64)


class _Corrected(NamedTuple):
    """State after a measurement, the measurement's innovation with its covariance, and their deviance."""

    mean: FloatArray
    covariance: FloatArray
    innovation: FloatArray
    S: FloatArray
    deviance: float


def state_before(model: TrendModel, measurements: Sequence[Measurement | None]) -> tuple[FloatArray, FloatArray]:
    """The state before the first recording; the errors of a reader are as large as its first measurement says."""
    variances = np.zeros(model.size)
    for q, name in enumerate(model.quantities):
        variances[2 * q : 2 * q + 2] = GROWTH[name].start ** 2, (GROWTH[name].rate / model.life) ** 2
    for reader in model.readers:
        first = next((now for now in measurements if now is not None and now.by == reader), None)
        stds, shares = (first.shift_std, first.load_std) if first else (1.0, 1.0), SHARES_BY[reader]
        for place, kind in zip(model.errors_by(reader), ("common", "by_temperature"), strict=True):
            errors = [getattr(shares[name], kind) * std for name, std in zip(CHANNELS, stds, strict=True)]
            variances[place] = np.square(errors)
    variances[model.offsets(0)] = (_NONE * _sizes()) ** 2
    for number, calibration in enumerate(model.later, start=1):
        variances[model.offsets(number)] = calibration.shift_std**2, calibration.load_std**2
    covariance = np.diag(variances)
    for pair in permutations(model.readers, 2):
        places = tuple(np.arange(model.size)[model.errors_by(by)[0]] for by in pair)
        covariance[places] = _ALIKE * np.sqrt(variances[places[0]] * variances[places[1]])
    return np.zeros(model.size), covariance


def growth_noise(name: str, life: float, ds: float) -> FloatArray:
    """Covariance that value and rate of a quantity gain over `ds`, (2, 2)."""
    rate = GROWTH[name].rate / life
    walk, scatter = (GROWTH[name].walk * rate) ** 2 / life, (_SCATTER * GROWTH[name].rate) ** 2 / life
    return np.array([[walk * ds**3 / 3 + scatter * ds, walk * ds**2 / 2], [walk * ds**2 / 2, walk * ds]])


def _motion(model: TrendModel, ds: float) -> tuple[FloatArray, FloatArray]:
    F, Q = np.eye(model.size), np.zeros((model.size, model.size))
    for q, name in enumerate(model.quantities):
        F[2 * q, 2 * q + 1] = ds
        Q[2 * q : 2 * q + 2, 2 * q : 2 * q + 2] = growth_noise(name, model.life, ds)
    return F, Q


def _sizes() -> FloatArray:
    """Standard deviations of a sudden change by channel."""
    return np.array([GROWTH[name].jump for name in CHANNELS])


#: No sudden change, as a share of the size of one: not 0, so that covariances have an inverse.
_NONE = 1e-4


def _changed(
    model: TrendModel, before: FloatArray, way: tuple[float, float], outcome: Outcome
) -> tuple[FloatArray, FloatArray]:
    """Motion of a state `before` over ds to a recording with an outcome, the last measurement being `since` ago.

    A new clutch has worn for a part of that time, about as fast as the one before, and has none of its sudden changes.
    """
    ds, since = way
    F, Q = _motion(model, ds)
    changes = range(model.changes, model.changes + len(model.channels))
    if outcome == "sudden":
        Q[changes, changes] = _sizes() ** 2
    if outcome == "replaced":
        F[changes] = 0.0
        Q[changes, changes] = (_NONE * _sizes()) ** 2
    for q, name in enumerate(model.quantities):
        growth, u = GROWTH[name], 2 * q
        rate = growth.rate / model.life
        if outcome == "sudden":
            Q[u + 1, u + 1] += rate**2
        if outcome == "replaced":
            spread = _NEXT_RATE * (rate + abs(float(before[u + 1])))
            F[u, [u, u + 1]] = 0.0, since / 2
            Q[u : u + 2, u : u + 2] = np.diag([(NEW * growth.start) ** 2 + (spread * since) ** 2, spread**2])
    return F, Q


#: Iterations of a linearisation at most, and the share of its slopes at which it has converged.
_ITERATIONS, _CONVERGED = 5, 1e-3


def _corrected(model: TrendModel, mean: FloatArray, P: FloatArray, now: Measurement, scale: float) -> _Corrected:
    """The state after a measurement; functions are linearised over the width of the state after it, iterated."""
    values = np.array([now.shift, now.load])
    stds = now.shift_std, now.load_std
    shares, errors = SHARES_BY[now.by], errors_in(model, now)
    R = np.diag([scale * (shares[name].independent * std) ** 2 for name, std in zip(CHANNELS, stds, strict=True)])
    after, covariance, H = mean, P, np.zeros((values.size, model.size))
    for _ in range(_ITERATIONS):
        before = H
        slopes, offset = linearised(model, after, covariance)
        H = slopes + errors
        if np.all(np.abs(H - before) <= _CONVERGED * np.abs(H)):
            break
        innovation = values - offset - H @ mean
        S = H @ P @ H.T + R
        gain = np.linalg.solve(S, H @ P).T
        left = np.eye(model.size) - gain @ H
        after, covariance = mean + gain @ innovation, left @ P @ left.T + gain @ R @ gain.T
    return _Corrected(after, covariance, innovation, S, float(innovation @ np.linalg.solve(S, innovation)))


def errors_in(model: TrendModel, now: Measurement) -> FloatArray:
    """By how much each error in the state adds to the channels of a measurement, (channels, state)."""
    H, identity = np.zeros((len(model.channels), model.size)), np.eye(len(model.channels))
    constant, by_temperature = model.errors_by(now.by)
    H[:, by_temperature] = identity * ((now.temperature - REFERENCE) / 10.0 if np.isfinite(now.temperature) else 0.0)
    H[:, constant] = identity
    if now.calibration:
        H[:, model.offsets(now.calibration)] = identity
    return H


def linearised(model: TrendModel, mean: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slopes of the channels without their errors, (channels, state), over the width of a state, and their offsets."""
    H, offset = np.zeros((len(model.channels), model.size)), np.zeros(len(model.channels))
    for c, (q, function) in enumerate(model.channels):
        u, width = mean[2 * q], float(np.sqrt(P[2 * q, 2 * q]))
        low, middle, high = function(np.array([u - width, u, u + width]))
        H[c, 2 * q], H[c, model.changes + c] = (high - low) / (2 * width), 1.0
        offset[c] = middle - H[c, 2 * q] * u
    return H, offset
