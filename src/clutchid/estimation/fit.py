"""A request of a fit to recordings, by the method that it needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Literal, NamedTuple

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.verdict import nothing_in_common
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.calibrate import fit_with, free_parameters
from clutchid.estimation.causes import with_causes
from clutchid.estimation.method import Method
from clutchid.estimation.prediction_error import PREDICTION_ERROR
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit, Recording
from clutchid.estimation.shooting import MOST_TOGETHER, SHOOTING
from clutchid.estimation.simulation_error import SIMULATION
from clutchid.estimation.verification import on_samples, verification
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import base_of, unknown_name
from clutchid.numerics.progress import Progress, report_stage, within_stage
from clutchid.preparation.prepare import check_recordings, with_duty_cycles, with_usable_samples
from clutchid.preparation.pulses import lacks_changes
from clutchid.simulation.inputs import with_inputs
from clutchid.strokes.vented_pressure import with_ambient, without_zeros
from clutchid.strokes.vented_rest import ZeroedLog, from_rest

MethodName = Literal["simulation", "shooting", "prediction-error"]

#: Methods by name.
FIT_METHODS: Mapping[str, Method] = MappingProxyType(
    {method.name: method for method in (SIMULATION, SHOOTING, PREDICTION_ERROR)}
)


def fit_request(
    logs: Sequence[Log],
    actuator: Actuator | None,
    request: FitRequest,
    verify: Sequence[Log] = (),
    progress: Progress | None = None,
    methods: Mapping[str, Method] = FIT_METHODS,
    *,
    seek_causes: bool = True,
    before_checks: Callable[[Fit], None] = lambda _: None,
) -> Fit:
    """Fit `request` to recordings by one of `methods`, and simulate the recordings `verify` with the result.

    Several recordings whose load is read from a calibration are also read one by one, because a load that they share is
    meant for one state of wear of one vehicle. With `seek_causes`, faults of the inputs are compared where a reading is
    not explained by its calibration. `before_checks` is that of `fit_with`. Status "failed" if the start values cannot
    be simulated.

    Raises
    ------
    DataError, ParameterError
        As `fit`; also where recordings read one by one are of two vehicles, for which a search of all has no end.
    """
    recordings = ready(logs, actuator, request, verify, methods)
    request, start, method = recordings.request, recordings.start, recordings.method
    rested, checked = recordings.rested, recordings.checked
    others, readings = [zeroed.log for zeroed in checked], {}
    from_position = request.calibration and request.calibration.theta and request.measure == ("position",)
    if len(rested) > 1 and from_position and free_parameters(recordings.logs, start, request)[1].reads_load(start):
        readings = _one_by_one(recordings.usable, start, request, progress, methods)
        DataError.raise_for(filter(None, [nothing_in_common(readings)]))
    inputs = [with_inputs(log) for log in recordings.logs]
    result = fit_with(method, inputs, start, request, progress, before_checks)
    if result.status == "failed":
        return result
    if seek_causes and len(rested) == 1 and result.departure is not None and request.calibration is not None:

        def read(log: Log) -> Fit:
            within = within_stage(progress, "causes")
            return fit_request([log], start, request, (), within, methods, seek_causes=False)

        report_stage(progress, "causes")
        result = with_causes(result, recordings.logs[0], start, request.calibration, read)
    calibrated = result.baseline is not None and len(result.baseline.theta) > 0 and result.load_is_fitted
    if len(rested) > 1 and calibrated and not readings:
        readings = _one_by_one(recordings.usable, start, request, progress, methods)
    report_stage(progress, "verification")
    simulated, problems = verification(result.actuator, others, request.partition, request.measure, result.follows)
    compared = others if result.baseline is None else []
    before, _ = verification(start, compared, request.partition, request.measure, result.follows)
    gains = {
        name: 1.0 - recording.errors.position_rms / max(before[name].errors.position_rms, 1e-12)
        for name, recording in simulated.items()
        if name in before
    }
    return replace(
        result,
        recordings=_with_rests(result.recordings, rested),
        verification=_with_rests(simulated, checked),
        readings=readings,
        notes=(*result.notes, *recordings.said),
        gains=gains,
        request=request,
        start=start,
        warnings=(*result.warnings, *(f"verification: {problem}" for problem in problems)),
    )


class Ready(NamedTuple):
    """Recordings made ready for a fit: the completed request, its start and method, and what was said on the way.

    `usable` are the recordings with their duty cycles, `rested` and `checked` (those of the verification) these with
    their positions counted from the vented rest.
    """

    request: FitRequest
    start: Actuator
    method: Method
    usable: Sequence[Log]
    rested: Sequence[ZeroedLog]
    checked: Sequence[ZeroedLog]
    said: Sequence[str]

    @property
    def logs(self) -> list[Log]:
        """The recordings of the fit."""
        return [zeroed.log for zeroed in self.rested]


def ready(
    logs: Sequence[Log],
    actuator: Actuator | None,
    request: FitRequest,
    verify: Sequence[Log] = (),
    methods: Mapping[str, Method] = FIT_METHODS,
) -> Ready:
    """Recordings made ready for a fit, by its method.

    Raises
    ------
    DataError, ParameterError
        As `fit`.
    """
    request = request.completed()
    start = actuator or Actuator(model=AUTOMATIC if request.automatic else "isothermal")
    keeps_ambient = not request.automatic and "P_0" not in map(base_of, request.free)
    start, said = with_ambient(start, logs) if keeps_ambient and request.calibration is None else (start, ())
    usable, apart = (
        with_usable_samples(with_duty_cycles(several, start.equipment), start) for several in (logs, verify)
    )
    rested, checked = (
        [from_rest(log, request.counted_from, request.zero) for log in without_zeros(several)]
        for several in (usable, apart)
    )
    recordings, others = ([zeroed.log for zeroed in several] for several in (rested, checked))
    check_recordings(recordings, others, request.measure, start.parameters.y_max)
    return Ready(request, start, method_of(request, recordings, start, methods), usable, rested, checked, said)


def _with_rests(recordings: Mapping[str, Recording], rested: Sequence[ZeroedLog]) -> dict[str, Recording]:
    """Recordings at all their samples, each with the shift of its rest."""
    return {
        log.name: replace(on_samples(recordings[log.name], log), rest=shift, subtracted=subtracted)
        for log, shift, subtracted in rested
        if log.name in recordings
    }


def method_of(
    request: FitRequest, logs: Sequence[Log], actuator: Actuator, methods: Mapping[str, Method] = FIT_METHODS
) -> Method:
    """The method of a request: the requested one, else that of its calibration, else the simplest that supports it.

    With a calibration, recordings that lack changes of the duty cycles need 'prediction-error': there the process noise
    of the flow acts in every interval, in 'shooting' only between windows.

    Raises
    ------
    ParameterError
        If there is no such method, or it does not support the request.
    """
    needed = request.calibration.method if request.calibration else "shooting"
    if request.calibration and not request.checks and any(lacks_changes(log, actuator) for log in logs):
        needed = "prediction-error"
    name = request.method or (needed if request.has_priors else "simulation")
    if name not in methods:
        raise ParameterError(unknown_name(name, methods, "method"))
    method = methods[name]
    if request.checks and not method.check:
        raise ParameterError(f"profile and bootstrap need the method 'shooting', not '{name}'.")
    if request.partition is not None and method.partition:
        raise ParameterError(f"a partition needs the method 'simulation'; {method.partition}.")
    if request.has_priors and not method.priors:
        raise ParameterError(
            "'auto', priors, parameters of single recordings and a calibration need the method 'shooting' or "
            "'prediction-error'."
        )
    return method


def _one_by_one(
    recordings: Sequence[Log],
    start: Actuator,
    request: FitRequest,
    progress: Progress | None,
    methods: Mapping[str, Method],
) -> dict[str, Fit]:
    """The recordings read alone, by name, without those that cannot be."""
    readings = {}
    for left, log in zip(reversed(range(len(recordings))), recordings, strict=True):
        with suppress(DataError):  # too short to be read alone
            alone, shown = request.alone(log.name), within_stage(progress, "alone", more=left * MOST_TOGETHER)
            readings[log.name] = fit_request([log], start, alone, (), shown, methods)
    return {name: reading for name, reading in readings.items() if reading.status != "failed"}
