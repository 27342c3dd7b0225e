"""The problem of a fit with priors: prepared recordings, and free parameters in addition to the requested ones."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.request import FreeParameters
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import change_priors
from clutchid.inference.uncertainty.conditions import known_conditions
from clutchid.inference.uncertainty.coordinates import Prior, coordinates, far_stop
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import ParameterName, base_of
from clutchid.preparation.prepare import CALIBRATED_MARGIN, MARGIN, prepare, tracks_with_steps
from clutchid.preparation.pulses import FindPhase, find_phase
from clutchid.simulation.noise import Noise
from clutchid.simulation.plan import Plan


def fit_problem(
    logs: Sequence[Log],
    actuator: Actuator,
    free: FreeParameters,
    calibration: Calibration | None = None,
    find: FindPhase = find_phase,
) -> Problem:
    """The problem of a fit with priors; `find` is that of `prepare`.

    Besides `free`, the phase of the carrier is free in each recording where it is unknown; for a load from position
    alone so is what changes between recordings, with the prior that nothing has changed.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    plans = tuple(prepare(log, actuator, free.measure, find) for log in logs)
    first = plans[0].actuator
    changing = _changing(free, logs, actuator, calibration)
    added = {**_phases(free, logs, plans), **_stops(free, logs, actuator, calibration), **changing}
    priors = {**added, **free.priors}
    problem = Problem(
        actuator=first,
        coordinates=coordinates(first, (*free.names, *added), free.bounds, priors),
        stems=tuple(log.name for log in logs),
        measure=free.measure,
        noise=_noise(first, free),
        plans=plans,
        tracks=tracks_with_steps(plans, CALIBRATED_MARGIN if calibration else MARGIN),
        reference=_reference(actuator, free) if calibration else (0.0,) * len(actuator.load.theta),
        changing=tuple(changing),
        measured=_measured(changing, free, logs, actuator, calibration),
    )
    return with_hypothesis(problem, ())


def start_point(problem: Problem, free: FreeParameters) -> FloatArray:
    """Start of a search in x, shape (k,): the means of the priors, or the end of an earlier search.

    Otherwise it is at the means: bounded steps cannot return from a start far outside a narrow prior.
    """
    x = np.zeros(len(problem.coordinates))
    starts = free.start.values if free.start else {}
    for i, c in enumerate(problem.coordinates):
        if c.name in starts:
            x[i] = c.of(starts[c.name])
    return np.clip(x, *problem.bounds())


def _noise(actuator: Actuator, free: FreeParameters) -> Noise:
    """Noise of the states, and of the sensors as an earlier search estimated it."""
    noise = Noise(states={name: row.noise for name, row in actuator.state_rows.items()})
    return replace(noise, measured={**noise.measured, **free.start.scales}) if free.start else noise


def _reference(actuator: Actuator, free: FreeParameters) -> tuple[float, ...]:
    """Weights of the calibrated load, to whose curvature that of a new load is compared."""
    values = zip(actuator.load.names, actuator.load.theta, strict=True)
    return tuple(free.priors[name].mean if free.start and name in free.priors else value for name, value in values)


def _phases(free: FreeParameters, logs: Sequence[Log], plans: Sequence[Plan]) -> dict[str, Prior]:
    """Priors of the carrier phase in each recording, unless the phases of the valves are free."""
    first_free = 1 if "s_vs" in free.names else 0
    return {
        str(ParameterName("s_pwm", log.name)): Prior(plan.actuator.parameters.s_pwm, plan.phase_std)
        for log, plan in list(zip(logs, plans, strict=True))[first_free:]
        if plan.phase_std > 0.0
    }


def _stops(
    free: FreeParameters, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """Priors of the far stop in each recording for a load from position alone: it shifts with wear."""
    if calibration is None or not free.reads_load(actuator) or "y_max" in map(base_of, free.names):
        return {}
    return {str(ParameterName("y_max", log.name)): far_stop(actuator, log.reach()) for log in logs}


def _changing(
    free: FreeParameters, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """Priors of what changes between recordings, in each recording, for a load from position alone."""
    if calibration is None or not free.reads_load(actuator):
        return {}
    taken = {base_of(name) for name in free.names}
    priors = {name: prior for name, prior in change_priors(actuator).items() if name not in taken}
    return {str(ParameterName(name, log.name)): prior for log in logs for name, prior in priors.items()}


def _measured(
    changing: Container[str],
    free: FreeParameters,
    logs: Sequence[Log],
    actuator: Actuator,
    calibration: Calibration | None,
) -> dict[str, Prior]:
    """Measurements of what may have changed, in each recording, from its conditions and those of the calibration."""
    if calibration is None or not free.reads_load(actuator):
        return {}
    measured = {log.name: known_conditions(log, actuator, calibration.conditions, free.conditions) for log in logs}
    named = {str(ParameterName(n, stem)): prior for stem, own in measured.items() for n, prior in own.items()}
    return {name: prior for name, prior in named.items() if name in changing}
