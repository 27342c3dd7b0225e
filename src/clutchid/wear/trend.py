r"""Trend of a clutch's wear over its recordings: a Kalman filter and smoother with a test for jumps.

A quantity grows at a rate that walks, :math:`du = r\,ds + dw_u, \; dr = dw_r`, over strokes, distance or time s. Each
channel (shift, load) measures :math:`f(u) + b + g\,(T - T_{ref}) + v`: the constant error b and that by temperature g
are the same for all recordings of a vehicle, v is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import special

from clutchid.estimation.assess.comparison import SHARES, WORTH, Measurement
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
SCATTER = 0.05


#: Air temperature in K that counts as that of the calibration where it had none.
REFERENCE = 293.15

#: Share of false alarms among recordings.
FALSE_ALARMS = 1e-3

#: Fall of the vented rest in m over a life of a clutch without an adjuster, whose rest falls by 6.3 times the wear of a
#: facing of 3.5 mm; and how many times faster than so far the rest may fall. Guesses on the generous side.
FALL, FASTER = 22e-3, 5.0

#: A jump that ends within this share of the former change from the new clutch is a replaced clutch.
AS_NEW = 0.4

#: Recordings in a row that read a leak, with a probability above the second: by chance alone at most `FALSE_ALARMS`.
LEAKS, LEAKING = 2, 1.0 - FALSE_ALARMS**0.5

#: A leak below this in m³/(Pa·s), 0.04 g/s at 5 bar, is that of seals that age: of virtual trucks 7e-12 after a life.
AGED = 1e-11

#: Recordings in a row that are farther from the calibration than a change explains.
DEPARTED = 3


Function = Callable[[FloatArray], FloatArray]

#: The channels of a measurement, with the state that their constant error takes first.
CHANNELS = ("shift", "load")


class Interval(NamedTuple):
    """A value with its interval; NaN is unknown."""

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
        """The quantity at the last recording."""
        return Interval(*(float(side[-1]) for side in self))


class WearTable(NamedTuple):
    """Half-load position and load against the wear of the facing, all against the new clutch: arrays (n,) in SI."""

    wear: FloatArray
    shift: FloatArray
    load: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TrendModel:
    """Quantities that grow, and which one each channel measures, by a function of it.

    The state is (value, rate) of each quantity, then (constant error, error in 10 K) of each channel. `life` is how
    much of s a life has.
    """

    quantities: tuple[str, ...]
    channels: tuple[tuple[int, Function], ...]
    life: float

    @property
    def errors(self) -> int:
        """Index of the first channel's errors in the state."""
        return 2 * len(self.quantities)

    @property
    def size(self) -> int:
        """Length of the state."""
        return self.errors + 2 * len(self.channels)


class Step(NamedTuple):
    """A recording in the trend: state before and after it, how it moved there, and what became of its measurement.

    `outcome` is "used", "left out" (an outlier), "jump" (something changed before it) or "missing".
    """

    s: float
    predicted: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    transition: FloatArray
    outcome: str
    deviance: float


def trend_model(life: float, table: WearTable | None = None) -> TrendModel:
    """Shift and load as quantities of their own, or, with a table, both as functions of the wear of the facing."""
    if table is None:
        return TrendModel(CHANNELS, ((0, _itself), (1, _itself)), life)
    by_wear = [_interpolated(table.wear, values) for values in (table.shift, table.load)]
    return TrendModel(("wear",), ((0, by_wear[0]), (0, by_wear[1])), life)


def _itself(u: FloatArray) -> FloatArray:
    return u


def _interpolated(x: FloatArray, values: FloatArray) -> Function:
    """Linear interpolation that goes on with its first and last slope."""
    slopes = (values[1] - values[0]) / (x[1] - x[0]), (values[-1] - values[-2]) / (x[-1] - x[-2])

    def at(u: FloatArray) -> FloatArray:
        beyond = slopes[0] * np.minimum(u - x[0], 0.0) + slopes[1] * np.maximum(u - x[-1], 0.0)
        found: FloatArray = np.interp(u, x, values) + beyond
        return found

    return at


