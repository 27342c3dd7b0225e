"""Methods of estimation by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from clutchid.errors import ParameterError
from clutchid.estimation.calibrate import fit_with_priors
from clutchid.estimation.prediction_error.fit import PREDICTION_ERROR
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.estimation.shooting.fit import SHOOTING
from clutchid.estimation.simulation_error.fit import fit_simulation_error
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.numerics.least_squares import Progress
from clutchid.preparation.pulses import lacks_changes


@dataclass(frozen=True, slots=True)
class Method:
    """A method: its function, and the requests that it supports.

    `priors`: priors, parameters of single recordings, 'auto' and calibrations; `checks`: profile likelihood and
    bootstrap; `partition` is empty if the method supports a partition, else the reason why not.
    """

    fit: Callable[[Sequence[Log], Actuator, FitRequest, Progress | None], Fit]
    priors: bool
    checks: bool
    partition: str = ""


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "simulation": Method(fit_simulation_error, priors=False, checks=False),
        "shooting": Method(
            partial(fit_with_priors, SHOOTING),
            priors=True,
            checks=True,
            partition="multiple shooting uses its own windows",
        ),
        "prediction-error": Method(
            partial(fit_with_priors, PREDICTION_ERROR),
            priors=True,
            checks=False,
            partition="a Kalman filter is corrected at every sample",
        ),
    }
)


def method_of(request: FitRequest, logs: Sequence[Log], actuator: Actuator) -> Method:
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
    if name not in METHODS:
        raise ParameterError(unknown_name(name, METHODS, "method"))
    method = METHODS[name]
    if request.checks and not method.checks:
        raise ParameterError(f"profile and bootstrap need the method 'shooting', not '{name}'.")
    if request.partition is not None and method.partition:
        raise ParameterError(f"a partition needs the method 'simulation'; {method.partition}.")
    if request.has_priors and not method.priors:
        raise ParameterError(
            "'auto', priors, parameters of single recordings and a calibration need the method 'shooting' or "
            "'prediction-error'."
        )
    return method
