"""Ends of searches: recorded while the methods search, and put in their place to evaluate a fit where it was kept.

A method iterates in few places: its search, its continuation under another hypothesis, the states that belong to a
mean, and the interval of a profile. Each ends at a record of numbers, and all else of a fit is a function of them. A
virtual truck drives in a closed loop, whose duty cycles are such a record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from clutchid import Fit
from clutchid.estimation.checks import profile_curve
from clutchid.estimation.fit import FIT_METHODS
from clutchid.estimation.method import Method, SearchResult
from clutchid.estimation.result import ProfileCurve
from clutchid.inference.problem import Problem
from clutchid.inference.smoother.problem import LinearisedProblem, condense
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import Linearisation, Solution
from clutchid.truck import Drive, Vehicle, drive

End = dict[str, Any]

#: Significant digits of an end: it is evaluated as it is written, so that they need not be all of a search.
DIGITS = 12


def rounded(values: Any) -> list[float]:
    """Numbers with the digits that are written."""
    return [float(f"{value:.{DIGITS}g}") for value in np.ravel(values)]


def end_of(what: str, problem: Problem, solution: Solution[Any] | Failure) -> End:
    """Record of the end of a search, or of why there is none."""
    end: End = {"what": what, "recordings": list(problem.stems), "free": list(problem.names)}
    if isinstance(solution, Failure):
        return end | {"failure": solution.message}
    X = getattr(solution.at, "X", ())
    return end | {
        "phases": [plan.actuator.parameters.s_pwm for plan in problem.plans],
        "scales": dict(problem.noise.measured),
        "status": solution.status,
        "evaluations": solution.evaluations,
        "x": rounded(solution.x),
        "X": [[rounded(state) for state in states] for states in X],
    }


def closed_loop(kind: Vehicle, options: dict[str, Any]) -> FloatArray:
    """Duty cycles of a drive at every millisecond, shape (n, 2), whatever is recorded of it."""
    log = drive(kind, **{**options, "recorder": "controller", "late": 0.0, "dropouts": 0}).log
    return np.column_stack([log["duty_supply"], log["duty_exhaust"]])


def packed(duties: FloatArray) -> list[list[float]]:
    """Duty cycles as rows of both values and of the number of samples for which they stay."""
    starts = np.flatnonzero(np.r_[True, np.any(np.diff(duties, axis=0) != 0.0, axis=1)])
    counts = np.diff(np.r_[starts, len(duties)])
    return [[*duties[start].tolist(), int(count)] for start, count in zip(starts, counts, strict=True)]


def unpacked(rows: list[list[float]]) -> FloatArray:
    """Inverse of `packed`."""
    return np.repeat([row[:2] for row in rows], [int(row[2]) for row in rows], axis=0)


class Recorder:
    """Methods that search, and the `ends` in the order of the searches."""

    def __init__(self) -> None:
        self.ends: list[End] = []

    def methods(self) -> dict[str, Method]:
        """The methods by name."""
        return {name: self._recorded(method) for name, method in FIT_METHODS.items()}

    def drive(self, name: str, kind: Vehicle, **options: Any) -> Drive:
        """A drive in a closed loop, whose duty cycles are recorded."""
        self.ends.append({"what": f"duty cycles of {name}", "duties": packed(closed_loop(kind, options))})
        return drive(kind, **options)

    def _recorded(self, method: Method) -> Method:
        def search(*asked: Any) -> SearchResult:
            result = method.search(*asked)
            self.ends.append(end_of(f"search of {method.name}", result.problem, result.solution))
            return result

        def refine(result: SearchResult, problem: Problem, x: Any, progress: Any) -> SearchResult:
            assert method.changes
            result = method.changes.refine(result, problem, x, progress)
            self.ends.append(end_of("search with a change", problem, result.solution))
            return result

        def settle(problem: Problem, solution: Any, x: Any) -> Any:
            assert method.changes
            settled = method.changes.settle(problem, solution, x)
            self.ends.append(end_of("states at the mean", problem, settled))
            return settled

        def profile(problem: Problem, solution: Any, uncertain: Any, name: str) -> Any:
            curve = profile_curve(problem, solution, uncertain, name)
            assert not isinstance(curve, Failure), curve
            interval = rounded((curve.low, curve.high))
            self.ends.append({"what": f"profile of {name}", "interval": interval, "shape": curve.shape})
            return curve

        return _with(method, search, refine, settle, profile)


class Replay:
    """Methods that are evaluated at kept `ends`; `searched` are comparisons with searches that were done again.

    Parameters
    ----------
    ends : several
        In the order of the searches.
    again : numbers
        Which of them are searched again.
    """

    def __init__(self, ends: Sequence[End], again: Sequence[int] = ()) -> None:
        self.ends, self.again, self.number = ends, again, 0
        self.searched: dict[str, dict[str, float]] = {}

    def methods(self) -> dict[str, Method]:
        """The methods by name."""
        return {name: self._replayed(method) for name, method in FIT_METHODS.items()}

    def drive(self, name: str, kind: Vehicle, **options: Any) -> Drive:
        """A drive with the kept duty cycles."""
        number, end = self.number, self._next(f"duty cycles of {name}")
        if number in self.again:
            before, now = unpacked(end["duties"]), closed_loop(kind, options)
            self.searched[end["what"]] = {"other samples": int(np.any(before != now, axis=1).sum())}
        return drive(kind, **options, duties=unpacked(end["duties"]))

    def _next(self, what: str, problem: Problem | None = None) -> End:
        """The next end, which must be of the same kind and of the same free parameters."""
        wanted = what if problem is None else f"{what} in {', '.join(problem.stems)}"
        if self.number == len(self.ends):
            raise LookupError(f"{wanted}: all {self.number} kept searches are used up; the fit takes another way.")
        end = self.ends[self.number]
        self.number += 1
        if end["what"] != what or (
            problem and (list(problem.stems), list(problem.names)) != (end["recordings"], end["free"])
        ):
            free = sorted({*end.get("free", ())} ^ {*(problem.names if problem else ())})
            raise LookupError(f"{wanted}, but kept is {end['what']}; free in one only: {', '.join(free) or 'none'}.")
        return end

    def _replayed(self, method: Method) -> Method:
        def solution(problem: Problem, end: End) -> Any:
            if "failure" in end:
                return Failure(end["failure"])
            at = method.evaluated(problem, np.array(end["x"]), [np.array(states) for states in end["X"]])
            assert not isinstance(at, Failure), at
            return Solution(np.array(end["x"]), at, end["status"], end["evaluations"])

        def search(logs: Any, actuator: Any, free: Any, calibration: Any = None, progress: Any = None) -> SearchResult:
            ahead = self.ends[self.number] if self.number < len(self.ends) else {}
            phases = dict(zip(ahead.get("recordings", ()), ahead.get("phases", ()), strict=True))
            problem = method.problem(logs, actuator, free, calibration, lambda log, _: phases.get(log.name, 0.0))
            number, end = self.number, self._next(f"search of {method.name}", problem)
            if "scales" in end:
                problem = replace(problem, noise=replace(problem.noise, measured=end["scales"]))
            result = SearchResult(problem, solution(problem, end))
            if number in self.again:
                match = method.search(logs, actuator, free, calibration, progress)
                self.searched[f"{number} {end['what']} in {', '.join(end['recordings'])}"] = _compared(
                    method, result, match
                )
            return result

        def refine(result: SearchResult, problem: Problem, x: Any, progress: Any) -> SearchResult:
            end = self._next("search with a change", problem)
            return replace(result, problem=problem, solution=solution(problem, end))

        def settle(problem: Problem, _: Any, x: Any) -> Any:
            # x follows from the other ends; kept are the states that belong to it
            end = self._next("states at the mean", problem)
            return solution(problem, end | ({"x": x} if "x" in end else {}))

        def profile(problem: Problem, solution: Any, uncertain: Any, name: str) -> Any:
            number, end = self.number, self._next(f"profile of {name}")
            low, high = end["interval"]
            if number in self.again:
                now = profile_curve(problem, solution, uncertain, name)
                assert not isinstance(now, Failure), now
                apart = max(abs(now.low - low), abs(now.high - high))
                self.searched[end["what"]] = {"half widths": 2 * apart / (high - low)}
            ends = np.array([low, high])
            return ProfileCurve(low, high, ends, np.full(2, QUANTILE), end.get("shape", "bounded"))

        return _with(method, search, refine, settle, profile)


def _compared(method: Method, golden: SearchResult, now: SearchResult) -> dict[str, float]:
    """Cost of an end beyond that of the kept one, in the problem of that one, and their distance in deviations."""
    assert isinstance(golden.solution, Solution), golden.solution
    assert isinstance(now.solution, Solution), now.solution
    problem = golden.problem
    # another phase of a carrier is another origin of its coordinate
    si = now.problem.si(now.solution.x).tolist()
    x = np.array([c.of(value) for c, value in zip(problem.coordinates, si, strict=True)])
    at = method.evaluated(problem, x, getattr(now.solution.at, "X", ()))
    R = _factor(problem, golden.solution.at)
    distance = float(np.linalg.norm(R @ (x - golden.solution.x)))
    return {"cost": golden.solution.at.cost, "gain": at.cost - golden.solution.at.cost, "distance": distance}


def _factor(problem: Problem, at: Any) -> FloatArray:
    """Triangular factor R of the rows of a cost in x."""
    if isinstance(at, LinearisedProblem):
        k = len(problem.coordinates)
        return condense(problem, at)[0][:k, :k]
    linear: Linearisation = at if isinstance(at, Linearisation) else at.linearisation()
    return linear.R


def _with(method: Method, search: Any, refine: Any, settle: Any, profile: Any) -> Method:
    """`method` with other functions in place of those that iterate."""
    changes = method.changes and replace(method.changes, refine=refine, settle=settle)
    check: Callable[..., Fit] | None = method.check and partial(method.check, profile=profile)
    return replace(method, search=search, changes=changes, check=check)
