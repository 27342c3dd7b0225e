"""The model on line at the temperature of the air, where the vehicle measures it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from clutchid.inference.uncertainty.conditions import ACCURACY, AIR
from clutchid.log import FloatArray
from clutchid.observer.observer import Observer
from clutchid.simulation.parameter_map import parameter_map


def changes_of_air(observer: Observer, used: float, temperature: FloatArray) -> list[tuple[int, float]]:
    """Samples from which on another temperature of the air is in use, and that temperature in K.

    It stays in use until one is recorded that differs by more than a sensor's standard deviation. The first one is that
    of the calibration, unless it differs by as much. What no air has is not recorded.

    Parameters
    ----------
    used : K
        In use before, NaN for none.
    temperature : K, (n,)
        As recorded, NaN for none.
    """
    if observer.air is None:
        return []
    recorded = np.flatnonzero((temperature >= AIR[0]) & (temperature <= AIR[1]))
    values, changes, first = temperature[recorded], list[tuple[int, float]](), 0
    while first < values.size:
        usual = used if np.isfinite(used) else observer.air.calibrated
        differs = np.abs(values[first:] - usual) > ACCURACY["T_0"]
        at = first if np.isnan(used) else first + int(np.argmax(differs))
        if np.isfinite(used) and not differs.any():
            break
        used = float(values[at]) if differs[at - first] else usual
        changes.append((int(recorded[at]), used))
        first = at + 1
    return changes


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
    values = {name: factor * mapped.actuator.value(name) for name, factor in factors.items()}
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
