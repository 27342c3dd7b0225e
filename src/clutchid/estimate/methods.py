"""The methods of fitting, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

from clutchid.errors import ParameterError
from clutchid.estimate.calibrate import fit_with_priors
from clutchid.estimate.prediction_error.fit import PREDICTION_ERROR
from clutchid.estimate.request import FitRequest
from clutchid.estimate.result import Fit
from clutchid.estimate.shooting.fit import SHOOTING
from clutchid.estimate.simulation_error.fit import fit_simulation_error
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import Progress
from clutchid.parameters import unknown_name


@dataclass(frozen=True, slots=True)
class Method:
    """A way to fit: the function, and what it can be asked for.

    `priors`: priors, own values of single recordings, 'auto' and calibrations; `checks`: profile likelihood and
    bootstrap; `partition` is empty where the method takes a partition, else why it does not.
    """

    fit: Callable[[Sequence[Log], Actuator, FitRequest, Progress | None], Fit]
    priors: bool
    checks: bool
    partition: str = ""


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "simulation": Method(fit_simulation_error, priors=False, checks=False),
        "shooting": Method(
            partial(fit_with_priors, SHOOTING), priors=True, checks=True, partition="shooting has windows of its own"
        ),
        "prediction-error": Method(
            partial(fit_with_priors, PREDICTION_ERROR),
            priors=True,
            checks=False,
            partition="a filter goes on from sample to sample",
        ),
    }
)


def method_of(request: FitRequest) -> Method:
    """The method of a request: what it names, else that of its calibration, or the simplest that can do it.

    Raises
    ------
    ParameterError
        If there is no such method, or it cannot do what is asked for.
    """
    needed = request.calibration.method if request.calibration else "shooting"
    name = request.method or (needed if request.has_priors else "simulation")
    if name not in METHODS:
        raise ParameterError(unknown_name(name, METHODS, "method"))
    method = METHODS[name]
    if request.checks and not method.checks:
        raise ParameterError(f"a profile and a bootstrap belong to the method 'shooting', not to '{name}'.")
    if request.partition is not None and method.partition:
        raise ParameterError(f"a partition belongs to the method 'simulation'; {method.partition}.")
    if request.has_priors and not method.priors:
        raise ParameterError(
            "'auto', priors, own values of single recordings and a calibration need the method 'shooting' or "
            "'prediction-error'."
        )
    return method
