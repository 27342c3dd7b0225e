"""Methods of search, and their results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

from clutchid.estimation.request import FreeParameters
from clutchid.estimation.result import Fit
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.smoother.search import UNLIMITED, Effort
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.simulation.plan import Plan


class SearchSolution(Protocol):
    """Solution of a search: free parameters, status, and number of evaluations."""

    @property
    def x(self) -> FloatArray:
        """Free parameters as coordinates."""

    @property
    def status(self) -> Literal["converged", "stalled", "limit"]:
        """End of the search."""

    @property
    def evaluations(self) -> int:
        """Number of evaluations."""


SolutionT = TypeVar("SolutionT", bound=SearchSolution)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Generic[SolutionT]):
    """The problem of a fit, the plans of its recordings, and the solution of the search by `method`.

    `covariance` of x, shape (k, k), is that over all hypotheses about changes, where they were weighed; `effort` says
    when a search by multiple shooting ends that gets nowhere.
    """

    method: str
    problem: FitProblem
    plans: tuple[Plan, ...]
    solution: SolutionT | Failure
    covariance: FloatArray | None = None
    effort: Effort = UNLIMITED


@dataclass(frozen=True, slots=True)
class Hypotheses(Generic[SolutionT]):
    """Functions with which a method of search weighs hypotheses about changes.

    `cost` is that of a solution. `refine` goes on from a result with another prior, from x; `data_factor` is the
    triangular factor ``[R | q]`` of the data alone at a solution; `dispersion` that of
    `clutchid.inference.smoother.residuals`; `settle` moves a solution to x, with the states that belong to it.
    """

    cost: Callable[[SolutionT], float]
    refine: Callable[[SearchResult[SolutionT], FitProblem, FloatArray], SearchResult[SolutionT]]
    data_factor: Callable[[FitProblem, SolutionT], FloatArray]
    dispersion: Callable[[FitProblem, SolutionT], float]
    settle: Callable[[FitProblem, SolutionT, FloatArray], SolutionT | Failure]


@dataclass(frozen=True, slots=True)
class SearchMethod(Generic[SolutionT]):
    """A method of search with priors: the search, its `Fit`, and optional checks.

    `check` adds profile likelihood and a bootstrap to a result. Without `hypotheses` a load from position alone is read
    as if nothing had changed.
    """

    search: Callable[
        [Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult[SolutionT]
    ]
    result: Callable[[SearchResult[SolutionT], Calibration | None], Fit | Failure]
    check: Callable[[Fit, SearchResult[SolutionT], Calibration | None, Sequence[str], int], Fit] | None = None
    hypotheses: Hypotheses[SolutionT] | None = None
