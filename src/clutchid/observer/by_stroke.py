"""Follow a recording stroke by stroke: load and parameters as estimated at the end of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.estimates import Estimate, LoadCurve
from clutchid.log import FloatArray, Log
from clutchid.log.numbers import as_numbers
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.air import at_air
from clutchid.observer.configuration import Observer
from clutchid.observer.following import Observed, observe_strokes
from clutchid.observer.state import ObserverState

#: Distance of two positions of the load curve of a stroke in m.
CURVE_STEP = 0.5e-3


class StrokeRow(NamedTuple):
    """Estimates at the end of a stroke.

    Attributes
    ----------
    time : s
        When it ended.
    number
        Of the stroke.
    curve : N over m
        The load with its 95 % band.
    estimates : SI
        Every weight and parameter that adapts.
    """

    time: float
    number: int
    curve: LoadCurve
    estimates: dict[str, Estimate]


def curve_positions(observer: Observer) -> FloatArray:
    """Positions of the load curve of a stroke in m: from 0 to the calibrated stroke, shape (positions,)."""
    return np.arange(0.0, observer.actuator.parameters.y_max + 1e-9, CURVE_STEP)


def curve(
    observer: Observer,
    state: ObserverState,
    position: Sequence[float] | FloatArray,
    *,
    as_calibrated: bool = False,
) -> LoadCurve:
    """The load as it is known in a state, at positions in m; also if the supply pressure is `as_calibrated`.

    Raises
    ------
    ParameterError
        If the positions are no real numbers.
    """
    problems: list[str] = []
    at = as_numbers(position, "position", "m", problems)[0].ravel()
    ParameterError.raise_for(problems)
    deviation = observer.load_deviation(state, at, as_calibrated=as_calibrated)
    force, half = observer.load(state).force(at), QUANTILE * deviation
    return LoadCurve(at, force, force - half, force + half)


def estimates_of(observer: Observer, state: ObserverState) -> dict[str, Estimate]:
    """All load weights, then the parameters that adapt, as they are known in a state; what is fixed has no spread."""
    load, deviations = observer.load(state), np.linalg.norm(observer.prior.weights @ state.T, axis=1)
    estimates = {
        name: Estimate(value, load.unit, std, value - QUANTILE * std, value + QUANTILE * std)
        for name, value, std in zip(load.names, load.theta, deviations.tolist(), strict=True)
    }
    spread = np.linalg.norm(state.T, axis=1)
    coordinates = at_air(observer, state.temperature).joint.coordinates
    for c, x, s in zip(coordinates, state.theta.tolist(), spread.tolist(), strict=True):
        if c.base not in load.names:
            unit = observer.actuator.unit(c.base)
            estimates[c.base] = Estimate(c.si(x), unit, s * c.slope(x), c.si(x - QUANTILE * s), c.si(x + QUANTILE * s))
    return estimates


def follow_strokes(
    observer: Observer, state: ObserverState, block: Log
) -> tuple[ObserverState, Observed, list[StrokeRow]]:
    """As `observe`, with a row for each stroke that ends in the block.

    Raises
    ------
    DataError
        As `observe`.
    """
    after, samples, ends = observe_strokes(observer, state, block)
    at = curve_positions(observer)
    rows = [StrokeRow(end.latest, end.strokes, curve(observer, end, at), estimates_of(observer, end)) for end in ends]
    return after, samples, rows
