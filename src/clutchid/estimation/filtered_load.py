"""A load from position alone with two estimators: multiple shooting, and the joint filter where the supply is recorded.

Their errors are nearly uncorrelated, because they weight the same samples differently.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.errors import DataError
from clutchid.inference.problem import Problem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator

#: Weight of the joint filter where the valves have not changed, which it takes to be as calibrated. Provenance:
#: `benchmarks/bands.py`, docs/derivations.md, "Intervals".
FILTER_WEIGHT = 0.3


def with_filtered_load(
    posterior: Mixture, problem: Problem, logs: Sequence[Log], actuator: Actuator, calibration: Calibration
) -> Mixture:
    """`posterior` with its load moved towards that of the joint filter, if each recording has a supply pressure.

    The band stays that of the posterior: a mean of two estimators has no larger error than the worse one.
    """
    weights = [filtered_weights(log, actuator, calibration) for log in logs]
    filtered_logs = [of_log for of_log in weights if of_log is not None]
    if len(filtered_logs) < len(weights):
        return posterior
    filtered = dict(zip(actuator.load.names, np.mean(filtered_logs, axis=0).tolist(), strict=True))
    x, share = posterior.x, FILTER_WEIGHT * (1.0 - posterior.of_group("valves"))
    step = [
        c.of(filtered[c.base]) - value if c.base in filtered else 0.0
        for c, value in zip(problem.coordinates, x.tolist(), strict=True)
    ]
    return posterior.moved(share * np.array(step))


def filtered_weights(log: Log, actuator: Actuator, calibration: Calibration) -> FloatArray | None:
    """Load weights in their unit after the joint filter has followed a recording from a calibration.

    None where the supply pressure is not used, the recording is too slow for an observer, or the innovations are those
    of an observer that has no trust in its load, as in the cold, where it takes for load what `D_v` at its bound cannot
    explain.
    """
    if "pressure_supply" not in log:
        return None
    from clutchid.observer import observe_recording, observer  # on use: most readings do without an observer
    from clutchid.observer.mismatch import MISMATCHED

    try:
        run = observe_recording(observer(actuator, calibration=calibration, zero="keep"), log)
    except DataError:
        return None
    refused = run.assumes_supply or run.after.mismatch > MISMATCHED
    return None if refused else np.array(run.observer.load(run.after).theta)


def load_per_supply(problem: Problem, posterior: Mixture | None) -> float | None:
    """By how many % a load changes for 1 % of the supply pressure, if that were known, with what else is fitted.

    From the covariances of the reading itself, over the positions of its recordings in proportion to the load. None
    where no change of the supply is fitted beside the load.
    """
    places = [i for i, c in enumerate(problem.coordinates) if c.base == "P_S" and c.name in problem.changing]
    if posterior is None or not places:
        return None
    x, slopes, values = posterior.x, problem.slopes(posterior.x), problem.si(posterior.x)
    step = slopes * posterior.slope(places, values[places] / slopes[places])
    load = problem.load_of(x)
    y = np.linspace(0.0, min(max(plan.log.reach() for plan in problem.plans), problem.actuator.parameters.y_max), 100)
    moved = {c.base: float(change) for c, change in zip(problem.coordinates, step, strict=True)}
    force, change = load.force(y), load.phi(y) @ [moved.get(name, 0.0) for name in load.names]
    return float(force @ change / (force @ force))
