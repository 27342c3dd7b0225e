"""`document_of`: the document of any result."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from clutchid.documents.document import Document

if TYPE_CHECKING:
    from clutchid.documents.results import (
        FleetWear,
        Looked,
        Observation,
        RigFriction,
        SimulatedRecording,
        WornClutch,
    )
    from clutchid.estimation import Fit
    from clutchid.log import Log
    from clutchid.simulation.simulation import Simulation

    Result = Fit | Observation | WornClutch | FleetWear | Looked | RigFriction | SimulatedRecording | Log | Simulation

#: Builder of each kind of result, imported where such a result comes.
_BUILDERS = {
    "Fit": "fit:fit_document",
    "Observation": "observe:observe_document",
    "WornClutch": "wear:wear_document",
    "FleetWear": "fleet:fleet_document",
    "Looked": "look:look_document",
    "RigFriction": "friction:friction_document",
    "SimulatedRecording": "simulation:simulated_document",
    "Log": "log:log_document",
    "Simulation": "log:simulation_document",
}


def document_of(result: Result, command: str = "") -> Document:
    """Document of a result, which is the same for every medium.

    Parameters
    ----------
    result
        A fit, an observed recording, the wear of a clutch or a fleet, a look at a file, friction of a rig, a
        simulation, or a log.
    command
        The command that repeats it.
    """
    module, _, builder = _BUILDERS[type(result).__name__].partition(":")
    document: Document = getattr(import_module(f"clutchid.documents.{module}"), builder)(result, command)
    return document
