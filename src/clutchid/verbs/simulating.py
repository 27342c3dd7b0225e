"""`simulated`: an actuator with the duty cycles of a recording, from its own start values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.documents.results import SimulatedRecording
from clutchid.estimation.result import errors_over
from clutchid.estimation.verification import starts_of
from clutchid.log import Log
from clutchid.simulation import Partition, Simulation, simulate
from clutchid.strokes.values import values_of
from clutchid.strokes.vented_pressure import with_ambient, without_zeros
from clutchid.strokes.vented_rest import ZeroedLog
from clutchid.verbs.reading import Reading

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile


def simulated(
    reading: Reading, content: ParameterFile, partition: Partition | None = None, file: Path | None = None
) -> SimulatedRecording:
    """Read and check a recording, and simulate it with the actuator of a parameter file.

    If it does not start vented and at rest, position and pressure at its start are taken from the file where it has
    them for exactly this recording, else estimated from the measured position. The errors of the recordings `verify`,
    of the same actuator and with pressure, give the interval of the pressure.

    Raises
    ------
    DataError, SolveError
        If a recording cannot be read, a check of it is bad, or it cannot be simulated.
    """
    from clutchid.inference.uncertainty.switching_band import switching_band

    checked = reading.checked(content.actuator, rest=content.rest)
    values = without_zeros([values_of(log, content.actuator).log for log in checked])
    rested = [content.from_rest(log) for log in values]
    recording, *others = [zeroed.log for zeroed in rested]
    simulation = _simulation(recording, content, partition)
    compared = [(other, _simulation(other, content, partition).log) for other in others]
    log = switching_band(simulation.log, compared) if compared else simulation.log
    starts = _starts_of_another(recording, content, file)
    warnings = dict.fromkeys((*recording.warnings, *_moved(rested[0]), *starts, *simulation.warnings))
    errors = errors_over([(recording, simulation.log)]) if "position" in recording else None
    return SimulatedRecording(recording.name, log, simulation.message, tuple(warnings), errors)


def _simulation(log: Log, content: ParameterFile, partition: Partition | None) -> Simulation:
    starts = content.starts_for(log) or starts_of(log, with_ambient(content.actuator, [log])[0], partition)
    return simulate(content.actuator, log, partition=partition, starts=starts, force=True)  # it has been checked


def _moved(rested: ZeroedLog) -> tuple[str, ...]:
    """Warning of a vented rest that has moved since the calibration, where that was subtracted."""
    if not rested.subtracted:
        return ()
    return (
        f"{rested.log.name}: the vented rest has moved by {rested.subtracted * 1e3:+.2f} mm since the calibration, "
        "which is subtracted from the measured position.",
    )


def _starts_of_another(recording: Log, content: ParameterFile, file: Path | None) -> tuple[str, ...]:
    """Warning of start values that the parameter file has for another recording of this name."""
    if content.starts_for(recording) is not None or not content.starts.get(recording.name):
        return ()
    return (
        f"{recording.name}: {file} has start values for a recording of this name, but not for exactly this file "
        "(sha256 in [fit] data); they were estimated again.",
    )
