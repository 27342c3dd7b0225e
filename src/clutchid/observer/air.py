"""The model on line at the temperature of the air, where the vehicle measures it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import isnan
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.conditions import ACCURACY, AIR, LOST, RATE, SWING
from clutchid.log import BoolArray, FloatArray, IntArray
from clutchid.observer.configuration import Observer
from clutchid.observer.state import ObserverState
from clutchid.simulation.parameter_map import parameter_map
from clutchid.strokes.stroke import RESOLUTION


class AirOfSamples(NamedTuple):
    """Temperatures of the air in a block.

    Attributes
    ----------
    changes
        Samples from which on another temperature is in use, and that in K.
    aired : s, (n,)
        Time at which a temperature last counted, by sample; NaN before one has.
    refused : (n,)
        Whether the last recorded temperature does not count.
    lost : (n,)
        Whether none has counted for so long that it is not known any more.
    """

    changes: list[tuple[int, float]]
    aired: FloatArray
    refused: BoolArray
    lost: BoolArray


def air_of_samples(
    observer: Observer, state: ObserverState, time: FloatArray, temperature: FloatArray | None
) -> AirOfSamples:
    """The temperatures of the air in a block: which are in use, and which do not count.

    A temperature stays in use until one counts that differs by more than a sensor's standard deviation. The first one
    is that of the calibration, unless it differs by as much. What no air has does not count, and neither does what
    changes faster than air since one counted, as a sensor that fails for some seconds.

    Parameters
    ----------
    state
        Before the block.
    time : s, (n,)
        Time of the samples.
    temperature : K, (n,)
        As recorded, NaN for none; None without a column.
    """
    if observer.air is None or temperature is None:  # at once: a block may be one sample
        aired, refused = np.full(time.size, state.aired), np.full(time.size, state.air_refused)
        return AirOfSamples([], aired, refused, time - aired > LOST + 0.5 * RESOLUTION)
    counts = (temperature >= AIR[0]) & (temperature <= AIR[1])
    recorded, used, latest = np.flatnonzero(counts), state.temperature, state.aired
    changes = list[tuple[int, float]]()
    if recorded.size and isnan(used):
        value, latest = float(temperature[recorded[0]]), float(time[recorded[0]])
        used = value if abs(value - observer.air.calibrated) > ACCURACY["T_0"] else observer.air.calibrated
        changes = [(int(recorded[0]), used)]
    if np.any(np.abs(temperature[recorded] - used) > ACCURACY["T_0"]):
        for at in recorded.tolist():
            seconds, value = float(time[at]), float(temperature[at])
            change = abs(value - used)
            counts[at] = change <= SWING + RATE * (seconds - latest)
            latest = seconds if counts[at] else latest
            if counts[at] and change > ACCURACY["T_0"]:
                used = value
                changes.append((at, used))
    aired = np.append(time, state.aired)[_last(counts)]
    refused = np.append(~counts, state.air_refused)[_last(np.isfinite(temperature))]
    return AirOfSamples(changes, aired, refused, time - aired > LOST + 0.5 * RESOLUTION)


def _last(mask: BoolArray) -> IntArray:
    """The last sample so far in a mask, by sample; -1 before there is one."""
    return np.maximum.accumulate(np.where(mask, np.arange(mask.size), -1))


@lru_cache(maxsize=4)
def at_air(observer: Observer, temperature: float) -> Observer:
    """The observer with the model at a temperature of the air in K; the same one where that is not known."""
    if observer.air is None or not np.isfinite(temperature) or temperature == observer.air.calibrated:
        return observer
    joint, ratio = observer.joint, temperature / observer.air.calibrated
    factors = {name: ratio**power for name, power in observer.air.powers.items()}
    mapped, of_free = joint.mapped, [factors.get(c.base, 1.0) for c in joint.coordinates]
    numbers = joint.free.numbers.copy()
    numbers[:, 0] *= of_free
    rows = {name: observer.actuator.row(name) for name in factors}
    values = {
        name: min(max(f * mapped.actuator.value(name), rows[name].low), rows[name].high) for name, f in factors.items()
    }
    return replace(
        observer,
        joint=replace(
            joint,
            mapped=parameter_map(
                mapped.actuator.replace(values), mapped.bases, mapped.places, mapped.slopes, mapped.size
            ),
            coordinates=tuple(replace(c, mean=c.mean * f) for c, f in zip(joint.coordinates, of_free, strict=True)),
            free=joint.free._replace(numbers=numbers),
        ),
    )
