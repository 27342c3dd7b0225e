"""The model on line at the temperature of the air, where the vehicle measures it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from clutchid.observer.configuration import Observer
from clutchid.simulation.parameter_map import parameter_map


@lru_cache(maxsize=4)
def at_air(observer: Observer, temperature: float) -> Observer:
    """The observer with the model at a temperature of the air in K; the same one for 0, where that is not known."""
    if observer.air is None or temperature in (0.0, observer.air.calibrated):
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
