"""`Method`: a method of estimation as a record of functions, and `SearchResult`: the end of its search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from clutchid.estimation.request import FreeParameters
from clutchid.estimation.result import Fit, failed_fit, plan_warnings
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.search import UNLIMITED, Effort
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.numerics.progress import Progress
from clutchid.preparation.pulses import FindPhase


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """The problem of a fit, and the solution of its search, or the reason why it could not start.

    `posterior` is that over all hypotheses about changes, where they were weighed; `effort` says when a search by
    multiple shooting ends that gets nowhere.
    """

    problem: Problem
    solution: Solution[Any] | Failure
    posterior: Mixture | None = None
    effort: Effort = UNLIMITED


@dataclass(frozen=True, slots=True)
class ChangeFunctions:
    """Functions with which a method weighs hypotheses about changes, at solutions of its search.

    `refine` goes on from a result with another prior, from x; `settle` moves a solution to x, with the states that
    belong to it. Both iterate, and end in `Method.evaluated`.
    """

    refine: Callable[[SearchResult, Problem, FloatArray], SearchResult]
    settle: Callable[[Problem, Solution[Any], FloatArray], Solution[Any] | Failure]


@dataclass(frozen=True, slots=True)
class Method:
    """A method of estimation: its search, the `Fit` at the end of it, and the requests that it supports.

    `problem` has the free parameters and the prepared recordings; the function in it finds the phase of a carrier, that
    of the method where it is None. `search` is all that iterates: it ends in ``evaluated(problem, x, X)``, which makes
    the rows of the cost at parameters x and window starts X, and `result` is a function of these rows. A result can
    therefore be repeated from x and X alone.

    `priors`: priors, parameters of single recordings, 'auto' and calibrations. `check` adds profile likelihood and a
    bootstrap to a result. Without `changes` a load from position alone is read as if nothing had changed. `partition`
    is empty if the method supports a partition, else the reason why not.
    """

    name: str
    problem: Callable[[Sequence[Log], Actuator, FreeParameters, Calibration | None, FindPhase | None], Problem]
    search: Callable[[Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult]
    evaluated: Callable[[Problem, FloatArray, Sequence[FloatArray]], Any]
    result: Callable[[SearchResult, Calibration | None], Fit | Failure]
    priors: bool = True
    check: Callable[[Fit, SearchResult, Calibration | None, Sequence[str], int], Fit] | None = None
    changes: ChangeFunctions | None = None
    partition: str = ""


def fit_at(method: Method, search_result: SearchResult, calibration: Calibration | None = None) -> Fit:
    """The `Fit` at the end of a search by `method`; status "failed" if it could not start."""
    result = method.result(search_result, calibration)
    if isinstance(result, Failure):
        return failed_fit(
            search_result.problem, method.name, result.message, plan_warnings(search_result.problem.plans)
        )
    return result
