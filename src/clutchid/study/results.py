"""Results of the study by method: ballistic, and partitioned for every N, in both interpretations, p or q carried."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from clutchid.estimation import Fit
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Recording
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.simulation import Partition
from clutchid.study.bundled import TrueLoad, true_load
from clutchid.verbs.fitting import fit

#: The paper's N.
NUMBERS = (2, 4, 8, 16, 32)

Interpretation = Literal["ballistic", "parts", "every"]
Carry = Literal["p", "q"]

#: Called with a description of the current step and the completed fraction, from 0 to 1.
StudyProgress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class PaperMethod:
    """An estimation method of Table 1: interpretation of N, N, and the variable carried across a reset."""

    interpretation: Interpretation
    number: int | None = None
    carry: Carry = "p"

    @property
    def partition(self) -> Partition | None:
        """The partition that `fit` and `simulate` take; None is ballistic."""
        n, parts = self.number, self.interpretation == "parts"
        return Partition(every=None if parts else n, parts=n if parts else None, carry=self.carry) if n else None

    @property
    def label(self) -> str:
        """Label of the method.

        Examples
        --------
        >>> PaperMethod("every", 8).label
        'every 8 samples'
        """
        if self.interpretation == "parts":
            return f"{self.number} parts"
        return f"every {self.number} samples" if self.interpretation == "every" else "ballistic"


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Results of one method: the fit, and ballistic runs with its theta on both recordings."""

    method: PaperMethod
    fit: Fit
    fitted: Recording
    ballistic: Recording
    verified: Recording


class LoadError(NamedTuple):
    """Rms error of a load in N: over all positions of the true load, and where the clutch engages, 5 to 8 mm."""

    everywhere: float
    engaging: float


#: Methods that the page and the figures show beside each other.
BALLISTIC, PARTS_32 = PaperMethod("ballistic"), PaperMethod("parts", 32)


def methods() -> tuple[PaperMethod, ...]:
    """All methods: ballistic first, then by carried variable, interpretation and N."""
    partitioned = [PaperMethod(way, n, carry) for carry in ("p", "q") for way in ("parts", "every") for n in NUMBERS]
    return (BALLISTIC, *partitioned)


@dataclass(frozen=True, slots=True, eq=False)
class StudyResults:
    """All methods on two recordings, and the true load of the first where it is known."""

    fit_log: Log
    verify_log: Log
    cases: tuple[Case, ...]
    truth: TrueLoad | None

    def case(self, method: PaperMethod) -> Case:
        """Results of a method."""
        return next(case for case in self.cases if case.method == method)


def find(fit_log: Log, verify_log: Log, progress: StudyProgress) -> StudyResults:
    """Compute the study: every method on the two recordings.

    Raises
    ------
    DataError
        If a recording cannot be fitted.
    SolveError
        If a simulation produces values that are not finite.
    """
    todo = methods()
    cases = []
    for number, method in enumerate(todo):
        progress(f"fit: {method.label}" + (", q carried" if method.carry == "q" else ""), 0.65 * number / len(todo))
        cases.append(case_of(method, fit_log, verify_log))
    return StudyResults(fit_log, verify_log, tuple(cases), true_load(fit_log))


def case_of(method: PaperMethod, fit_log: Log, verify_log: Log, start: Actuator | None = None) -> Case:
    """Results of a method, with the equations and parameters of `start`; by default those of the study."""
    result = fit(fit_log, start, FitRequest(partition=method.partition))
    fitted = _only(result)
    ballistic = fitted if method.partition is None else _only(fit(fit_log, result.actuator, free=()))
    return Case(method, result, fitted, ballistic, _only(fit(verify_log, result.actuator, free=())))


def _only(result: Fit) -> Recording:
    return next(iter(result.recordings.values()))


def chosen(cases: Sequence[Case], *interpretations: Interpretation, carry: Carry = "p") -> tuple[Case, ...]:
    """Cases of the given interpretations, in that order; the ballistic one belongs to both p and q."""
    ways = {way: "p" if way == "ballistic" else carry for way in interpretations}
    return tuple(
        case for way in ways.items() for case in cases if (case.method.interpretation, case.method.carry) == way
    )


def table_rows(cases: Sequence[Case], carry: Carry) -> tuple[Case, ...]:
    """The rows of a table: ballistic, N parts, every N samples."""
    return chosen(cases, "ballistic", "parts", "every", carry=carry)


def load_error(case: Case, truth: TrueLoad) -> LoadError:
    """Rms error of the estimated load."""
    error = case.fit.actuator.load.force(truth.position) - truth.force
    engaging = (truth.position >= 5e-3 - 1e-9) & (truth.position <= 8e-3 + 1e-9)
    return LoadError(float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(error[engaging] ** 2))))


def best_possible(truth: TrueLoad) -> float:
    """Smallest rms error in N of a load on the paper's three splines."""
    phi = Load().phi(truth.position)
    weights = np.linalg.lstsq(phi, truth.force)[0]
    return float(np.sqrt(np.mean((phi @ weights - truth.force) ** 2)))
