"""`fit`: from recordings of an actuator to its load and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from clutchid.estimate.automatic import AUTOMATIC
from clutchid.estimate.methods import method_of
from clutchid.estimate.request import FitRequest
from clutchid.estimate.result import Fit
from clutchid.estimate.verification import verified
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import Progress
from clutchid.preparation.prepare import check_recordings, driven
from clutchid.simulation.partition import Partition
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Prior

MethodName = Literal["simulation", "shooting", "prediction-error"]


def fit(
    logs: Log | Sequence[Log],
    actuator: Actuator | None = None,
    *,
    measure: Sequence[str] = ("position",),
    free: Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: Sequence[Log] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    calibration: Calibration | None = None,
    profile: Sequence[str] = (),
    bootstrap: int = 0,
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Fit the free parameters of `actuator` to recordings.

    'simulation' is the paper's method, in two stages: the coarse one tries factors on the load and stops early; the
    fine one goes on from the best with the noise scales found. 'shooting' lets many short simulations meet softly; it
    knows priors, numbers of single recordings, and calibration. So does 'prediction-error', where a Kalman filter
    predicts every sample. All are bounded Levenberg-Marquardt searches on exact sensitivities. docs/methods.md helps to
    choose.

    Parameters
    ----------
    logs : Log or several
        Recordings with the duty cycles of the valves and the columns in `measure`; all share the free parameters.
    actuator : Actuator, optional
        Model and start values; by default the paper's Appendix A with theta = (9e5, 0, 0) N/m, and for 'auto' the
        energy balance with Stribeck friction and a load on B-splines.
    measure : 'position', 'pressure_a'
        Measured columns to compare with.
    free : names
        Free parameters; 'load' stands for all load weights, NAME@EACH for an own number of every recording, 'auto' for
        all that a recording with pressure may tell. Empty: only unknown starts are estimated.
    bounds : {name: (low, high)}, optional
        In SI. By default theta_1 and theta_3 are at least 0, theta_2 is free (it changes sign on a worn clutch), and
        every other parameter stays within a factor of three of its start, or in its range where that is finite.
    partition : Partition, optional
        Partitioned ballistic simulation; ballistic without.
    verify : logs
        Recordings that are simulated with the result, not fitted.
    method : 'simulation', 'shooting' or 'prediction-error', optional
        By default the calibration's; without one shooting where 'auto', priors or numbers of single recordings ask for
        it, else simulation.
    priors : {name: Prior}, optional
        What is known before the data, in SI; by default `clutchid.uncertainty.coordinates` says.
    calibration : Calibration, optional
        ``fit.calibration`` of a fit with pressure, by the same method, whose actuator this one is.
    profile : names
        Free numbers whose intervals come from profile likelihood; shooting only, seconds each.
    bootstrap : int
        Draws of a bootstrap over strokes that checks the bands of the load; shooting only, 0 for none.
    on_failure : 'raise' or 'return'
        What to do when the start values cannot be simulated.
    progress : function(stage, evaluations), optional
        Called at each evaluation.

    Returns
    -------
    fit : Fit

    Raises
    ------
    DataError
        If a recording lacks a column, has fewer samples than there are free numbers, or nothing can be fitted.
    ParameterError
        For an unknown name, or bounds that cross or are not admissible.
    SolveError
        If the start values cannot be simulated and `on_failure` is 'raise'.

    References
    ----------
    Section 3.1; rules for missing samples, starts and resets: docs/formats.md.
    """
    request = FitRequest(
        tuple(measure),
        tuple(free),
        bounds or {},
        partition,
        method,
        priors or {},
        calibration,
        tuple(profile),
        bootstrap,
    )
    done = fit_request([logs] if isinstance(logs, Log) else logs, actuator, request, verify, progress)
    return done.raised() if on_failure == "raise" else done


def fit_request(
    logs: Sequence[Log],
    actuator: Actuator | None,
    request: FitRequest,
    verify: Sequence[Log] = (),
    progress: Progress | None = None,
) -> Fit:
    """Fit what `request` asks for to recordings, and simulate the recordings `verify` with the result.

    Start values that cannot be simulated give a fit of status "failed".

    Raises
    ------
    DataError, ParameterError
        As `fit`.
    """
    method = method_of(request)
    start = actuator or Actuator(model=AUTOMATIC if request.automatic else "isothermal")
    recordings, others = driven(logs, start.equipment), driven(verify, start.equipment)
    check_recordings(recordings, others, request.measure, start.parameters.y_max)
    done = method.fit(recordings, start, request, progress)
    return done if done.status == "failed" else verified(done, others, request)
