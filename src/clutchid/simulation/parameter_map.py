"""Map from the free parameters theta of a fit to the parameters of one recording."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray, IntArray
from clutchid.log.states import MEASURED, SENSOR_PARAMETERS
from clutchid.model.actuator import Actuator
from clutchid.simulation.run import Columns, KernelArrays, columns
from clutchid.simulation.windows import units


class LoadPieces(NamedTuple):
    """First and last polynomial piece of the load in a range of positions."""

    first: int
    last: int

    def contains(self, other: LoadPieces) -> bool:
        """Whether all of the `other` pieces are among these."""
        return self.first <= other.first and other.last <= self.last

    def joined(self, other: LoadPieces) -> LoadPieces:
        """These pieces, the `other` ones, and those between them."""
        return LoadPieces(min(self.first, other.first), max(self.last, other.last))


@dataclass(frozen=True, slots=True, eq=False)
class ActiveColumns:
    """Columns of a window: the parameters with an influence there, and their places among all.

    `sensitivities` are the columns of the simulation, `start` the sensitivities at its start. `sensor_columns` are the
    columns of the lag and the offset of each sensor, as in `comparison.compare`. `parameters` are the indices of the
    active parameters in the map, `row_columns` the places of all columns in `WindowRows.rows`, and `theta_columns`
    those of the simulated parameters in `WindowRows.to_theta`.
    """

    sensitivities: Columns
    start: FloatArray
    sensor_columns: Mapping[str, tuple[int, int]]
    parameters: IntArray
    row_columns: IntArray
    theta_columns: IntArray


#: Columns by the pieces of the load that they are for.
ColumnCache = dict[LoadPieces, ActiveColumns]


@dataclass(frozen=True, slots=True, eq=False)
class ParameterMap:
    """Actuator of one recording, and the parameters `bases` that theta has at `places`.

    `slopes` are d(SI)/dtheta, `sensors` lag and offset of the sensor of each measured column.
    """

    actuator: Actuator
    arrays: KernelArrays
    bases: tuple[str, ...]
    places: tuple[int, ...]
    slopes: FloatArray
    size: int
    sensors: Mapping[str, tuple[float, float]]
    cache: ColumnCache

    def fixed(self) -> ParameterMap:
        """The same with fixed theta: the values stay in the actuator, no parameter is free."""
        return ParameterMap(self.actuator, self.arrays, (), (), np.zeros(0), 0, self.sensors, {})

    def load_pieces(self, low: float, high: float) -> LoadPieces:
        """Pieces of the load between two positions in m."""
        return LoadPieces(bisect_right(self.arrays.breakpoints, low), bisect_right(self.arrays.breakpoints, high))

    def active_columns(self, pieces: LoadPieces) -> ActiveColumns:
        """The columns of a window over these pieces of the load.

        A load weight acts on the states where its basis function is not zero; sensor parameters do not act on them.
        """
        if pieces not in self.cache:
            acting = np.any(self.arrays.basis[:, pieces.first : pieces.last + 1] != 0.0, axis=(1, 2))
            idle = {name for name, acts in zip(self.actuator.load.names, acting.tolist(), strict=True) if not acts}
            active = [i for i, name in enumerate(self.bases) if name not in idle and name not in SENSOR_PARAMETERS]
            self.cache[pieces] = self._active_columns(active)
        return self.cache[pieces]

    def _active_columns(self, active: Sequence[int]) -> ActiveColumns:
        states, unit = self.actuator.states, units(self.actuator)
        n, all_active = len(states), [*active, *(i for i, name in enumerate(self.bases) if name in SENSOR_PARAMETERS)]
        names = [*(f"start of {name}" for name in states), *(self.bases[i] for i in active)]
        start = np.zeros((n, n + len(active)))
        start[:, :n] = np.diag(unit)
        column = {
            self.bases[i]: n + number for number, i in enumerate(all_active) if self.bases[i] in SENSOR_PARAMETERS
        }
        places = np.array([self.places[i] for i in all_active], dtype=np.int64)
        return ActiveColumns(
            sensitivities=columns(self.actuator, names),
            start=start,
            sensor_columns={name: (column.get(s.lag, -1), column.get(s.offset, -1)) for name, s in MEASURED.items()},
            parameters=np.array(all_active, dtype=np.int64),
            row_columns=np.concatenate([np.arange(n), n + places, [n + self.size]]),
            theta_columns=places[: len(active)],
        )


def parameter_map(
    actuator: Actuator,
    bases: Sequence[str],
    places: Sequence[int],
    slopes: FloatArray,
    size: int,
    cache: ColumnCache | None = None,
) -> ParameterMap:
    """Map of a recording: theta has the parameters `bases` at `places`, with d(SI)/dtheta `slopes`.

    `cache` may be shared with a map that differs in values only.
    """
    sensors = {name: (actuator.value(s.lag), actuator.value(s.offset)) for name, s in MEASURED.items()}
    active = {} if cache is None else cache
    return ParameterMap(actuator, KernelArrays.of(actuator), tuple(bases), tuple(places), slopes, size, sensors, active)
