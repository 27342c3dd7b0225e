"""Truth of a drive, separate from its recording: load, states, temperatures and supply."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from clutchid.files import write_text
from clutchid.log import COLUMNS, FloatArray, Log
from clutchid.truck.assembly import true_states
from clutchid.truck.load_table import LoadTable
from clutchid.truck.running import TruckRun
from clutchid.truck.vehicle import Vehicle

#: Travel in m from the vented rest at which a truth file gives the load.
GRID = np.arange(1, 41) / 2000


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """True states and load, at the sampling times of the controller.

    Attributes
    ----------
    truck
        The truck at its age.
    curve : N over m
        The load over the mechanical position.
    zero : m
        Mechanical position at which the sensor reads 0.
    shift : m
        By how much it reads more than the travel from the vented rest.
    time : s, (n,)
        Sampling times.
    states : SI, (n,) each
        Position (relative to the sensor's zero), velocity, the three pressures, and what else its parts have:
        temperatures and masses of air, deflections of seals and bearing, openings of the valves.
    """

    truck: Vehicle
    curve: LoadTable
    zero: float
    shift: float
    time: FloatArray
    states: Mapping[str, FloatArray]

    @property
    def supply(self) -> float:
        """Set supply pressure in Pa."""
        return self.truck.P_S

    @property
    def touch(self) -> float:
        """Touch point of the clutch in m, as travel from the vented rest."""
        return self.curve.touch - self.zero - self.shift

    def load(self, travel: FloatArray) -> FloatArray:
        """True load in N, without friction and hysteresis, over the travel in m from the vented rest.

        A zero that was learned at this rest may have missed it by the truck's `e_y`, and travel is counted from there.
        """
        return self.curve.force(np.asarray(travel) + self.zero + self.shift)

    @property
    def log(self) -> Log:
        """The states that a `Log` has columns for, without noise."""
        columns = {name: values for name, values in self.states.items() if name in COLUMNS}
        return Log(self.time, columns, "truth")


def truth_of(truck: Vehicle, curve: LoadTable, run: TruckRun) -> Truth:
    """The truth of a run."""
    x = run.columns
    states = {"position": x["y"] - run.zero, "velocity": x["v"], **true_states(truck, x)}
    return Truth(truck, curve, run.zero, run.shift, run.time, states)


def write_truth(truths: Mapping[str, Truth], path: str | PathLike[str]) -> None:
    """Write the true loads of several recordings, by the stem of each recording's file, as JSON.

    Keys: ``position_m`` (0.5 to 20 mm of travel from the vented rest) and ``logs``: stem: ``load_N``, ``supply_Pa``,
    and ``wear_m``, ``cycles``, ``ambient_K``, ``zero_m`` (mechanical position of the sensor's zero), ``rest_shift_m``
    (what the sensor reads more than this travel), ``touch_m``.

    Raises
    ------
    ExportError
        If the file cannot be written; an older file is then unchanged.
    """
    content = {"position_m": GRID.tolist(), "logs": {stem: _entry(truth) for stem, truth in truths.items()}}
    write_text(json.dumps(content), path)


def _entry(truth: Truth) -> dict[str, Any]:
    truck = truth.truck
    return {
        "load_N": truth.load(GRID).tolist(), "supply_Pa": truth.supply, "wear_m": truck.wear, "cycles": truck.cycles,
        "ambient_K": truck.T_0, "zero_m": truth.zero, "rest_shift_m": truth.shift, "touch_m": truth.touch,
    }  # fmt: skip
