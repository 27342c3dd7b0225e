"""clutchid: from a recording of an electropneumatic clutch actuator to the load that the clutch puts on its piston.

>>> import clutchid
>>> actuator = clutchid.Actuator()
>>> actuator.value("A_A")
0.0123

Names are imported when they are first used, so that ``import clutchid`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from clutchid.errors import ClutchidError, DataError, ExportError, MissingExtra, ParameterError, SolveError
    from clutchid.estimation import Fit, fit
    from clutchid.estimation.parameter_file import read_parameters, write_parameters
    from clutchid.inference.uncertainty.calibration import Calibration
    from clutchid.inference.uncertainty.coordinates import Prior
    from clutchid.log import Log
    from clutchid.model import Actuator, Load
    from clutchid.parameters import Parameters
    from clutchid.recordings import read, read_pieces, write
    from clutchid.recordings.look.look import look
    from clutchid.simulation import Partition, Simulation, simulate
    from clutchid.study import bundled_recording
    from clutchid.workflow.verbs import calibrate, estimate, parameter_file

_HOME = {
    "Actuator": "clutchid.model",
    "Calibration": "clutchid.inference.uncertainty.calibration",
    "ClutchidError": "clutchid.errors",
    "DataError": "clutchid.errors",
    "ExportError": "clutchid.errors",
    "Fit": "clutchid.estimation",
    "Load": "clutchid.model",
    "Log": "clutchid.log",
    "MissingExtra": "clutchid.errors",
    "ParameterError": "clutchid.errors",
    "Parameters": "clutchid.parameters",
    "Partition": "clutchid.simulation",
    "Prior": "clutchid.inference.uncertainty.coordinates",
    "Simulation": "clutchid.simulation",
    "SolveError": "clutchid.errors",
    "bundled_recording": "clutchid.study",
    "calibrate": "clutchid.workflow.verbs",
    "estimate": "clutchid.workflow.verbs",
    "fit": "clutchid.estimation",
    "look": "clutchid.recordings.look.look",
    "parameter_file": "clutchid.workflow.verbs",
    "read": "clutchid.recordings",
    "read_pieces": "clutchid.recordings",
    "read_parameters": "clutchid.estimation.parameter_file",
    "simulate": "clutchid.simulation",
    "write": "clutchid.recordings",
    "write_parameters": "clutchid.estimation.parameter_file",
}

__all__ = [
    "Actuator",
    "Calibration",
    "ClutchidError",
    "DataError",
    "ExportError",
    "Fit",
    "Load",
    "Log",
    "MissingExtra",
    "ParameterError",
    "Parameters",
    "Partition",
    "Prior",
    "Simulation",
    "SolveError",
    "bundled_recording",
    "calibrate",
    "estimate",
    "fit",
    "look",
    "parameter_file",
    "read",
    "read_parameters",
    "read_pieces",
    "simulate",
    "write",
    "write_parameters",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("clutchid")
    if name not in _HOME:
        raise AttributeError(f"module 'clutchid' has no attribute '{name}'")
    from clutchid.workflow.attached import attach

    found = getattr(import_module(_HOME[name]), name)
    attach()
    return found


def __dir__() -> list[str]:
    return sorted([*_HOME, "__version__"])
