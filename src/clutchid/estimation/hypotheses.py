"""What may have changed since a calibration, as hypotheses that are weighed by their evidence.

The load is read from position alone under each hypothesis of `clutchid.inference.uncertainty.change_prior`. All are
first judged by the linearisation of the most probable one so far; a search follows only for those that may matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic

import numpy as np

from clutchid.estimation.problem import with_hypothesis
from clutchid.estimation.search_result import Hypotheses, SearchResult, SolutionT
from clutchid.inference.smoother.problem import FitProblem, prior_rows
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, LOG_ODDS_TOGETHER, Hypothesis, log_odds
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.inference.uncertainty.gaussian import GaussianPosterior, gaussian_posterior
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure

#: A hypothesis is searched if its probability may be above this.
LEAST_PROBABILITY = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Explanation(Generic[SolutionT]):
    """The recordings explained under a hypothesis: search, and factor ``[R | q]`` of the data at its solution.

    Where the dispersion of the data, see `clutchid.inference.smoother.residuals`, is above 1, their rows are divided by
    its root; `scatter` is the dispersion where it is below. Weighting such data more made the loads of changed trucks
    worse.
    """

    result: SearchResult[SolutionT]
    solution: SolutionT
    data: FloatArray
    scatter: float

    def under(self, hypothesis: Hypothesis) -> GaussianPosterior:
        """Posterior under another hypothesis, by the linearisation at this solution."""
        problem = with_hypothesis(self.result.problem, hypothesis)
        return gaussian_posterior(self.data, prior_rows(problem, self.solution.x), log_root(problem), self.scatter)


#: Explanations by their hypothesis.
Explanations = Mapping[Hypothesis, Explanation[SolutionT]]


def explained(
    found: SearchResult[SolutionT], method: Hypotheses[SolutionT], calibration: Calibration
) -> dict[Hypothesis, Explanation[SolutionT]]:
    """Explanations under every hypothesis that may matter, from the search that assumed no change.

    Parameters
    ----------
    found : SearchResult
        With a solution, under the hypothesis of no change.
    method : Hypotheses
        How a search goes on under another hypothesis.
    calibration : Calibration
        Its errors from position alone are what a hypothesis explains without any change.
    """
    none: Hypothesis = ()
    dispersion = calibration.position_only.dispersion if calibration.position_only else 1.0
    known = {none: explanation(found, method, dispersion)}
    failed: set[Hypothesis] = set()
    while True:
        best = max(known, key=dict(zip(known, probabilities(known, calibration), strict=True)).__getitem__)
        candidate = _candidate(known, best, failed, calibration)
        if candidate is None:
            return known
        start, step = known[best], known[best].under(candidate).step
        problem = with_hypothesis(start.result.problem, candidate)
        x = np.clip(start.solution.x + step, *problem.bounds())
        again = method.refine(start.result, problem, x)
        if isinstance(again.solution, Failure):
            failed.add(candidate)
        else:
            known[candidate] = explanation(again, method, dispersion)


def explanation(
    found: SearchResult[SolutionT], method: Hypotheses[SolutionT], dispersion: float
) -> Explanation[SolutionT]:
    """The explanation of a search with a solution; `dispersion` is that of the data."""
    assert not isinstance(found.solution, Failure), "a failed search explains nothing"
    data = method.data_factor(found.problem, found.solution)
    return Explanation(found, found.solution, data / np.sqrt(max(1.0, dispersion)), min(1.0, dispersion))


def _candidate(
    known: Explanations[SolutionT], best: Hypothesis, failed: set[Hypothesis], calibration: Calibration
) -> Hypothesis | None:
    """The most probable hypothesis without a search, by the linearisation of the best; None if none may matter."""
    others = [h for h in HYPOTHESES if h not in known and h not in failed]
    scores = [score(known[best].under(h), h, calibration) for h in others]
    scores += [score(one.under(h), h, calibration) for h, one in known.items()]
    probability = softmax(scores)[: len(others)]
    if not others or probability.max() < LEAST_PROBABILITY:
        return None
    return others[int(np.argmax(probability))]


def probabilities(known: Explanations[SolutionT], calibration: Calibration) -> FloatArray:
    """Probability of each hypothesis, in the order of `known`."""
    return softmax([score(one.under(h), h, calibration) for h, one in known.items()])


def flattened(
    posteriors: Mapping[Hypothesis, GaussianPosterior], calibration: Calibration, part: float
) -> dict[Hypothesis, float]:
    """Weights of hypotheses by `part` of the logarithm of their evidence, without odds against two changes at once."""
    scores = []
    for h, posterior in posteriors.items():
        odds = log_odds(h)
        evidence = score(posterior, h, calibration) - odds
        scores.append(part * evidence + odds - (LOG_ODDS_TOGETHER if len(h) > 1 else 0.0))
    return dict(zip(posteriors, softmax(scores).tolist(), strict=True))


def score(posterior: GaussianPosterior, hypothesis: Hypothesis, calibration: Calibration) -> float:
    """Logarithm of the odds of a hypothesis: evidence, beyond that in the calibration recordings, and prior odds.

    What a change would explain in the calibration recordings, where nothing has changed, is an error of the model.
    """
    errors = calibration.position_only
    known = max(0.0, errors.evidence(hypothesis)) if errors else 0.0
    return posterior.log_evidence - known + log_odds(hypothesis)


def softmax(scores: Sequence[float]) -> FloatArray:
    """Probabilities from logarithms of odds."""
    odds = np.exp(np.array(scores) - max(scores))
    result: FloatArray = odds / odds.sum()
    return result


def log_root(problem: FitProblem) -> float:
    """Logarithm of the determinant of the root of the joint prior."""
    return 0.0 if problem.prior_root is None else float(np.linalg.slogdet(problem.prior_root)[1])


def errors_in_x(coordinates: Sequence[Coordinate], hypothesis: Hypothesis, calibration: Calibration) -> FloatArray:
    """What a fit to position alone errs in x under a hypothesis, shape (k,), as on the calibration recordings."""
    if calibration.position_only is None:
        return np.zeros(len(coordinates))
    shift: FloatArray = calibration.position_only.shift(hypothesis, [c.base for c in coordinates])
    return shift / np.array([c.width for c in coordinates], dtype=np.float64)
