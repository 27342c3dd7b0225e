"""Recordings simulated with a fitted actuator, on their own samples and as their sensors would record them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimate.request import FitRequest
from clutchid.estimate.result import Fit, Recording, errors_over
from clutchid.estimate.simulation_error.fit import fit_simulation_error
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.parameters import Parameters
from clutchid.preparation.prepare import check_recordings, driven
from clutchid.preparation.pulses import Pulsed, unsensed
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import plan
from clutchid.simulation.sensors import sensed
from clutchid.simulation.stiffness import stiffness, top_speed


def verified(result: Fit, logs: Sequence[Log], request: FitRequest) -> Fit:
    """`result` with the simulations of other recordings, and what is to be said of them."""
    done, warnings = verification(result.actuator, logs, request.partition, request.measure, result.follows)
    all_warnings = (*result.warnings, *(f"verification: {warning}" for warning in warnings))
    status = "warning" if all_warnings and result.status == "ok" else result.status
    return replace(result, verification=done, warnings=all_warnings, status=status)


def verification(
    actuator: Actuator,
    logs: Sequence[Log],
    partition: Partition | None,
    measure: Sequence[str] = ("position",),
    through_sensors: bool = False,
) -> tuple[dict[str, Recording], list[str]]:
    """Recordings simulated with `actuator`, nothing fitted but unknown starts, with their errors; and warnings.

    A recording that cannot be simulated is left out and is a warning. `through_sensors` for an actuator whose sensors
    and carrier are part of the model: each recording is simulated with the phase that its carrier has, and its errors
    are those of the simulation as the sensors would record it.

    Raises
    ------
    DataError
        If a recording lacks a column.
    """
    done: dict[str, Recording] = {}
    warnings: list[str] = []
    for log in driven(logs, actuator.equipment):
        used = tuple(name for name in measure if name in log) or ("position",)
        own = unsensed(log, actuator) if through_sensors else Pulsed(log, actuator)
        result = _with_starts(own.log, own.actuator, partition, used)
        for name, one in result.recordings.items():
            done[name] = as_sensed(one, log, own.actuator.parameters) if through_sensors else one
        warnings += [own.warning] if own.warning else []
        warnings += result.warnings if result.status != "failed" else [result.message]
    return done, warnings


def starts_of(log: Log, actuator: Actuator, partition: Partition | None = None) -> tuple[tuple[float, float], ...]:
    """Position in m and pressure in Pa at the start of every segment, estimated where they are not known.

    Raises
    ------
    DataError
        If a start is unknown and the recording has no position to estimate it from.
    SolveError
        If it cannot be simulated.
    """
    log = actuator.equipment.driven(log)
    prepared = plan(log, actuator, stiffness(actuator, top_speed(partition)), partition)
    if all(segment.vented for segment in prepared.segments):
        return tuple((s.position_start, actuator.parameters.P_0) for s in prepared.segments)
    return _with_starts(log, actuator, partition, ("position",)).raised().recordings[log.name].starts


def _with_starts(log: Log, actuator: Actuator, partition: Partition | None, measure: tuple[str, ...]) -> Fit:
    """A recording simulated with nothing estimated but its unknown starts."""
    check_recordings([log], (), measure, actuator.parameters.y_max)
    return fit_simulation_error([log], actuator, FitRequest(measure, (), partition=partition))


def on_samples(one: Recording, log: Log) -> Recording:
    """What a fit says of a recording at the samples of `log`, where it was simulated on a finer raster."""
    if len(one.measured) == len(log):
        return one
    at = np.searchsorted(one.simulated.time, log.time)
    columns = {name: values[at] for name, values in one.simulated.columns.items()}
    return replace(one, measured=log, simulated=replace(one.simulated, time=log.time, columns=columns))


def as_sensed(one: Recording, log: Log, p: Parameters) -> Recording:
    """A simulation of the recording `unsensed` against `log`: its errors are those that the sensors would show."""
    shown = on_samples(replace(one, simulated=sensed(one.simulated, p)), log).simulated
    return replace(on_samples(one, log), measured=log, errors=errors_over([(log, shown)]))
