"""`fit`: load and parameters of an actuator from recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from types import MappingProxyType
from typing import Literal

from clutchid.arguments import checked
from clutchid.errors import DataError, ParameterError
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.method import Method
from clutchid.estimation.prediction_error import PREDICTION_ERROR
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.estimation.shooting import SHOOTING
from clutchid.estimation.simulation_error import SIMULATION
from clutchid.estimation.verification import on_samples, verified, with_rests
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import base_of, listed_names, unknown_name
from clutchid.numerics.progress import Progress, report, within
from clutchid.parameters import known_ambient
from clutchid.preparation.prepare import check_recordings, driven, usable
from clutchid.preparation.pulses import lacks_changes
from clutchid.simulation.inputs import with_inputs
from clutchid.simulation.partition import Partition
from clutchid.strokes.vented_pressure import with_ambient
from clutchid.strokes.vented_rest import Zero, from_rest

MethodName = Literal["simulation", "shooting", "prediction-error"]

#: Methods by name.
METHODS: Mapping[str, Method] = MappingProxyType({one.name: one for one in (SIMULATION, SHOOTING, PREDICTION_ERROR)})

#: A recording, or the path of its file.
LogOrPath = Log | str | PathLike[str]


@checked
def fit(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None = None,
    *,
    measure: str | Sequence[str] = ("position",),
    free: str | Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    calibration: Calibration | None = None,
    profile: str | Sequence[str] = (),
    bootstrap: int = 0,
    zero: Zero = "subtract",
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Fit the free parameters of `actuator` to recordings.

    'simulation' is the paper's method, in two stages: the coarse stage tries factors on the load and stops early; the
    fine stage continues from the best with estimated noise scales. 'shooting' is multiple shooting with soft continuity
    constraints; it supports priors, parameters of single recordings, and calibrations. So does 'prediction-error', with
    a Kalman filter that predicts every sample. All are bounded Gauss-Newton or Levenberg-Marquardt searches with exact
    sensitivities. docs/methods.md compares them.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with the duty cycles of the valves and the columns in `measure`; all share the free parameters. Files
        are read as by `clutchid.read`, with the actuator's P_0 added to gauge pressures.
    actuator : Actuator, optional
        Model and start values; by default the paper's Appendix A with theta = (9e5, 0, 0) N/m, and for 'auto' the
        energy balance with Stribeck friction and a load on B-splines.
    measure : 'position', 'pressure_a'
        Measured columns to compare with. These and other names may be one text with commas.
    free : names
        Free parameters; 'load' means all load weights, NAME@EACH a parameter of its own for every recording, 'auto' all
        parameters that a recording with pressure can determine. Empty: only unknown start values are estimated.
    bounds : {name: (low, high)}, optional
        In SI. By default theta_1 and theta_3 are at least 0, theta_2 is free (it changes sign on a worn clutch), every
        other magnitude stays within a factor of three of its start, and fractions and shapes within their range.
    partition : Partition, optional
        Partitioned ballistic simulation; ballistic by default.
    verify : Log or path, or several
        Recordings that are simulated with the result, but not fitted.
    method : 'simulation', 'shooting' or 'prediction-error', optional
        By default that of the calibration, or 'prediction-error' if duty cycles change between the samples; without a
        calibration 'shooting' if 'auto', priors or parameters of single recordings need it, else 'simulation'.
    priors : {name: Prior}, optional
        Priors in SI; defaults in `clutchid.inference.uncertainty.coordinates`.
    calibration : Calibration, optional
        ``fit.calibration`` of a fit with pressure, by the same method, for this actuator.
    profile : names
        Free parameters with intervals by profile likelihood; 'shooting' only, seconds each.
    bootstrap : int
        Draws of a bootstrap over strokes, which checks the intervals of the load; 'shooting' only, 0 for none.
    zero : 'subtract' or 'keep'
        Whether the position counts from the vented rest where that has moved since the calibration, as after an
        exchange of the sensor or with wear; or as it was recorded.
    on_failure : 'raise' or 'return'
        What to do if the start values cannot be simulated.
    progress : function(step), optional
        Called with a `clutchid.numerics.progress.Step` when a stage begins, and at each evaluation.

    Returns
    -------
    fit : Fit

    Raises
    ------
    DataError
        If a recording lacks a column, has fewer samples than free parameters, or nothing can be fitted.
    ParameterError
        For an unknown name, or bounds that cross or are not admissible.
    SolveError
        If the start values cannot be simulated and `on_failure` is 'raise'.

    References
    ----------
    Section 3.1; rules for missing samples, starts and resets: docs/formats.md.

    Examples
    --------
    The piston of the bundled truck follows its simulation to 0.7 mm over 10 s, from the paper's start values:

    >>> import clutchid
    >>> found = clutchid.fit(clutchid.bundled_recording().slice(0, 10_000), free="load")
    >>> f"{found.parameters['theta_1'].value:.2g} N/m, {found.errors.position_rms * 1e3:.1f} mm"
    '8.2e+05 N/m, 0.7 mm'
    """
    request = request_of(measure, free, bounds, partition, method, priors, profile, bootstrap, zero)
    return fit_any(logs, actuator, replace(request, calibration=calibration), verify, on_failure, progress)


