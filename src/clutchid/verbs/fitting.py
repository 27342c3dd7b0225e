"""`fit`, `calibrate` and `estimate`: load and parameters of an actuator from recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Literal

from clutchid.arguments import checked
from clutchid.estimation.fit import MethodName, fit_request
from clutchid.estimation.fit_problem import FitProblem, problem_of_request
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.inference.filter.filtering import compile_filter_beside
from clutchid.model.actuator import Actuator
from clutchid.numerics.progress import Progress
from clutchid.numerics.progress import report_stage as reported
from clutchid.strokes.vented_rest import Zero
from clutchid.verbs.options import requested
from clutchid.verbs.reading import LogOrPath, Reading, inspected, reading_of
from clutchid.verbs.start import CalibrationSource, FitStart, start_of

if TYPE_CHECKING:
    from clutchid.log import Log
    from clutchid.measurements.map.channel_map import ChannelMap


@checked
def fit(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None = None,
    request: FitRequest | None = None,
    *,
    free: str | Sequence[str] | None = None,
    measure: str | Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: MethodName | None = None,
    zero: Zero | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    force: bool = False,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
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
        Recordings with the duty cycles of the valves and the columns in `measure`; all share the free parameters.
    actuator : Actuator, optional
        Model and start values; by default the paper's Appendix A with theta = (9e5, 0, 0) N/m, and for 'auto' the
        energy balance with Stribeck friction and a load on B-splines.
    request : FitRequest, optional
        All options of a fit, of which the next five may be given by name too.
    free : names
        Free parameters; 'load' (the default) means all load weights, 'auto' all that recordings with pressure
        determine.
    measure : 'position', 'pressure_a'
        Measured columns to compare with; the position by default.
    bounds, method, zero
        As in `clutchid.FitRequest`.
    verify : Log or path, or several
        Recordings that are simulated with the result, but not fitted.
    force : bool
        Go on although a check of a recording is bad; the checks are those of `clutchid look`.
    ambient : Pa, optional
        Ambient pressure: a calibration takes it for that of the vented chamber, and gauge pressures of files count
        from it; for these by default a measured P_0 of the actuator, else 101,300 Pa.
    channels, dbc
        Channel map, and DBC files of bus logs, as in `clutchid.read`.
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
        If a recording cannot be read or lacks a column, a check of it is bad, it has fewer samples than free
        parameters, or nothing can be fitted.
    ParameterError
        For an unknown name, bounds that cross or are not admissible, or an option that contradicts the request.
    SolveError
        If the start values cannot be simulated and `on_failure` is 'raise'.

    References
    ----------
    Section 3.1; rules for missing samples, starts and resets: docs/formats.md.

    Examples
    --------
    The piston of the bundled truck follows its simulation to 0.7 mm over 10 s, from the paper's start values:

    >>> import clutchid
    >>> fit = clutchid.fit(clutchid.bundled_recording().slice(0, 10_000), free="load")
    >>> f"{fit.parameters['theta_1'].value:.2g} N/m, {fit.errors.position_rms * 1e3:.1f} mm"
    '8.2e+05 N/m, 0.7 mm'
    """
    asked = requested("fit", request, free=free, measure=measure, bounds=bounds, method=method, zero=zero)
    reading = reading_of(logs, verify, ambient=ambient, channels=channels, dbc=dbc, force=force)
    return _ended(fitted(reading, actuator, asked, progress), on_failure)


