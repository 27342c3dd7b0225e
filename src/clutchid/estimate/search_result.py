"""Methods of search, and their results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

from clutchid.estimate.free import FreeParameters
from clutchid.estimate.result import Fit
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Progress
from clutchid.simulation.plan import Plan
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration, Score


class Solution(Protocol):
    """Solution of a search: free parameters, status, and number of evaluations."""

    @property
    def x(self) -> FloatArray:
        """Free parameters as coordinates."""

    @property
    def status(self) -> Literal["converged", "stalled", "limit"]:
        """How the search ended."""

    @property
    def evaluations(self) -> int:
        """Number of evaluations."""


SolutionT = TypeVar("SolutionT", bound=Solution)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Generic[SolutionT]):
    """The problem of a fit, the plans of its recordings, and the solution of the search by `method`."""

    method: str
    problem: FitProblem
    plans: tuple[Plan, ...]
    solution: SolutionT | Failure


@dataclass(frozen=True, slots=True)
class SearchMethod(Generic[SolutionT]):
    """A method of search with priors: the search, its `Fit`, and optional checks.

    `check` adds profile likelihood and a bootstrap to a result; `score` gives the Gauss-Newton step of fixed
    parameters, by which changes since a calibration are detected.
    """

    search: Callable[
        [Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult[SolutionT]
    ]
    result: Callable[[SearchResult[SolutionT], Calibration | None], Fit | Failure]
    check: Callable[[Fit, SearchResult[SolutionT], Calibration | None, Sequence[str], int], Fit] | None = None
    score: Callable[[SearchResult[SolutionT]], Score | Failure] | None = None
