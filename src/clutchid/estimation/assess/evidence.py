"""Evidence for the verdict on a fit: residuals through the sensors, simulations over 1 s, excitation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from clutchid.estimation.assess.diagnostics import ColumnDiagnosis, Diagnosis, diagnose, fit_percent
from clutchid.estimation.assess.missing_excitation import missing_excitation
from clutchid.estimation.result import Fit, Recording
from clutchid.inference.uncertainty.gaussian import Information, natural_sizes
from clutchid.log import Log, sample_interval
from clutchid.model.actuator import Actuator
from clutchid.simulation import Partition
from clutchid.simulation.sensors import with_sensors
from clutchid.simulation.simulation import simulate
from clutchid.strokes.excitation import excitation, joint_excitation


class Reason(NamedTuple):
    """A sentence for the user; a `grave` one means trust "none", a `banded` one only says how wide the interval is."""

    text: str
    grave: bool = False
    banded: bool = False


Value = TypeVar("Value")


def once_a_fit(function: Callable[[Fit], Value]) -> Callable[[Fit], Value]:
    """The function with a cache of its results for as long as there is the fit."""
    results: WeakKeyDictionary[Fit, Value] = WeakKeyDictionary()

    @wraps(function)
    def remembered(fit: Fit) -> Value:
        if fit not in results:
            results[fit] = function(fit)
        return results[fit]

    return remembered


#: Horizon in s of the simulations that a verdict uses, and greatest number of them from the start of a recording.
HORIZON, _MOST_HORIZONS = 1.0, 120


class Criteria(NamedTuple):
    r"""Information criteria of a fit, smaller for the better model of the same samples.

    .. math:: \mathrm{AIC} = \sum_c n_c \ln \sigma_c^2 + 2 k, \quad \mathrm{BIC} = \sum_c n_c \ln \sigma_c^2 + k \ln n

    Attributes
    ----------
    aic, bic
        With the rms residual of each column in SI for its σ, and the k free parameters.
    independent
        Sum n of the independent residuals n_c: correlated ones count as fewer. Two fits are compared with the same
        numbers, those of the one that has fewer.

    References
    ----------
    Akaike 1974, Schwarz 1978; number of independent residuals: as in the diagnosis of residuals.
    """

    aic: float
    bic: float
    independent: float


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Evidence for a verdict.

    `diagnoses` are those of the residuals of every fitted recording, `predictions` the fits in % of the position in
    simulations over `HORIZON` s, `missing` the missing excitation of the recordings.
    """

    diagnoses: Mapping[str, Diagnosis]
    predictions: Mapping[str, float]
    missing: tuple[str, ...]

    def criteria(self, parameters: int, like: Evidence | None = None) -> Criteria:
        """Information criteria with a number of free parameters, and the independent residuals of another fit."""
        counts = {place: column.effective_samples for place, column in (like or self)._columns().items()}
        columns = self._columns()
        losses = sum(2.0 * counts[place] * np.log(column.rms) for place, column in columns.items())
        n = float(sum(counts[place] for place in columns))
        return Criteria(float(losses + 2 * parameters), float(losses + parameters * np.log(max(n, 1.0))), n)

    def _columns(self) -> dict[tuple[str, str], ColumnDiagnosis]:
        """The diagnosed columns by recording and name."""
        return {(key, name): c for key, diagnosis in self.diagnoses.items() for name, c in diagnosis.columns.items()}


@once_a_fit
def evidence(fit: Fit) -> Evidence:
    """Evidence for a verdict on `fit`; none if the fit failed."""
    diagnoses = {name: diagnosed(fit, name) for name in fit.recordings if has_position(fit.recordings[name])}
    if fit.status == "failed" or not diagnoses:
        return Evidence({}, {}, ())
    actuator = fit.actuator
    moved = joint_excitation([excitation(fit.recordings[name].measured, actuator.parameters) for name in diagnoses])
    sentences = missing_excitation(moved, actuator)
    return Evidence(diagnoses, {name: predicted_fit(fit, name) for name in diagnoses}, tuple(sentences))


def actuator_of(fit: Fit, name: str) -> Actuator:
    """The fitted actuator with the parameters of the recording `name`."""
    own = {key.partition("@")[0]: e.value for key, e in fit.parameters.items() if key.endswith(f"@{name}")}
    return fit.actuator.replace(own) if own else fit.actuator


def as_recorded(fit: Fit, name: str, simulated: Log) -> Log:
    """A simulation as the sensors would record it, unless the fit has no sensor models, as in the paper."""
    if not fit.follows:
        return simulated
    return with_sensors(simulated, actuator_of(fit, name).parameters)


def diagnosed(fit: Fit, name: str) -> Diagnosis:
    """Diagnosis of the residuals of the fitted recording `name`.

    Raises
    ------
    DataError
        If no position can be compared.
    """
    recording = fit.recordings[name]
    return diagnose(recording.measured, as_recorded(fit, name, recording.simulated))


def predicted_fit(fit: Fit, name: str) -> float:
    """Fit in % of the position of the recording `name` in simulations over `HORIZON` s; NaN if there is no position.

    Each simulation starts at the measured position; the masses of air are continuous.
    """
    measured = fit.recordings[name].measured
    every = max(1, round(HORIZON / sample_interval(measured.time)))
    part = measured.slice(0, min(len(measured), every * _MOST_HORIZONS + 1))
    if not np.isfinite(part["position"]).any():
        return float("nan")
    simulation = simulate(
        actuator_of(fit, name), part, partition=Partition(every=every, carry="q"), force=True, on_failure="return"
    )
    return fit_percent(part["position"], as_recorded(fit, name, simulation.log)["position"])


def shared_information(fit: Fit) -> Information | None:
    """Information about the shared free parameters; None if there is none."""
    names = [name for name in fit.parameters if "@" not in name]
    at = [i for i, name in enumerate(fit.parameters) if "@" not in name]
    shared = Information.of_covariance(names, fit.covariance[np.ix_(at, at)], natural_sizes(fit.actuator, names))
    return shared if shared.determined else None


def reach(fit: Fit) -> float:
    """Largest measured position in m in the fitted recordings; NaN without one."""
    tops = [np.nanmax(r.measured["position"]) for r in fit.recordings.values() if has_position(r)]
    return float(max(tops)) if tops else float("nan")


def has_position(recording: Recording) -> bool:
    """Whether any sample of a recording has both a measured and a simulated position."""
    both = np.isfinite(recording.measured["position"]) & np.isfinite(recording.simulated["position"])
    return bool(both.any())
