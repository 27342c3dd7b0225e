"""The problem of a fit with priors: prepared recordings, and free parameters in addition to the requested ones."""

from __future__ import annotations

from collections.abc import Sequence

from clutchid.estimate.free import FreeParameters
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import ParameterName, base_of
from clutchid.preparation.prepare import CALIBRATED_MARGIN, MARGIN, prepare, tracks_with_steps
from clutchid.simulation.plan import Plan
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Prior, coordinates, far_stop
from clutchid.uncertainty.drift import calibrated_deviation
from clutchid.uncertainty.noise import Noise

#: Prior standard deviation of the curvature of a load in N/m²: the load of a 5 kN clutch bends over 4 mm.
CURVATURE = 3e8

#: Parameters that wear together with the clutch: friction of the seals, and dead volume at the engaged rest, which
#: shifts.
WEARING = ("F_C", "V_0A")


def fit_problem(
    logs: Sequence[Log], actuator: Actuator, free: FreeParameters, calibration: Calibration | None = None
) -> tuple[FitProblem, tuple[Plan, ...]]:
    """The problem of a fit, and the plans of its recordings.

    Besides `free`, the phase of the carrier is free in each recording where it is unknown; for a load from position
    alone so are the parameters that wear.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    plans = tuple(prepare(log, actuator, free.measure) for log in logs)
    first = plans[0].actuator
    added = {**_phases(free, logs, plans), **_wearing(free, logs, actuator, calibration)}
    problem = FitProblem(
        actuator=first,
        coordinates=coordinates(first, (*free.names, *added), free.bounds, {**added, **free.priors}),
        tracks=tracks_with_steps(plans, CALIBRATED_MARGIN if calibration else MARGIN),
        stems=tuple(log.name for log in logs),
        measure=free.measure,
        noise=Noise(states={name: row.noise for name, row in first.state_rows.items()}),
        curvature=CURVATURE,
        reference=actuator.load.theta if calibration else (0.0,) * len(actuator.load.theta),
    )
    return problem, plans


def _phases(free: FreeParameters, logs: Sequence[Log], plans: Sequence[Plan]) -> dict[str, Prior]:
    """Priors of the carrier phase in each recording, unless the phases of the valves are free."""
    first_free = 1 if "s_vs" in free.names else 0
    return {
        str(ParameterName("s_pwm", log.name)): Prior(plan.actuator.parameters.s_pwm, plan.phase_std)
        for log, plan in list(zip(logs, plans, strict=True))[first_free:]
        if plan.phase_std > 0.0
    }


def _wearing(
    free: FreeParameters, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """Priors of the parameters that wear, in each recording, for a load from position alone."""
    if calibration is None or not free.reads_load(actuator):
        return {}
    taken = {base_of(name) for name in free.names}
    wearing = [name for name in WEARING if name in actuator.in_equations]
    priors = {name: Prior(actuator.value(name), calibrated_deviation(actuator, name, calibration)) for name in wearing}
    return {
        str(ParameterName(name, log.name)): prior
        for log in logs
        for name, prior in {**priors, "y_max": far_stop(actuator, log.reach())}.items()
        if name not in taken
    }
