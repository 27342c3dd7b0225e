"""`calibrate` and `estimate`: the two fits of every day, once with pressure, and then from position alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Literal

from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.fit import LogOrPath, MethodName, fit, fit_any
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, started
from clutchid.estimation.parameter_file import parameter_file as with_trust
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.model.actuator import Actuator
from clutchid.names import listed_names
from clutchid.numerics.least_squares import Progress
from clutchid.recordings.strokes.vented_rest import Zero
from clutchid.simulation.partition import Partition


def calibrate(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None = None,
    *,
    measure: str | Sequence[str] = ("position", "pressure_a"),
    free: str | Sequence[str] = ("auto",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    profile: str | Sequence[str] = (),
    bootstrap: int = 0,
    zero: Zero = "subtract",
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
        Measured columns to compare with; a calibration needs the pressure among them.
    free : names
        Free parameters; 'auto' means all that recordings with pressure can determine.
    bounds, partition, verify, method, priors, profile, bootstrap, zero, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        `clutchid.estimate` starts from it, also from a file: ``write_parameters(parameter_file(fit), path)``.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.
    """
    return fit(
        logs,
        actuator,
        measure=measure,
        free=free,
        bounds=bounds,
        partition=partition,
        verify=verify,
        method=method,
        priors=priors,
        profile=profile,
        bootstrap=bootstrap,
        zero=zero,
        on_failure=on_failure,
        progress=progress,
    )


def estimate(
    logs: LogOrPath | Sequence[LogOrPath],
    start: Fit | ParameterFile | str | PathLike[str],
    *,
    measure: str | Sequence[str] = ("position",),
    free: str | Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    profile: str | Sequence[str] = (),
    bootstrap: int = 0,
    zero: Zero = "subtract",
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
    measure : 'position', 'pressure_a'
        Measured columns to compare with.
    free : names
        Free parameters; 'load' means all load weights.
    bounds, partition, verify, method, priors, profile, bootstrap, zero, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        ``fit.comparison`` has the load against that of the calibration, ``fit.changes`` what else has changed.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`; also if the file of the calibration cannot be read.
    """
    request = FitRequest(
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
    content = _content(start)
    return fit_any(logs, content.actuator, started(content, request), verify, on_failure, progress)


def _content(start: Fit | ParameterFile | str | PathLike[str]) -> ParameterFile:
    """The parameters and the calibration to start from."""
    if isinstance(start, ParameterFile):
        return start
    return parameter_file(start) if isinstance(start, Fit) else read_parameters(start)


def parameter_file(fit: Fit) -> ParameterFile:
    """Contents of a parameter file for a fit, with the trust of its verdict."""
    return with_trust(fit, verdict(fit).trust)