@checked
def calibrate(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None = None,
    request: FitRequest | None = None,
    *,
    free: str | Sequence[str] | None = None,
    measure: str | Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: MethodName | None = None,
    zero: Zero | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    force: bool = False,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Calibrate an actuator from recordings with pressure: its load, and all that they can determine beside it.

    It is `clutchid.fit` with other defaults of `measure` and `free`.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with position, duty cycles and `pressure_a`, all of one state of wear.
    actuator : Actuator, optional
        Model and start values; by default the energy balance with Stribeck friction, Appendix A, and a load on
        B-splines.
    measure : 'position', 'pressure_a'
        Measured columns to compare with, both by default; a calibration needs the pressure among them.
    free : names
        Free parameters; by default 'auto', all that recordings with pressure can determine.
    request, bounds, method, zero, verify, force, ambient, channels, dbc, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        `clutchid.estimate` starts from it, also from a file: ``write_parameters(parameter_file(fit), path)``.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.

    Examples
    --------
    4 s of driving give the supply pressure to better than 1.5 bar, and a load that may be trusted:

    >>> import clutchid
    >>> cal = clutchid.calibrate(clutchid.bundled_recording().slice(0, 4000))
    >>> cal.verdict.trust, bool(8e5 < cal.parameters["P_S"].value < 10e5), bool(cal.parameters["P_S"].std < 0.75e5)
    ('good', True, True)
    """
    asked = requested("calibrate", request, free=free, measure=measure, bounds=bounds, method=method, zero=zero)
    reading = reading_of(logs, verify, ambient=ambient, channels=channels, dbc=dbc, force=force)
    return _ended(fitted(reading, actuator, asked, progress), on_failure)


@checked
def estimate(
    logs: LogOrPath | Sequence[LogOrPath],
    start: CalibrationSource,
    request: FitRequest | None = None,
    *,
    free: str | Sequence[str] | None = None,
    measure: str | Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: MethodName | None = None,
    zero: Zero | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    force: bool = False,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Estimate the load of a clutch from position alone, and what has changed since its calibration.

    It is `clutchid.fit` from a calibration.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with position and duty cycles, all of one state of wear.
    start : Fit, ParameterFile or path
        The calibration: the result of `clutchid.calibrate`, or a file with it.
    request, free, measure, bounds, method, zero, verify, force, ambient, channels, dbc, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        ``fit.comparison`` has the load against that of the calibration, ``fit.changes`` what else has changed.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`; also if the file of the calibration cannot be read.

    Examples
    --------
    The supply pressure from 4 s with pressure, then the load from the position of the next 4 s alone:

    >>> import clutchid
    >>> log = clutchid.bundled_recording()
    >>> cal = clutchid.calibrate(log.slice(0, 4000), free="load,P_S")
    >>> later = clutchid.estimate(log.slice(4000, 8000).without("pressure_a"), cal)
    >>> f"{later.load_curve.force.max() / 1e3:.0f} kN"
    '4 kN'
    """
    asked = requested("estimate", request, free=free, measure=measure, bounds=bounds, method=method, zero=zero)
    reading = reading_of(logs, verify, ambient=ambient, channels=channels, dbc=dbc, force=force)
    return _ended(fitted(reading, start, asked, progress), on_failure)


@checked
def problem(
    logs: LogOrPath | Sequence[LogOrPath],
    start: CalibrationSource | Actuator | None = None,
    request: FitRequest | None = None,
    *,
    free: str | Sequence[str] | None = None,
    measure: str | Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    method: MethodName | None = None,
    zero: Zero | None = None,
    force: bool = False,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> FitProblem:
    """The least-squares problem of a request, not fitted, for other tools; that of a fit is ``fit.problem``.

    Parameters
    ----------
    logs : Log or path, or several
        As in `clutchid.fit`.
    start : Actuator, Fit, ParameterFile or path, optional
        Model and start values, or a calibration: then the problem is that of a load from position alone if nothing has
        changed but by drift.
    request, free, measure, bounds, method, zero, force, ambient, channels, dbc
        As in `clutchid.fit`.

    Returns
    -------
    problem : FitProblem
        At the start values.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.

    Examples
    --------
    The load of the bundled truck 10 % larger than that of Appendix A, as the residuals of 10,000 samples:

    >>> import clutchid
    >>> problem = clutchid.problem(clutchid.bundled_recording().slice(0, 10_000), free="theta_1")
    >>> problem.residuals(1.1 * problem.x).size
    10000
    """
    asked = requested("fit", request, free=free, measure=measure, bounds=bounds, method=method, zero=zero)
    reading = reading_of(logs, (), ambient=ambient, channels=channels, dbc=dbc, force=force)
    return problem_of_request(*_recordings(reading, start, asked))


def fitted(
    reading: Reading,
    start: FitStart,
    request: FitRequest,
    progress: Progress | None = None,
    before_checks: Callable[[Fit], None] = lambda _: None,
) -> Fit:
    """Read and check recordings, and fit them as requested; a search that failed is a status.

    `before_checks` gets the result before profile likelihood and bootstrap begin.

    Raises
    ------
    DataError, ParameterError
        As `fit`.
    """
    logs, actuator, request = _recordings(reading, start, request, progress)
    count = len(reading.logs)
    return fit_request(logs[:count], actuator, request, logs[count:], progress, before_checks=before_checks)


def _recordings(
    reading: Reading, start: FitStart, request: FitRequest, progress: Progress | None = None
) -> tuple[list[Log], Actuator, FitRequest]:
    """Recordings read and checked, those of the verification last, with the actuator and the request to start from."""
    actuator, request = start_of(start, request.completed())
    if request.has_priors:
        compile_filter_beside()
    reported(progress, "reading")
    logs = reading.read(actuator, request.measure)
    reported(progress, "checks")
    return inspected(logs, actuator, request.counted_from, request.zero, force=reading.force), actuator, request


def _ended(fit: Fit, on_failure: Literal["raise", "return"]) -> Fit:
    return fit.raised() if on_failure == "raise" else fit
