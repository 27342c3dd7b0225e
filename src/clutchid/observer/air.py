"""The model on line at the temperature of the air, where the vehicle measures it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import isnan

import numpy as np

from clutchid.inference.uncertainty.conditions import ACCURACY, AIR, RATE, SWING
from clutchid.log import FloatArray
from clutchid.observer.observer import Observer
from clutchid.simulation.parameter_map import parameter_map


def changes_of_air(
    observer: Observer, used: float, latest: float, time: FloatArray, temperature: FloatArray
) -> tuple[list[tuple[int, float]], float]:
    """Samples from which on another temperature of the air is in use, that in K, and when one last counted.

    A temperature stays in use until one counts that differs by more than a sensor's standard deviation. The first one
    is that of the calibration, unless it differs by as much. What no air has does not count, and neither does what
    changes faster than air since one counted, as a sensor that fails for some seconds.

    Parameters
    ----------
    used : K
        In use before, NaN for none.
    latest : s
        Time at which one counted before, NaN for none.
    time : s, (n,)
        Time of the samples.
    temperature : K, (n,)
        As recorded, NaN for none.
    """
    changes = list[tuple[int, float]]()
    if observer.air is None:
        return changes, latest
    recorded = np.flatnonzero((temperature >= AIR[0]) & (temperature <= AIR[1]))
    values, times = temperature[recorded], time[recorded]
    if times.size and isnan(used):
        differs = abs(values[0] - observer.air.calibrated) > ACCURACY["T_0"]
        used, latest = float(values[0]) if differs else observer.air.calibrated, float(times[0])
        changes = [(int(recorded[0]), used)]
    if not np.any(np.abs(values - used) > ACCURACY["T_0"]):
        return changes, float(times[-1]) if times.size else latest
    for at, seconds, value in zip(recorded.tolist(), times.tolist(), values.tolist(), strict=True):
        change = abs(value - used)
        if change <= SWING + RATE * (seconds - latest):
            latest = seconds
            if change > ACCURACY["T_0"]:
                used = value
                changes.append((at, used))
    return changes, latest


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
