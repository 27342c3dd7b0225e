"""Evidence for the verdict on a fit: residuals through the sensor models, simulations over 1 s, missing excitation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clutchid.assess.diagnostics import Diagnosis, diagnose, fit_percent
from clutchid.assess.missing_excitation import missing
from clutchid.estimate.result import Fit, Recording
from clutchid.estimate.simulation_error.problem import build_problem
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.signals.excitation import excitation, joined
from clutchid.simulation import Partition
from clutchid.simulation.sensors import with_sensors
from clutchid.simulation.simulation import simulate

#: Horizon in s of the simulations that a verdict uses, and greatest number of them from the start of a recording.
HORIZON, MOST_HORIZONS = 1.0, 120


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Evidence for a verdict.

    `diagnoses` are those of the residuals of every fitted recording, `predictions` the fits in % of the position in
    simulations over `HORIZON` s, `missing` the missing excitation of the recordings.
    """

    diagnoses: Mapping[str, Diagnosis]
    predictions: Mapping[str, float]
    missing: tuple[str, ...]


def evidence(fit: Fit) -> Evidence:
    """Evidence for a verdict on `fit`; none if the fit failed."""
    diagnoses = {name: diagnosed(fit, name) for name in fit.recordings if has_position(fit.recordings[name])}
    if fit.status == "failed" or not diagnoses:
        return Evidence({}, {}, ())
    actuator, names = fit.actuator, tuple(name for name in fit.parameters if "@" not in name)
    moved = joined([excitation(fit.recordings[name].measured, actuator.parameters) for name in diagnoses])
    # with B-splines, which are local, and with priors, only the motion shows what is missing
    by_jacobian = actuator.load.basis == "paper" and not fit.follows
    sentences = (
        missing(moved, actuator, names, _rescaled(information(fit))) if by_jacobian else missing(moved, actuator)
    )
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
    every = max(1, round(HORIZON / float(np.median(np.diff(measured.time)))))
    part = measured.slice(0, min(len(measured), every * MOST_HORIZONS + 1))
    if not np.isfinite(part["position"]).any():
        return float("nan")
    done = simulate(actuator_of(fit, name), part, partition=Partition(every=every, carry="q"), on_failure="return")
    return fit_percent(part["position"], as_recorded(fit, name, done.log)["position"])


def information(fit: Fit) -> FloatArray | None:
    """Square root of the information matrix of the shared free parameters, in natural sizes.

    None if nothing is free. Parameters with infinite variance have no information.
    """
    at = [i for i, name in enumerate(fit.parameters) if "@" not in name]
    names = [name for name in fit.parameters if "@" not in name]
    known = [k for k, i in enumerate(at) if 0.0 < fit.covariance[i, i] < np.inf]
    if not known:
        return None
    unit = build_problem(fit.actuator, (), names, ("position",), dict.fromkeys(names, (-np.inf, np.inf))).unit[known]
    places = [at[k] for k in known]
    std, values, vectors = spectrum(fit.covariance[np.ix_(places, places)])
    root = np.zeros((len(names), len(names)))
    floor = np.finfo(float).eps * len(known) * values[-1]
    root[np.ix_(known, known)] = (vectors / np.sqrt(np.maximum(values, floor))).T / std * unit
    return root


def _rescaled(root: FloatArray | None) -> FloatArray | None:
    """`root` scaled so that every parameter with a finite variance counts as identifiable."""
    if root is None:
        return None
    norms = np.sqrt(np.sum(root**2, axis=0))
    result: FloatArray = root * (10.0 / np.min(norms[norms > 0.0]))
    return result


def reach(fit: Fit) -> float:
    """Largest measured position in m in the fitted recordings; NaN without one."""
    tops = [np.nanmax(r.measured["position"]) for r in fit.recordings.values() if has_position(r)]
    return float(max(tops)) if tops else float("nan")


def has_position(recording: Recording) -> bool:
    """Whether any sample of a recording has both a measured and a simulated position."""
    both = np.isfinite(recording.measured["position"]) & np.isfinite(recording.simulated["position"])
    return bool(both.any())


def spectrum(covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard errors, and eigenvalues (ascending) and eigenvectors of the correlation matrix."""
    std = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    return std, values, vectors
