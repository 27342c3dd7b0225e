"""Truth of a drive, separate from its recording: load, states, temperatures and supply."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from clutchid.io.files import atomic_write
from clutchid.log import COLUMNS, FloatArray, Log
from clutchid.truck.load import LoadCurve
from clutchid.truck.parameters import Truck
from clutchid.truck.running import Run, column

#: Positions in m, relative to the sensor's zero, at which a truth file gives the load.
GRID = np.arange(1, 41) / 2000


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """True states and load, at the sampling times of the controller.

    `truck` is the truck at its age; `curve` is the load over the mechanical position; `zero` is the mechanical position
    [m] at which the sensor reads 0. `states` has columns in SI: position (relative to the sensor's zero), velocity, the
    three pressures and temperatures, masses of air, deflections of seal and bearing, lifts of the valves, governor.
    """

    truck: Truck
    curve: LoadCurve
    zero: float
    time: FloatArray
    states: Mapping[str, FloatArray]

    @property
    def supply(self) -> float:
        """Set supply pressure in Pa."""
        return self.truck.P_S

    @property
    def touch(self) -> float:
        """Touch point of the clutch in m, relative to the sensor's zero."""
        return self.curve.touch - self.zero

    def load(self, position: FloatArray) -> FloatArray:
        """True load in N, without friction and hysteresis, at positions in m relative to the sensor's zero."""
        return self.curve.force(np.asarray(position) + self.zero)

    @property
    def log(self) -> Log:
        """The states that a `Log` has columns for, without noise."""
        columns = {name: values for name, values in self.states.items() if name in COLUMNS}
        return Log(self.time, columns, "truth")


def truth_of(truck: Truck, curve: LoadCurve, run: Run) -> Truth:
    """The truth of a run."""
    x = {name: column(run.states, name) for name in ("y", "v", "m_A", "U_A", "m_B", "U_B", "m_S", "U_S", "z", "z_h")}
    volume = {
        "a": truck.V_0A + truck.A_A * x["y"],
        "b": truck.V_0B + truck.A_B * (truck.y_max - x["y"]),
        "supply": np.full(x["y"].size, truck.V_S),
    }
    states = {"position": x["y"] - run.zero, "velocity": x["v"], "deflection": x["z"], "bearing": x["z_h"]}
    for chamber, letter in (("a", "A"), ("b", "B"), ("supply", "S")):
        mass, energy = x[f"m_{letter}"], x[f"U_{letter}"]
        states[f"pressure_{chamber}"] = (truck.gamma - 1) * energy / volume[chamber]
        states[f"temperature_{chamber}"] = (truck.gamma - 1) * energy / (truck.R * mass)
        states[f"mass_{chamber}"] = mass
    others = (("lift_supply", "x_s"), ("lift_exhaust", "x_e"), ("pressure_governor", "p_G"))
    states |= {name: column(run.states, letter) for name, letter in others}
    return Truth(truck, curve, run.zero, run.time, states)


def write_truth(truths: Mapping[str, Truth], path: str | PathLike[str]) -> None:
    """Write the true loads of several recordings, by the stem of each recording's file, as JSON.

    Keys: ``position_m`` (0.5 to 20 mm, relative to the sensor's zero) and ``logs``: stem: ``load_N``, ``supply_Pa``,
    and ``wear_m``, ``cycles``, ``ambient_K``, ``zero_m`` (mechanical position of the sensor's zero), ``touch_m``.

    Raises
    ------
    ExportError
        If the file cannot be written; an older file is then unchanged.
    """
    content = {"position_m": GRID.tolist(), "logs": {stem: _entry(truth) for stem, truth in truths.items()}}
    with atomic_write(path) as temporary:
        temporary.write_text(json.dumps(content), encoding="utf-8")


def _entry(truth: Truth) -> dict[str, Any]:
    truck = truth.truck
    return {
        "load_N": truth.load(GRID).tolist(),
        "supply_Pa": truth.supply,
        "wear_m": truck.wear,
        "cycles": truck.cycles,
        "ambient_K": truck.T_0,
        "zero_m": truth.zero,
        "touch_m": truth.touch,
    }
