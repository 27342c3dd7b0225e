"""Where a search ended, by whatever method, and what a method of searching is."""

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
    """Where a search ended: free parameters, how it ended, and after how much work."""

    @property
    def x(self) -> FloatArray:
        """Free parameters as coordinates."""

    @property
    def status(self) -> Literal["converged", "stalled", "limit"]:
        """How the search ended."""

    @property
    def evaluations(self) -> int:
        """After how many evaluations."""


SolutionT = TypeVar("SolutionT", bound=Solution)


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult(Generic[SolutionT]):
    """The problem of a fit, the plans of its recordings, and where the search by `method` ended."""

    method: str
    problem: FitProblem
    plans: tuple[Plan, ...]
    solution: SolutionT | Failure


@dataclass(frozen=True, slots=True)
class SearchMethod(Generic[SolutionT]):
    """A way to search with priors: the search, its result for the user, and its checks.

    `check` repeats a result by profile likelihood and bootstrap; `score` says where fixed parameters would go, for a
    method that looks for what has changed since a calibration.
    """

    search: Callable[
        [Sequence[Log], Actuator, FreeParameters, Calibration | None, Progress | None], SearchResult[SolutionT]
    ]
    result: Callable[[SearchResult[SolutionT], Calibration | None], Fit | Failure]
    check: Callable[[Fit, SearchResult[SolutionT], Calibration | None, Sequence[str], int], Fit] | None = None
    score: Callable[[SearchResult[SolutionT]], Score | Failure] | None = None
