"""Results with the further facts that their documents need, and `document_of`, the document of any result."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from clutchid.documents.document import Document

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clutchid.documents.fleet_tables import ReasonCount, ReplacementRow, VehicleRow
    from clutchid.estimation import Errors, Fit, LoadCurve
    from clutchid.inference.uncertainty.calibration import Origin
    from clutchid.log import Log
    from clutchid.measurements.look import FileOverview
    from clutchid.observer import ObservedRecording
    from clutchid.preparation.inspection import Inspection
    from clutchid.rig import CoulombFriction, LugreFit
    from clutchid.simulation.simulation import Simulation
    from clutchid.wear import Wear


class Observation(NamedTuple):
    """An observed recording, and the calibration that the observer started from."""

    run: ObservedRecording
    origin: Origin


class WornClutch(NamedTuple):
    """The wear of a clutch, as `clutchid.track` gives it.

    Attributes
    ----------
    wear
        The trend, alarms and remaining life.
    left_out
        What the folder holds beside the recordings, in a sentence; empty if nothing.
    home
        Page of its fleet relative to its own; empty without one.
    """

    wear: Wear
    left_out: str = ""
    home: str = ""


class FleetWear(NamedTuple):
    """The vehicles of a fleet, why recordings do not count, and replacements by month."""

    vehicles: Sequence[VehicleRow]
    reasons: Sequence[ReasonCount]
    replacements: Sequence[ReplacementRow] = ()


class RigFriction(NamedTuple):
    """Friction in recordings of a rig: by Coulomb's law, or by the LuGre law, a fit a recording."""

    logs: Sequence[Log]
    friction: CoulombFriction | list[LugreFit]


class SavedLoad(NamedTuple):
    """Load of a parameter file with the facts of its `Origin`; `reach` is the largest recorded position in m or NaN."""

    name: str
    created: str
    sha256: str
    trust: str
    load: LoadCurve
    reach: float
    is_calibration: bool


class SavedLoads(NamedTuple):
    """Saved loads that are compared."""

    loads: tuple[SavedLoad, ...]


@dataclass(frozen=True, slots=True)
class Looked:
    """The contents of a file, and the checks on it or, in `unchecked`, why there are none.

    `how` says how it was read: nothing, or with the proposed channel map. `log` is what was checked: the recording, or
    its first million samples.
    """

    contents: FileOverview
    inspection: Inspection | None = None
    unchecked: str = ""
    how: str = ""
    log: Log | None = None

    @property
    def checks(self) -> str:
        """The checks as text for a terminal."""
        return self.inspection.table(self.how) if self.inspection else self.unchecked


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecording:
    """A recording and its simulation, with the interval of the pressure where there is one.

    Attributes
    ----------
    recording
        Its name.
    log
        All states.
    message, warnings
        Of the simulation and of the recording.
    errors
        Against what was measured; None without a position.
    """

    recording: str
    log: Log
    message: str
    warnings: tuple[str, ...]
    errors: Errors | None


_Recorded: TypeAlias = "Observation | Looked | RigFriction | SimulatedRecording | Log | Simulation"

#: Builder of each kind of result, imported where such a result comes.
_BUILDERS = {
    "Fit": "fit:fit_document",
    "Observation": "observation:observe_document",
    "WornClutch": "wear:wear_document",
    "FleetWear": "fleet:fleet_document",
    "Looked": "look:look_document",
    "RigFriction": "friction:friction_document",
    "SimulatedRecording": "log:simulated_document",
    "Log": "log:log_document",
    "Simulation": "log:simulation_document",
    "SavedLoads": "saved_loads:saved_loads_document",
}


def document_of(
    result: Fit | WornClutch | FleetWear | SavedLoads | _Recorded,
    command: str = "",
) -> Document:
    """Document of a result, which is the same for every medium.

    Parameters
    ----------
    result
        A fit, an observed recording, the wear of a clutch or a fleet, a look at a file, friction of a rig, a
        simulation, a log, or saved loads.
    command
        The command that repeats it.
    """
    module, _, builder = _BUILDERS[type(result).__name__].partition(":")
    document: Document = getattr(import_module(f"clutchid.documents.{module}"), builder)(result, command)
    return document
