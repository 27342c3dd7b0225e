"""`Part`: what every exchangeable part of a truck has; the slots add what they alone are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clutchid.log import FloatArray

Numbers = dict[str, float]

#: Number of strokes that scales the wear of rubber and seats.
LIFE_STROKES = 1e6

GUESS = "guess"


@dataclass(frozen=True, kw_only=True)
class NoRows:
    """No parameters."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A part: its parameters, what its age and changes do to them, and its numbers in the compiled loop.

    `rows` is a class with its own parameters, `shared` are those of all trucks that are drawn with this part, and
    `prepared` completes drawn numbers before shares of them are drawn. `module` has its equations, see
    `clutchid.truck.equations`. `numbers` gives the parameters that its age has changed, and further numbers of the
    loop. `factors` are those of its parameters by the name of a change, see `clutchid.truck.CHANGES`. `true` gives
    columns of the truth.
    """

    name: str
    module: str = ""
    rows: type = NoRows
    shared: tuple[str, ...] = ()
    prepared: Callable[[dict[str, Any]], dict[str, Any]] = lambda drawn: drawn
    numbers: Callable[[Any], Numbers] = lambda _: {}
    factors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    contradictions: Callable[[Any], Iterator[str]] = lambda _: iter(())
    true: Callable[[Any, Mapping[str, FloatArray]], dict[str, FloatArray]] = lambda _, __: {}


@dataclass(frozen=True, kw_only=True, eq=False)
class Valves(Part):
    """`lead` gives parts of the controller's prediction time in s: a base, and what the valve adds."""

    lead: Callable[[Mapping[str, Any]], tuple[float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Driving(Part):
    """`tuned` gives the numbers of the controller, from drawn numbers and the parts of its prediction time."""

    tuned: Callable[[Mapping[str, Any], float, float, float], Numbers]


@dataclass(frozen=True, kw_only=True, eq=False)
class Flow(Part):
    """`converted` are its own sizes of orifices that pass what drawn conductances pass."""

    converted: Callable[[Mapping[str, Any]], Numbers] = lambda _: {}


@dataclass(frozen=True, kw_only=True, eq=False)
class Gas(Part):
    """`rest` gives the states of a zone, from the truck, pressure, volume and temperature."""

    rest: Callable[[Any, float, float, float], tuple[float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Tube(Part):
    """`delay` is its part of the controller's prediction time in s."""

    delay: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Supply(Part):
    """`rest` gives the states at a pressure, `start` draws that pressure and whether a compressor runs."""

    rest: Callable[[Any, float], tuple[float, ...]]
    start: Callable[[Any, np.random.Generator], tuple[float, bool]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Friction(Part):
    """`viscosity` is the viscous friction at the temperature of the wall, up to a constant factor."""

    viscosity: Callable[[Any], float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Clutch(Part):
    """`force` gives the force [N] at the actuator over travels [m] at an age, and the travel at the touch point."""

    force: Callable[[Any, FloatArray, Numbers], tuple[FloatArray, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor(Part):
    """`position_noise` [m] of some samples, and the measured pressure [Pa] for the one behind the sensor's lag."""

    position_noise: Callable[[Any, int, np.random.Generator], FloatArray]
    measured_pressure: Callable[[Any, FloatArray, np.random.Generator], FloatArray]
