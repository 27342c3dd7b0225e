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
    from clutchid.errors import ClutchidError as ClutchidError
    from clutchid.errors import DataError as DataError
    from clutchid.errors import ExportError as ExportError
    from clutchid.errors import MissingExtra as MissingExtra
    from clutchid.errors import ParameterError as ParameterError
    from clutchid.errors import SolveError as SolveError
    from clutchid.estimation import Fit as Fit
    from clutchid.estimation.assess.verdict import Verdict as Verdict
    from clutchid.estimation.assess.verdict import verdict as verdict
    from clutchid.estimation.fit_problem import FitProblem as FitProblem
    from clutchid.estimation.parameter_file import read_parameters as read_parameters
    from clutchid.estimation.parameter_file import write_parameters as write_parameters
    from clutchid.estimation.request import FitRequest as FitRequest
    from clutchid.fleets.once import fleet_once as fleet_once
    from clutchid.fleets.once import recording_row as recording_row
    from clutchid.fleets.verbs import FleetRun as FleetRun
    from clutchid.fleets.verbs import fleet as fleet
    from clutchid.inference.uncertainty.calibration import Calibration as Calibration
    from clutchid.inference.uncertainty.coordinates import Prior as Prior
    from clutchid.log import Log as Log
    from clutchid.measurements import read as read
    from clutchid.measurements import read_pieces as read_pieces
    from clutchid.measurements import write as write
    from clutchid.measurements.look import look as look
    from clutchid.model import Actuator as Actuator
    from clutchid.model import Load as Load
    from clutchid.observer.configuration import Observer as Observer
    from clutchid.parameters import Parameters as Parameters
    from clutchid.simulation import Partition as Partition
    from clutchid.simulation import Simulation as Simulation
    from clutchid.simulation import Simulations as Simulations
    from clutchid.simulation import simulate as simulate
    from clutchid.simulation import simulate_many as simulate_many
    from clutchid.study import bundled_recording as bundled_recording
    from clutchid.truck import drive as drive
    from clutchid.verbs.attached import plot as plot
    from clutchid.verbs.attached import report as report
    from clutchid.verbs.cutting import cut as cut
    from clutchid.verbs.exporting import export as export
    from clutchid.verbs.fitting import calibrate as calibrate
    from clutchid.verbs.fitting import estimate as estimate
    from clutchid.verbs.fitting import fit as fit
    from clutchid.verbs.fitting import problem as problem
    from clutchid.verbs.observing import observe as observe
    from clutchid.verbs.rig import friction as friction
    from clutchid.verbs.saving import parameter_file as parameter_file
    from clutchid.verbs.tracking import track as track
    from clutchid.wear.life import Wear as Wear

#: Public names by the module that has them.
_NAMES: dict[str, tuple[str, ...]] = {
    "errors": ("ClutchidError", "DataError", "ExportError", "MissingExtra", "ParameterError", "SolveError"),
    "estimation": ("Fit",),
    "estimation.assess.verdict": ("Verdict", "verdict"),
    "estimation.fit_problem": ("FitProblem",),
    "estimation.request": ("FitRequest",),
    "estimation.parameter_file": ("read_parameters", "write_parameters"),
    "verbs.tracking": ("track",),
    "fleets.once": ("fleet_once", "recording_row"),
    "fleets.verbs": ("FleetRun", "fleet"),
    "inference.uncertainty.calibration": ("Calibration",),
    "inference.uncertainty.coordinates": ("Prior",),
    "log": ("Log",),
    "model": ("Actuator", "Load"),
    "observer.configuration": ("Observer",),
    "parameters": ("Parameters",),
    "measurements": ("read", "read_pieces", "write"),
    "measurements.look": ("look",),
    "simulation": ("Partition", "Simulation", "Simulations", "simulate", "simulate_many"),
    "study": ("bundled_recording",),
    "truck": ("drive",),
    "wear.life": ("Wear",),
    "verbs.attached": ("plot", "report"),
    "verbs.cutting": ("cut",),
    "verbs.exporting": ("export",),
    "verbs.fitting": ("calibrate", "estimate", "fit", "problem"),
    "verbs.observing": ("observe",),
    "verbs.rig": ("friction",),
    "verbs.saving": ("parameter_file",),
}
_HOME = {name: f"clutchid.{module}" for module, names in _NAMES.items() for name in names}

__all__ = [*_HOME]  # noqa: PLE0604, made of names that are text


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from clutchid.version import installed_version

        return installed_version()
    if name not in _HOME:
        raise AttributeError(f"module 'clutchid' has no attribute '{name}'")
    from clutchid.verbs.attached import attach

    value = getattr(import_module(_HOME[name]), name)
    attach()
    return value


def made(name: str, *values: Any) -> Any:
    """The public record of that name with these values of its fields, as `pickle` and `copy` make it."""
    return __getattr__(name)(*values)


def __dir__() -> list[str]:
    return sorted([*_HOME, "__version__"])
