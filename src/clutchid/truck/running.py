"""Run the compiled loop of a truck."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clutchid.errors import SolveError
from clutchid.log import FloatArray
from clutchid.truck.assembly import at_rest, load_curve, numbers
from clutchid.truck.compiled import compiled
from clutchid.truck.law import SAMPLE
from clutchid.truck.load_table import LoadTable, rest_position
from clutchid.truck.structure import LEDGER
from clutchid.truck.vehicle import Vehicle


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Inputs of a run at every millisecond.

    Set point [m] relative to the sensor's zero, prescribed duty cycles (NaN: from the controller), noise of the
    position sensor [m], the first and last sample for which the sensor is stuck, and by how much in m the sensor reads
    more than the travel from the vented rest.
    """

    wanted: FloatArray
    forced: FloatArray
    noise: FloatArray
    stuck: tuple[int, int] = (-1, -1)
    shift: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Outputs of a run at every millisecond.

    States of the plant, measured position [m] relative to the sensor's zero, chamber pressure after the lag of its
    sensor [Pa], both duty cycles, the mechanical position [m] of the sensor's zero, and by how much [m] the sensor
    reads more than the travel from the vented rest. `names` are those of the states.
    """

    states: FloatArray
    measured: FloatArray
    pressure: FloatArray
    duties: FloatArray
    zero: float
    shift: float
    names: tuple[str, ...]

    @property
    def time(self) -> FloatArray:
        """Time of the samples in s."""
        return np.arange(len(self.measured)) / round(1 / SAMPLE)

    @property
    def columns(self) -> Mapping[str, FloatArray]:
        """The states by their names."""
        return dict(zip(self.names, self.states.T, strict=True))


def run(
    truck: Vehicle, course: Course, *, curve: LoadTable | None = None, start: FloatArray | None = None,
    working: bool = True, substeps: int = 1, ledger: bool = False,
) -> Run:  # fmt: skip
    """Simulate `truck` with the inputs `course`, from the engaged rest or from `start`.

    Parameters
    ----------
    curve : LoadTable, optional
        Load instead of that of the truck.
    start : states, optional
        In the order of `clutchid.truck.structure.Structure.states`.
    working : bool
        Whether the compressor runs at the start.
    substeps : int
        Integration steps per tick of 0.1 ms.
    ledger : bool
        Add `clutchid.truck.structure.LEDGER` as further states.

    Raises
    ------
    SolveError
        If the simulation produces values that are not finite; the text gives the time.
    """
    structure = truck.parts.structure
    curve = load_curve(truck) if curve is None else curve
    x0 = at_rest(truck, curve) if start is None else np.array(start, dtype=np.float64)
    zero = learned_zero(truck, curve) - course.shift
    if ledger:
        x0 = np.concatenate([x0, np.zeros(len(LEDGER))])
    n, loop, values = course.wanted.size, compiled(structure, ledger), numbers(truck, zero, working)
    # NaN for the numbers of parts that the truck does not have: if one were used, the simulation would show it
    parameters, settings = (
        np.array([values.get(name, np.nan) for name in names], dtype=np.float64)
        for names in (loop.PARAMETERS, loop.SETTINGS)
    )
    states, measured, pressure, duties = np.empty((n, x0.size)), np.empty(n), np.empty(n), np.empty((n, 2))
    failed = loop.drive(
        x0, parameters, settings, curve.breakpoints, curve.coefficients, course.wanted, course.forced, course.noise,
        np.array(course.stuck, dtype=np.int64), substeps, states, measured, pressure, duties,
    )  # fmt: skip
    if failed >= 0:
        when = f"{failed * SAMPLE:.3f} s"
        raise SolveError(f"the simulation of the truck is not finite from {when} on; its parameters are too extreme.")
    return Run(states, measured, pressure, duties, zero, course.shift, (*structure.states, *(LEDGER if ledger else ())))


def learned_zero(truck: Vehicle, curve: LoadTable) -> float:
    """Mechanical position in m at which a sensor reads 0 that has learned its zero at the vented rest of `truck`."""
    return rest_position(truck, curve) - truck.e_y
