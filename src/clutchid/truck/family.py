"""`Family`: what distinguishes a family of trucks, as a record of functions; everything else is shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.load_table import LoadTable
from clutchid.truck.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Family:
    """Functions of a family; trucks are of the type `kind`, and their ranges are in the file `ranges`.

    `prepared` completes drawn numbers before the shares are drawn, `finished` after them. `load_curve` gives the load
    of a truck. `states` names the states of its plant, `loop` is its compiled loop, with or without a ledger, whose
    arrays are filled by `at_rest` (truck, curve), `plant_parameters` (truck) and `settings` (truck, zero, working).
    `start` draws initial states and whether a compressor runs, `position_noise` and `measured_pressure` belong to the
    sensors. `true_states` are the columns of the truth, from a truck and the states of a run. `changes` are the changes
    between calibration and use, by name.
    """

    kind: type[Vehicle]
    ranges: Path
    prepared: Callable[[dict[str, Any]], dict[str, Any]]
    finished: Callable[[dict[str, Any]], dict[str, Any]]
    load_curve: Callable[[Any], LoadTable]
    states: tuple[str, ...]
    loop: Callable[[bool], ModuleType]
    at_rest: Callable[[Any, LoadTable], FloatArray]
    plant_parameters: Callable[[Any], FloatArray]
    settings: Callable[[Any, float, bool], FloatArray]
    start: Callable[[Any, LoadTable, np.random.Generator], tuple[FloatArray, bool]]
    position_noise: Callable[[Any, int, np.random.Generator], FloatArray]
    measured_pressure: Callable[[Any, FloatArray, np.random.Generator], FloatArray]
    true_states: Callable[[Any, Mapping[str, FloatArray]], dict[str, FloatArray]]
    changes: Mapping[str, Callable[[Any], Vehicle]]
