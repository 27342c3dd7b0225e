"""Recordings simulated with a fitted actuator, their vented rests, and bands of slow recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.method import fit_at
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.result import Fit, Recording, errors_over
from clutchid.estimation.simulation_error import SIMULATION
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import base_of
from clutchid.numerics.interval import QUANTILE
from clutchid.parameters import Parameters
from clutchid.preparation.prepare import check_recordings, with_duty_cycles
from clutchid.preparation.pulses import Pulsed, pulsed_without_sensors
from clutchid.simulation.inputs import at_samples, with_inputs
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import plan
from clutchid.simulation.sensors import with_sensors
from clutchid.simulation.stiffness import stiffness, top_speed
from clutchid.strokes.duty_cycle import is_slow

#: Standard deviation of a load that is read from a slow recording, as a share of it, beside that of a recording with
#: every change of the duty cycles. Provenance: `benchmarks/slow_logs.py`, docs/derivations.md, "What a slow log
#: lacks".
MISSED = 0.02


def with_slow_logs(fit: Fit, logs: Sequence[Log]) -> Fit:
    """`fit` of a load with the interval of slow recordings; as it is if all `logs` have every change of the inputs.

    Times at which valves open that are not recorded change the air that passes, and the load by a share of itself.
    """
    if not any(map(is_slow, logs)):
        return fit
    load, curve = fit.actuator.load, fit.load_curve
    weights = dict(zip(load.names, load.theta, strict=True))
    missed = MISSED * np.array([weights.get(base_of(name), 0.0) for name in fit.parameters])
    estimates = dict(fit.parameters)
    for name, by in zip(fit.parameters, np.abs(missed).tolist(), strict=True):
        e = fit.parameters[name]
        if by > 0.0:
            below, above = (float(np.hypot(side, QUANTILE * by)) for side in (e.value - e.low, e.high - e.value))
            estimates[name] = replace(e, std=float(np.hypot(e.std, by)), low=e.value - below, high=e.value + above)
    return replace(
        fit,
        parameters=estimates,
        covariance=fit.covariance + np.outer(missed, missed),
        load_curve=curve.widened(QUANTILE * MISSED * curve.force),
    )


def verification(
    actuator: Actuator,
    logs: Sequence[Log],
    partition: Partition | None,
    measure: Sequence[str] = ("position",),
    through_sensors: bool = False,
) -> tuple[dict[str, Recording], list[str]]:
    """Simulate recordings with `actuator`, estimating unknown start values only; results with errors, and warnings.

    A recording that cannot be simulated is left out with a warning. With `through_sensors` the model includes sensors
    and carrier: each recording is simulated with the phase of its carrier, and its errors are those of the simulated
    sensor outputs.

    Raises
    ------
    DataError
        If a recording lacks a column.
    """
    recordings: dict[str, Recording] = {}
    warnings: list[str] = []
    for recording in with_duty_cycles(logs, actuator.equipment):
        log = with_inputs(recording)
        used = tuple(name for name in measure if name in log) or ("position",)
        own = pulsed_without_sensors(log, actuator) if through_sensors else Pulsed(log, actuator)
        result = _with_starts(own.log, own.actuator, partition, used)
        for name, run in result.recordings.items():
            compared = compared_at_sensors(run, log, own.actuator.parameters) if through_sensors else run
            recordings[name] = on_samples(compared, recording)
        warnings += [own.warning] if own.warning else []
        warnings += result.warnings if result.status != "failed" else [result.message]
    return recordings, warnings


def starts_of(log: Log, actuator: Actuator, partition: Partition | None = None) -> tuple[tuple[float, float], ...]:
    """Position in m and pressure in Pa at the start of every segment, estimated where unknown.

    Raises
    ------
    DataError
        If a start is unknown and the recording has no position to estimate it from.
    SolveError
        If it cannot be simulated.
    """
    log = with_inputs(actuator.equipment.driven(log))
    prepared = plan(log, actuator, stiffness(actuator, top_speed(partition)), partition)
    if all(segment.vented for segment in prepared.segments):
        return tuple((s.position_start, actuator.parameters.P_0) for s in prepared.segments)
    return _with_starts(log, actuator, partition, ("position",)).raised().recordings[log.name].starts


def _with_starts(log: Log, actuator: Actuator, partition: Partition | None, measure: tuple[str, ...]) -> Fit:
    """A recording simulated with only its unknown start values estimated."""
    check_recordings([log], (), measure, actuator.parameters.y_max)
    free = FreeParameters((), measure, partition=partition)
    return fit_at(SIMULATION, SIMULATION.search([log], actuator, free, None, None))


def on_samples(recording: Recording, log: Log) -> Recording:
    """A result of a recording at all samples of `log`, if only those with inputs, or a finer grid, were simulated."""
    if len(recording.measured) == len(log):
        return recording
    return replace(recording, measured=log, simulated=at_samples(recording.simulated, log))


def compared_at_sensors(recording: Recording, log: Log, p: Parameters) -> Recording:
    """A simulation of a recording without sensors, compared with `log` through the sensor models."""
    shown = on_samples(replace(recording, simulated=with_sensors(recording.simulated, p)), log).simulated
    return replace(on_samples(recording, log), measured=log, errors=errors_over([(log, shown)]))
