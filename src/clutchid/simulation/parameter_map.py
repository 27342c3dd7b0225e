"""How the free numbers of a fit look from one recording: which parameters of its actuator they are."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.log import FloatArray
from clutchid.measured import MEASURED, SENSOR_PARAMETERS
from clutchid.model.actuator import Actuator
from clutchid.simulation.run import Columns, IntArray, Numbers, columns
from clutchid.simulation.windows import units


@dataclass(frozen=True, slots=True, eq=False)
class ActiveColumns:
    """What a window that is simulated needs to know of theta: which of it matters there, and where it stands.

    The simulation carries the columns `which` from `start`; the rows of the window go on with numbers of sensors, which
    stand in `own`, as `kernels.compare` wants them. `theta` are all their places among the parameters of the view;
    `columns` those in `Rows.own`, with the columns of the start and of the residual; `carried` those in
    `Rows.to_theta`.
    """

    which: Columns
    start: FloatArray
    own: Mapping[str, tuple[int, int]]
    theta: IntArray
    columns: IntArray
    carried: IntArray


#: ColumnCache by the first and the last part of the load's table that a window meets.
ColumnCache = dict[tuple[int, int], ActiveColumns]


@dataclass(frozen=True, slots=True, eq=False)
class ParameterMap:
    """How theta looks from one recording: its actuator, and the parameters `bases` at its `places`.

    `slopes` are dSI/dtheta, `sensors` lag and offset of the sensor of each measured column;
    `cache` keeps what windows have asked for.
    """

    actuator: Actuator
    numbers: Numbers
    bases: tuple[str, ...]
    places: tuple[int, ...]
    slopes: FloatArray
    size: int
    sensors: Mapping[str, tuple[float, float]]
    cache: ColumnCache

    def fixed(self) -> ParameterMap:
        """The same with theta held: no parameters, their values in the actuator only."""
        return ParameterMap(self.actuator, self.numbers, (), (), np.zeros(0), 0, self.sensors, {})

    def met(self, low: float, high: float) -> tuple[int, int]:
        """First and last part of the load's table between two positions in m."""
        return bisect_right(self.numbers.breakpoints, low), bisect_right(self.numbers.breakpoints, high)

    def active_columns(self, met: tuple[int, int]) -> ActiveColumns:
        """The columns of a window that meets these parts of the load's table.

        A load weight matters to the states where its basis function is not zero, a number of a sensor nowhere.
        """
        if met not in self.cache:
            touched = np.any(self.numbers.basis[:, met[0] : met[1] + 1] != 0.0, axis=(1, 2))
            idle = {name for name, meets in zip(self.actuator.load.names, touched.tolist(), strict=True) if not meets}
            active = [i for i, name in enumerate(self.bases) if name not in idle and name not in SENSOR_PARAMETERS]
            self.cache[met] = self._active_columns(active)
        return self.cache[met]

    def _active_columns(self, active: Sequence[int]) -> ActiveColumns:
        states, unit = self.actuator.states, units(self.actuator)
        n, theta = len(states), [*active, *(i for i, name in enumerate(self.bases) if name in SENSOR_PARAMETERS)]
        which = columns(self.actuator, [*(f"start of {name}" for name in states), *(self.bases[i] for i in active)])
        start = np.zeros((n, n + len(active)))
        start[:, :n] = np.diag(unit)
        column = {self.bases[i]: n + number for number, i in enumerate(theta) if self.bases[i] in SENSOR_PARAMETERS}
        own = {name: (column.get(s.lag, -1), column.get(s.offset, -1)) for name, s in MEASURED.items()}
        carried = np.array([self.places[i] for i in theta], dtype=np.int64)
        placed = np.concatenate([np.arange(n), n + carried, [n + self.size]])
        return ActiveColumns(which, start, own, np.array(theta, dtype=np.int64), placed, carried[: len(active)])


def parameter_map(
    actuator: Actuator,
    bases: Sequence[str],
    places: Sequence[int],
    slopes: FloatArray,
    size: int,
    cache: ColumnCache | None = None,
) -> ParameterMap:
    """The view of a recording in which theta's `places` are the parameters `bases`, with dSI/dtheta `slopes`.

    `cache` may be those of another view, which differs in values only.
    """
    sensors = {name: (actuator.value(s.lag), actuator.value(s.offset)) for name, s in MEASURED.items()}
    known = {} if cache is None else cache
    return ParameterMap(actuator, Numbers.of(actuator), tuple(bases), tuple(places), slopes, size, sensors, known)
