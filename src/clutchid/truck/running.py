"""Run the compiled loop of a truck."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import SolveError
from clutchid.log import FloatArray, read_only
from clutchid.truck.assembly import at_rest, load_curve, numbers
from clutchid.truck.compiled import compiled_plant, loop
from clutchid.truck.load_table import LoadTable, rest_position
from clutchid.truck.settings import SAMPLE, Course, Plant, RunOutputs, Settings
from clutchid.truck.structure import LEDGER
from clutchid.truck.vehicle import Vehicle


@dataclass(frozen=True, slots=True, eq=False)
class TruckRun:
    """A run: its outputs, the mechanical position [m] of the sensor's zero, and the shift of its course.

    `names` are those of the states.
    """

    outputs: RunOutputs
    zero: float
    shift: float
    names: tuple[str, ...]

    @property
    def time(self) -> FloatArray:
        """Time of the samples in s."""
        return np.arange(len(self.outputs.measured)) / round(1 / SAMPLE)

    @property
    def columns(self) -> Mapping[str, FloatArray]:
        """The states by their names."""
        return dict(zip(self.names, self.outputs.states.T, strict=True))


def run_truck(
    truck: Vehicle, course: Course, *, curve: LoadTable | None = None, start: FloatArray | None = None,
    working: bool = True, substeps: int = 1, ledger: bool = False,
) -> TruckRun:  # fmt: skip
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
    n, plant, values = course.wanted.size, compiled_plant(structure, ledger), numbers(truck, zero, working)
    # NaN for the numbers of parts that the truck does not have: if one were used, the simulation would show it
    settings = Settings(**{name: float(values.get(name, np.nan)) for name in Settings._fields})
    parameters = np.array([values.get(name, np.nan) for name in plant.parameters], dtype=np.float64)
    # arrays of one kind, for which the loop is compiled once
    moved = Plant(
        x0, parameters, np.zeros(plant.work), read_only(curve.breakpoints), read_only(curve.coefficients),
        structure.gas == "energy", structure.states.index("x_s"), _place(structure.states, "p_G"), substeps,
    )  # fmt: skip
    wanted, forced, noise = map(read_only, (course.wanted, course.forced, course.noise))
    inputs = Course(wanted, forced, noise, course.stuck, course.shift)
    outputs = RunOutputs(np.empty((n, x0.size)), np.empty(n), np.empty(n), np.empty((n, 2)))
    failed = loop().drive(plant.begin, plant.move, moved, settings, inputs, outputs)
    if failed >= 0:
        when = f"{failed * SAMPLE:.3f} s"
        raise SolveError(f"the simulation of the truck is not finite from {when} on; its parameters are too extreme.")
    return TruckRun(outputs, zero, course.shift, (*structure.states, *(LEDGER if ledger else ())))


def _place(names: Sequence[str], name: str) -> int:
    """Place of `name`, -1 where there is none."""
    return names.index(name) if name in names else -1


def learned_zero(truck: Vehicle, curve: LoadTable) -> float:
    """Mechanical position in m at which a sensor reads 0 that has learned its zero at the vented rest of `truck`."""
    return rest_position(truck, curve) - truck.e_y