def follow(model: TrendModel, s: FloatArray, measurements: Sequence[Measurement | None]) -> list[Step]:
    """The trend along recordings at `s`, in order; what is missing is only predicted.

    A measurement that the trend does not expect, with a probability below `FALSE_ALARMS`, is a jump if it and the next
    one fit so much better with a jump before them; else it is an outlier. The last one waits for the next.
    """
    steps: list[Step] = []
    known = _Used(0.0, 0)
    mean, covariance = _start(model, measurements)
    for k, (at, now) in enumerate(zip(s, measurements, strict=True)):
        F, Q = _motion(model, float(at - s[k - 1]) if k else 0.0)
        predicted, P = F @ mean, F @ covariance @ F.T + Q
        mean, covariance, outcome, deviance = predicted, P, "missing", float("nan")
        if now is not None:
            used = _corrected(model, predicted, P, now, known.scale)
            mean, covariance, outcome, deviance = used.mean, used.covariance, "used", used.deviance
            if deviance > known.limit(len(model.channels)):
                after = _after(s, measurements, k)
                jumped = P + _jump(model)
                if after is not None and _is_jump(model, (predicted, P, jumped), now, after, known):
                    P = jumped
                    mean, covariance, _ = _corrected(model, predicted, P, now, known.scale)
                    outcome = "jump"
                else:
                    mean, covariance, outcome = predicted, P, "left out"
            else:
                known = _Used(known.deviance + deviance, known.number + len(model.channels))
        steps.append(Step(float(at), predicted, P, mean, covariance, F, outcome, deviance))
    return steps


def smoothed(steps: Sequence[Step]) -> list[tuple[FloatArray, FloatArray]]:
    """Mean and covariance of every step given all recordings (Rauch, Tung and Striebel)."""
    found = [(steps[-1].mean, steps[-1].covariance)]
    for now, then in zip(steps[-2::-1], steps[:0:-1], strict=True):
        gain = np.linalg.solve(then.predicted_covariance, then.transition @ now.covariance).T
        mean, covariance = found[-1]
        found.append((
            now.mean + gain @ (mean - then.predicted),
            now.covariance + gain @ (covariance - then.predicted_covariance) @ gain.T,
        ))  # fmt: skip
    return found[::-1]


class _Used(NamedTuple):
    """Sum of the deviances, and number of values, of the measurements that were used."""

    deviance: float
    number: int

    @property
    def scale(self) -> float:
        """Variance of the independent errors, as a multiple of that in the settings."""
        return (WORTH + self.deviance) / (WORTH + self.number)

    def limit(self, values: int) -> float:
        """Deviance of `values` values that `FALSE_ALARMS` of them exceed, the noise being known as well as it is."""
        return values * float(special.fdtri(values, WORTH + self.number, 1.0 - FALSE_ALARMS))


class _Corrected(NamedTuple):
    mean: FloatArray
    covariance: FloatArray
    deviance: float


def _start(model: TrendModel, measurements: Sequence[Measurement | None]) -> tuple[FloatArray, FloatArray]:
    """The state before the first recording; the errors are as large as the first measurement says."""
    variances = np.zeros(model.size)
    for q, name in enumerate(model.quantities):
        variances[2 * q : 2 * q + 2] = GROWTH[name].start ** 2, (GROWTH[name].rate / model.life) ** 2
    first = next((one for one in measurements if one is not None), None)
    for c, (name, std) in enumerate(
        zip(CHANNELS, (first.shift_std, first.load_std) if first else (1.0, 1.0), strict=True)
    ):
        i, shares = model.errors + 2 * c, SHARES[name]
        variances[i : i + 2] = (shares.common * std) ** 2, (shares.by_temperature * std) ** 2
    return np.zeros(model.size), np.diag(variances)


