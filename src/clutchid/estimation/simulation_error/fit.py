"""The method 'simulation': simulation error in two stages, as in the paper (Section 3.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.errors import DataError
from clutchid.estimation.request import FitRequest, bounds_of, free_names
from clutchid.estimation.result import Fit, failed_fit, plan_warnings
from clutchid.estimation.simulation_error.problem import Problem, build_problem
from clutchid.estimation.simulation_error.result import bounds_in_si, result
from clutchid.estimation.simulation_error.search import two_stages
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.simulation.plan import plan
from clutchid.simulation.stiffness import stiffness_over, top_speed


def fit_simulation_error(
    logs: Sequence[Log], actuator: Actuator, request: FitRequest, progress: Progress | None = None
) -> Fit:
    """Fit ballistic or partitioned simulations; status "failed" if the start values cannot be simulated.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.fit`.
    """
    names = free_names(request.free, actuator)
    limits = bounds_of(names, actuator, request.bounds)
    start = actuator.replace({name: float(np.clip(actuator.value(name), *limits[name])) for name in names})
    rate = stiffness_over(start, limits, top_speed(request.partition))
    with_pressure = "pressure_a" in request.measure
    plans = [plan(log, start, rate, request.partition, with_pressure) for log in logs]
    problem = build_problem(start, plans, names, request.measure, limits)
    _check_size(problem)
    solution, scales = two_stages(problem, progress)
    if isinstance(solution, Failure):
        message = " ".join([solution.message, *plan_warnings(plans)])
        return failed_fit(problem.actuator, bounds_in_si(problem), "simulation", message, ())
    return result(problem, solution, scales)


def _check_size(problem: Problem) -> None:
    samples = sum(
        int(np.isfinite(plan.log[name][s.start : s.stop]).sum())
        for plan in problem.plans
        for s in plan.segments
        for name in problem.measure
    )
    if samples <= problem.x0.size:
        raise DataError(
            f"{problem.plans[0].log.name}: {samples} measured samples for {problem.x0.size} free parameters "
            f"({len(problem.names)} parameters and the unknown starts); record at least a full stroke."
        )
