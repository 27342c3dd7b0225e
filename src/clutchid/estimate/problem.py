"""The problem of a fit with priors: recordings made ready, and what is free beside what was asked for."""

from __future__ import annotations

from collections.abc import Sequence

from clutchid.estimate.free import FreeParameters
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import ParameterName, base_of
from clutchid.preparation.prepare import CALIBRATED_MARGIN, MARGIN, paced_tracks, prepare
from clutchid.simulation.plan import Plan
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Prior, coordinates, far_stop
from clutchid.uncertainty.drift import deviation
from clutchid.uncertainty.noise import Noise

#: Curvature of a load, as a standard deviation in N/m²: a clutch of 5 kN turns within 4 mm.
CURVATURE = 3e8

#: What wears beside the clutch: the friction of the seals, and the dead volume at the engaged rest, which moves.
WEARING = ("F_C", "V_0A")


def fit_problem(
    logs: Sequence[Log], actuator: Actuator, free: FreeParameters, calibration: Calibration | None = None
) -> tuple[FitProblem, tuple[Plan, ...]]:
    """The problem of a fit, and the plans of its recordings.

    Beside `free` the phase of the carrier is free in each recording where it is not known, and where a load is read
    from position alone so is what wears.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    plans = tuple(prepare(log, actuator, free.measure) for log in logs)
    first = plans[0].actuator
    own = {**_phases(free, logs, plans), **_wearing(free, logs, actuator, calibration)}
    problem = FitProblem(
        actuator=first,
        coordinates=coordinates(first, (*free.names, *own), free.bounds, {**own, **free.priors}),
        tracks=paced_tracks(plans, CALIBRATED_MARGIN if calibration else MARGIN),
        stems=tuple(log.name for log in logs),
        measure=free.measure,
        noise=Noise(),
        curvature=CURVATURE,
        reference=actuator.load.theta if calibration else (0.0,) * len(actuator.load.theta),
    )
    return problem, plans


def _phases(free: FreeParameters, logs: Sequence[Log], plans: Sequence[Plan]) -> dict[str, Prior]:
    """The phase of the carrier in each recording, where the valves' own phases are not free."""
    later = 1 if "s_vs" in free.names else 0
    return {
        str(ParameterName("s_pwm", log.name)): Prior(plan.actuator.parameters.s_pwm, plan.phase_std)
        for log, plan in list(zip(logs, plans, strict=True))[later:]
        if plan.phase_std > 0.0
    }


def _wearing(
    free: FreeParameters, logs: Sequence[Log], actuator: Actuator, calibration: Calibration | None
) -> dict[str, Prior]:
    """What wears beside the clutch, in each recording, where a load is read from position alone."""
    if calibration is None or not free.reads_load(actuator):
        return {}
    taken = {base_of(name) for name in free.names}
    known = {name: Prior(actuator.value(name), deviation(actuator, name, calibration)) for name in WEARING}
    return {
        str(ParameterName(name, log.name)): prior
        for log in logs
        for name, prior in {**known, "y_max": far_stop(actuator, log.reach())}.items()
        if name not in taken
    }