def growth_noise(name: str, life: float, ds: float) -> FloatArray:
    """Covariance that value and rate of a quantity gain over `ds`, (2, 2)."""
    rate = GROWTH[name].rate / life
    walk, scatter = (GROWTH[name].walk * rate) ** 2 / life, (SCATTER * GROWTH[name].rate) ** 2 / life
    return np.array([[walk * ds**3 / 3 + scatter * ds, walk * ds**2 / 2], [walk * ds**2 / 2, walk * ds]])


def _motion(model: TrendModel, ds: float) -> tuple[FloatArray, FloatArray]:
    F, Q = np.eye(model.size), np.zeros((model.size, model.size))
    for q, name in enumerate(model.quantities):
        F[2 * q, 2 * q + 1] = ds
        Q[2 * q : 2 * q + 2, 2 * q : 2 * q + 2] = growth_noise(name, model.life, ds)
    return F, Q


def _jump(model: TrendModel) -> FloatArray:
    """Covariance of a jump: another clutch has another value and wears at another rate."""
    J = np.zeros((model.size, model.size))
    for q, name in enumerate(model.quantities):
        J[2 * q, 2 * q], J[2 * q + 1, 2 * q + 1] = GROWTH[name].jump ** 2, (GROWTH[name].rate / model.life) ** 2
    return J


def _corrected(model: TrendModel, mean: FloatArray, P: FloatArray, now: Measurement, scale: float) -> _Corrected:
    """The state after a measurement; functions are linearised over the width of the prediction."""
    values = np.array([now.shift, now.load])
    stds = now.shift_std, now.load_std
    R = np.diag([scale * (SHARES[name].independent * std) ** 2 for name, std in zip(CHANNELS, stds, strict=True)])
    warmer = (now.temperature - REFERENCE) / 10.0 if np.isfinite(now.temperature) else 0.0
    H, expected = np.zeros((values.size, model.size)), np.zeros(values.size)
    for c, (q, function) in enumerate(model.channels):
        u, width = mean[2 * q], float(np.sqrt(P[2 * q, 2 * q]))
        low, middle, high = function(np.array([u - width, u, u + width]))
        i = model.errors + 2 * c
        H[c, 2 * q], H[c, i], H[c, i + 1] = (high - low) / (2 * width), 1.0, warmer
        expected[c] = middle + mean[i] + warmer * mean[i + 1]
    innovation = values - expected
    S = H @ P @ H.T + R
    gain = np.linalg.solve(S, H @ P).T
    left = np.eye(model.size) - gain @ H
    covariance: FloatArray = left @ P @ left.T + gain @ R @ gain.T
    return _Corrected(mean + gain @ innovation, covariance, float(innovation @ np.linalg.solve(S, innovation)))


def _after(s: FloatArray, measurements: Sequence[Measurement | None], k: int) -> tuple[float, Measurement] | None:
    """Distance to the next measurement after `k`, and that one."""
    for j in range(k + 1, len(measurements)):
        following = measurements[j]
        if following is not None:
            return float(s[j] - s[k]), following
    return None


def _is_jump(
    model: TrendModel,
    before: tuple[FloatArray, FloatArray, FloatArray],
    now: Measurement,
    after: tuple[float, Measurement],
    known: _Used,
) -> bool:
    """Whether two measurements fit better with a jump before the first, by more than chance, and than without it.

    How much smaller the deviance is with a jump is chi-squared without one; an outlier explains the second one as well
    as if the first were missing.
    """
    predicted, without, jumped = before
    F, Q = _motion(model, after[0])

    def deviance(mean: FloatArray, P: FloatArray) -> float:
        return _corrected(model, F @ mean, F @ P @ F.T + Q, after[1], known.scale).deviance

    none, jump = (_corrected(model, predicted, P, now, known.scale) for P in (without, jumped))
    after_none, after_jump = (deviance(one.mean, one.covariance) for one in (none, jump))
    gain = none.deviance + after_none - jump.deviance - after_jump
    return gain > known.limit(len(model.channels)) and after_jump < deviance(predicted, without)
