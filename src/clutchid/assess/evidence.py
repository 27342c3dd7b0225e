"""What a verdict on a fit rests on: residuals as sensors see them, simulations over a second, what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clutchid.assess.diagnostics import Diagnosis, diagnose, fit_percent
from clutchid.assess.missing_excitation import missing
from clutchid.estimate.result import Fit, Recording
from clutchid.estimate.simulation_error.problem import problem
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.signals.excitation import excitation, joined
from clutchid.simulation import Partition
from clutchid.simulation.sensors import sensed
from clutchid.simulation.simulation import simulate

#: A simulation is judged over this time in s, on at most so many of them from the start of the recording.
HORIZON, MOST_HORIZONS = 1.0, 120


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What a verdict rests on.

    `diagnoses` are of the residuals of every fitted recording, `predictions` the fit in % of its position when it is
    simulated for `HORIZON` s at a time, `missing` what the recordings lack.
    """

    diagnoses: Mapping[str, Diagnosis]
    predictions: Mapping[str, float]
    missing: tuple[str, ...]


def evidence(fit: Fit) -> Evidence:
    """What a verdict on `fit` rests on; nothing where the fit failed."""
    diagnoses = {name: diagnosed(fit, name) for name in fit.recordings if has_position(fit.recordings[name])}
    if fit.status == "failed" or not diagnoses:
        return Evidence({}, {}, ())
    actuator, names = fit.actuator, tuple(name for name in fit.parameters if "@" not in name)
    moved = joined([excitation(fit.recordings[name].measured, actuator.parameters) for name in diagnoses])
    # a B-spline acts near its knots only, and a prior keeps what is not told: there the motion says what is missing
    told = actuator.load.basis == "paper" and not fit.follows
    lacking = missing(moved, actuator, names, _as_heard(information(fit))) if told else missing(moved, actuator)
    return Evidence(diagnoses, {name: predicted_fit(fit, name) for name in diagnoses}, tuple(lacking))


def actuator_of(fit: Fit, name: str) -> Actuator:
    """The fitted actuator with the numbers that the recording `name` has of its own."""
    own = {key.partition("@")[0]: e.value for key, e in fit.parameters.items() if key.endswith(f"@{name}")}
    return fit.actuator.replace(own) if own else fit.actuator


def as_recorded(fit: Fit, name: str, simulated: Log) -> Log:
    """A simulation as the sensors would record it, unless the fit was the paper's, which has no sensors."""
    if not fit.follows:
        return simulated
    return sensed(simulated, actuator_of(fit, name).parameters)


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
    """Fit in % of the position of the recording `name`, simulated for `HORIZON` s at a time; NaN where it cannot be.

    At each start the position is taken from the measurement and the masses of air go on.
    """
    measured = fit.recordings[name].measured
    every = max(1, round(HORIZON / float(np.median(np.diff(measured.time)))))
    part = measured.slice(0, min(len(measured), every * MOST_HORIZONS + 1))
    if not np.isfinite(part["position"]).any():
        return float("nan")
    done = simulate(actuator_of(fit, name), part, partition=Partition(every=every, carry="q"), on_failure="return")
    return fit_percent(part["position"], as_recorded(fit, name, done.log)["position"])


def information(fit: Fit) -> FloatArray | None:
    """Root of the information on the shared free numbers in natural sizes, for `missing` and `best_manoeuvre`.

    None where nothing is free. What has an infinite variance has no information.
    """
    at = [i for i, name in enumerate(fit.parameters) if "@" not in name]
    names = [name for name in fit.parameters if "@" not in name]
    known = [k for k, i in enumerate(at) if 0.0 < fit.covariance[i, i] < np.inf]
    if not known:
        return None
    unit = problem(fit.actuator, (), names, ("position",), dict.fromkeys(names, (-np.inf, np.inf))).unit[known]
    places = [at[k] for k in known]
    std, values, vectors = spectrum(fit.covariance[np.ix_(places, places)])
    root = np.zeros((len(names), len(names)))
    floor = np.finfo(float).eps * len(known) * values[-1]
    root[np.ix_(known, known)] = (vectors / np.sqrt(np.maximum(values, floor))).T / std * unit
    return root


def _as_heard(root: FloatArray | None) -> FloatArray | None:
    """`root` scaled so that all with a finite variance counts as heard: the covariance, not its size, is to be told."""
    if root is None:
        return None
    norms = np.sqrt(np.sum(root**2, axis=0))
    result: FloatArray = root * (10.0 / np.min(norms[norms > 0.0]))
    return result


def reach(fit: Fit) -> float:
    """Furthest position in m that was measured in the fitted recordings; NaN without one."""
    tops = [np.nanmax(r.measured["position"]) for r in fit.recordings.values() if has_position(r)]
    return float(max(tops)) if tops else float("nan")


def has_position(recording: Recording) -> bool:
    """Whether any sample of a recording has both a measured and a simulated position."""
    both = np.isfinite(recording.measured["position"]) & np.isfinite(recording.simulated["position"])
    return bool(both.any())


def spectrum(covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard errors, and eigenvalues (rising) and eigenvectors of the correlation."""
    std = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    return std, values, vectors
