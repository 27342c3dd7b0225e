"""What the joint filter of an actuator consists of: its settings, its free parameters, and how it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from clutchid.filter.arrays import IntArray
from clutchid.filter.joint_arrays import FreeArrays, Pace
from clutchid.filter.pace import AS_PLANNED
from clutchid.filter.setup import sensor_rows
from clutchid.log import FloatArray
from clutchid.measured import SENSORS
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import prepare, step
from clutchid.simulation.parameter_map import ParameterMap, parameter_map
from clutchid.simulation.run import Columns, columns
from clutchid.uncertainty.coordinates import Coordinate
from clutchid.uncertainty.noise import Noise


@dataclass(frozen=True, slots=True)
class JointSettings:
    """Settings of the joint filter.

    Parameters
    ----------
    every
        Samples from one correction to the next, at least 1.
    spacing : s
        Time from one sample to the next.
    least_speed : m/s
        The parameters adapt only while the piston is faster.
    """

    every: int = 10
    spacing: float = 1e-3
    least_speed: float = 5e-3


class Rule(NamedTuple):
    """By which rule a filter corrects: the kernel that follows a segment, of the signature of `joint.follow_jointly`.

    `columns` says whether S has its columns, see `joint`; `memory` how many numbers `JointState.waiting` has more;
    `numbers` come last in the settings of the kernel; an innovation is that of the position in m, or of a force in N.
    """

    module: str
    kernel: str
    columns: bool
    memory: int
    numbers: tuple[Any, ...]
    compares: str = "position"


#: States and free parameters by their covariance, see `joint`.
KALMAN = Rule("clutchid.filter.joint", "follow_jointly", columns=True, memory=0, numbers=())


@dataclass(frozen=True, slots=True, eq=False)
class JointFilter:
    """The joint filter of an actuator, as `joint_filter` makes it.

    `mapped` has the actuator at the means of the free parameters and `which` their columns, `free` what is fixed about
    them, `drifts` (k, d) the root of what their covariance gains in a stroke; `calls` are the generated functions of
    the model.
    """

    mapped: ParameterMap
    which: Columns
    coordinates: tuple[Coordinate, ...]
    measure: tuple[str, ...]
    noise: Noise
    settings: JointSettings
    free: FreeArrays
    drifts: FloatArray
    pace: Pace
    sensors: IntArray
    calls: tuple[Any, Any]
    rule: Rule

    def si(self, theta: FloatArray) -> dict[str, float]:
        """Values of the free parameters in SI by name."""
        return {c.base: c.si(value) for c, value in zip(self.coordinates, theta.tolist(), strict=True)}

    def actuator(self, theta: FloatArray) -> Actuator:
        """The actuator at theta.

        Raises
        ------
        ParameterError
            If values contradict each other.
        """
        return self.mapped.actuator.replace(self.si(theta))


def joint_filter(
    actuator: Actuator,
    coordinates: Sequence[Coordinate],
    bounds: tuple[FloatArray, FloatArray],
    measure: Sequence[str],
    noise: Noise,
    settings: JointSettings,
    drifts: FloatArray | None = None,
    pace: Pace = AS_PLANNED,
    rule: Rule = KALMAN,
) -> JointFilter:
    """The joint filter of an actuator.

    Parameters
    ----------
    actuator : Actuator
        Its values are those of all parameters that are not free.
    coordinates : k coordinates
        The free parameters.
    bounds : (k,), (k,)
        Bounds of theta.
    measure : 'position', 'pressure_a'
        Measured columns in use.
    noise : Noise
        Of sensors and model; samples within its `memory` have the information of one.
    drifts : (k, d), optional
        Root of the covariance that theta gains in a stroke, lower trapezoidal; by default none.
    pace
        Integration steps by position and speed, see `clutchid.filter.pace`; by default those of the segment.
    rule
        By which it corrects; by default that of Kalman.
    """
    k, names = len(coordinates), [c.base for c in coordinates]
    mean = actuator.replace({c.base: c.si(0.0) for c in coordinates})
    mapped = parameter_map(mean, names, range(k), np.ones(k), k)
    return JointFilter(
        mapped=mapped,
        which=columns(mean, names if rule.columns else ()),
        coordinates=tuple(coordinates),
        measure=tuple(measure),
        noise=noise,
        settings=settings,
        free=_free_arrays(mean, coordinates, bounds, measure),
        drifts=np.zeros((k, 0)) if drifts is None else np.ascontiguousarray(drifts),
        pace=pace,
        sensors=sensor_rows(mapped, measure),
        calls=(step(mean.model), prepare(mean.model)),
        rule=rule,
    )


def _free_arrays(
    actuator: Actuator, coordinates: Sequence[Coordinate], bounds: tuple[FloatArray, FloatArray], measure: Sequence[str]
) -> FreeArrays:
    weights, parameters = actuator.load.names, actuator.parameter_names
    lags, offsets = ([getattr(SENSORS[name], kind) for name in measure] for kind in ("lag", "offset"))
    numbers = [
        (c.mean, c.width, float(c.positive), c.low, c.high, low, high)
        for c, low, high in zip(coordinates, *(side.tolist() for side in bounds), strict=True)
    ]
    places = [
        [names.index(c.base) if c.base in names else -1 for names in (weights, parameters, lags, offsets)]
        for c in coordinates
    ]
    acting = np.any(actuator.load.coefficients != 0.0, axis=2)
    pieces = [(int(a.argmax()), int(a.size - 1 - a[::-1].argmax())) for a in acting]
    return np.array(numbers).reshape(-1, 7), np.array(places, dtype=np.int64).reshape(-1, 4), np.array(pieces)