def request_of(
    measure: str | Sequence[str],
    free: str | Sequence[str],
    bounds: Mapping[str, tuple[float, float]] | None,
    partition: Partition | None,
    method: MethodName | None,
    priors: Mapping[str, Prior] | None,
    profile: str | Sequence[str],
    bootstrap: int,
    zero: Zero,
) -> FitRequest:
    """The request of a fit with these arguments of `fit`."""
    return FitRequest(
        listed_names(measure),
        listed_names(free),
        bounds or {},
        partition,
        method,
        priors or {},
        profile=listed_names(profile),
        bootstrap=bootstrap,
        zero=zero,
    )


def fit_any(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None,
    request: FitRequest,
    verify: LogOrPath | Sequence[LogOrPath],
    on_failure: Literal["raise", "return"],
    progress: Progress | None,
) -> Fit:
    """Fit `request` to recordings, of which paths are read; the arguments are those of `fit`.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `fit`.
    """
    fitted, others = _several(logs), _several(verify)
    recordings = recordings_of([*fitted, *others], actuator or Actuator())
    done = fit_request(recordings[: len(fitted)], actuator, request, recordings[len(fitted) :], progress)
    return done.raised() if on_failure == "raise" else done


def _several(logs: LogOrPath | Sequence[LogOrPath]) -> list[LogOrPath]:
    return [*logs] if isinstance(logs, Iterable) and not isinstance(logs, str) else [logs]


def recordings_of(logs: Sequence[LogOrPath], actuator: Actuator) -> list[Log]:
    """The logs, with those read that are given as paths; a `DataError` lists the problems of all files."""
    from clutchid.measurements import read, read_each

    added, required = known_ambient(actuator.parameters.P_0), ("time", "position", *actuator.equipment.recorded)
    return read_each(logs, lambda log: log if isinstance(log, Log) else read(log, added=added, required=required))


def fit_request(
    logs: Sequence[Log],
    actuator: Actuator | None,
    request: FitRequest,
    verify: Sequence[Log] = (),
    progress: Progress | None = None,
    methods: Mapping[str, Method] = METHODS,
) -> Fit:
    """Fit `request` to recordings by one of `methods`, and simulate the recordings `verify` with the result.

    Several recordings whose load is read from a calibration are also read one by one, because a load that they share is
    meant for one state of wear. Status "failed" if the start values cannot be simulated.

    Raises
    ------
    DataError, ParameterError
        As `fit`.
    """
    start = actuator or Actuator(model=AUTOMATIC if request.automatic else "isothermal")
    keeps_ambient = not request.automatic and "P_0" not in map(base_of, request.free)
    start, said = with_ambient(start, logs) if keeps_ambient and request.calibration is None else (start, ())
    ready, apart = (usable(driven(several, start.equipment), start) for several in (logs, verify))
    rested, checked = (
        [from_rest(log, request.counted_from, request.zero) for log in several] for several in (ready, apart)
    )
    recordings, others = [one.log for one in rested], [one.log for one in checked]
    check_recordings(recordings, others, request.measure, start.parameters.y_max)
    method = method_of(request, recordings, start, methods)
    done = fit_with(method, [with_inputs(log) for log in recordings], start, request, progress)
    if done.status == "failed":
        return done
    known = done.baseline is not None and len(done.baseline.theta) > 0 and done.load_is_fitted
    readings = _one_by_one(ready, start, request, progress, methods) if len(recordings) > 1 and known else {}
    report(progress, "verification")
    whole = {log.name: on_samples(done.recordings[log.name], log) for log in recordings}
    return with_rests(
        verified(replace(done, recordings=whole, readings=readings, notes=(*done.notes, *said)), others, request),
        [*rested, *checked],
    )


def method_of(
    request: FitRequest, logs: Sequence[Log], actuator: Actuator, methods: Mapping[str, Method] = METHODS
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
    for log in recordings:
        with suppress(DataError):  # too short to be read alone
            alone = request.alone(log.name)
            readings[log.name] = fit_request([log], start, alone, (), within(progress, "alone"), methods)
    return {name: one for name, one in readings.items() if one.status != "failed"}
