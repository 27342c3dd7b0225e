"""Hypotheses about changes since a calibration, weighed by their evidence, and the posterior over them.

The load is read from position alone under each hypothesis of `clutchid.inference.uncertainty.change_prior`. All are
first judged by the linearisation of the most probable one so far; a search follows only for those that may matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from clutchid.estimation.method import ChangeFunctions, SearchResult
from clutchid.estimation.result import Change
from clutchid.inference.problem import Problem, prior_rows, with_hypothesis
from clutchid.inference.smoother.problem import data_factor
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import (
    HYPOTHESES,
    LOG_ODDS_TOGETHER,
    Hypothesis,
    log_odds,
    prior_probability,
)
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.inference.uncertainty.gaussian import GaussianPosterior, gaussian_posterior
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray
from clutchid.names import ParameterName
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Solution
from clutchid.numerics.progress import Progress, within_stage
from clutchid.parameters import GROUPS, Row

#: A hypothesis is searched if its probability may be above this.
_LEAST_PROBABILITY = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """The recordings explained under a hypothesis: search, and factor ``[R | q]`` of the data at its solution.

    Where the dispersion of the data, see `clutchid.inference.smoother.residuals`, is above 1, their rows are divided by
    its root; `scatter` is the dispersion where it is below. Weighting such data more made the loads of changed trucks
    worse.
    """

    result: SearchResult
    solution: Solution[Any]
    data: FloatArray
    scatter: float

    def under(self, hypothesis: Hypothesis) -> GaussianPosterior:
        """Posterior under another hypothesis, by the linearisation at this solution."""
        problem = with_hypothesis(self.result.problem, hypothesis)
        return gaussian_posterior(self.data, prior_rows(problem, self.solution.x), log_root(problem), self.scatter)


#: Explanations by their hypothesis.
Explanations = Mapping[Hypothesis, Explanation]


def explained(
    result: SearchResult, method: ChangeFunctions, calibration: Calibration, progress: Progress | None = None
) -> dict[Hypothesis, Explanation]:
    """Explanations under every hypothesis that may matter, from the search that assumed no change.

    Where all searches together have had their evaluations, the best one has not converged.

    Parameters
    ----------
    result : SearchResult
        With a solution, under the hypothesis of no change.
    method : ChangeFunctions
        How a search goes on under another hypothesis.
    calibration : Calibration
        Its errors from position alone are what a hypothesis explains without any change.
    progress : function(step), optional
        Called at each evaluation with their number in all searches.
    """
    none: Hypothesis = ()
    dispersion = calibration.position_only.dispersion if calibration.position_only else 1.0
    explanations = {none: explanation(result, dispersion)}
    count = explanations[none].solution.evaluations
    failed: set[Hypothesis] = set()
    while True:
        best = most_probable(explanations, calibration)
        start = explanations[best]
        if count >= result.effort.whole:
            ended = replace(start.solution, status="limit", evaluations=count)
            return explanations | {best: replace(start, solution=ended)}
        candidate = _candidate(explanations, best, failed, calibration)
        if candidate is None:
            return explanations
        step = start.under(candidate).step
        problem = with_hypothesis(start.result.problem, candidate)
        x = np.clip(start.solution.x + step, *problem.bounds())
        limited = replace(start.result, effort=result.effort.after(count))
        again = method.refine(limited, problem, x, within_stage(progress, "changes", count))
        if isinstance(again.solution, Failure):
            failed.add(candidate)
        else:
            count += again.solution.evaluations
            explanations[candidate] = explanation(again, dispersion)


def explanation(search_result: SearchResult, dispersion: float) -> Explanation:
    """The explanation of a search with a solution; `dispersion` is that of the data."""
    assert not isinstance(search_result.solution, Failure), "a failed search explains nothing"
    data = data_factor(search_result.problem, search_result.solution.at)
    return Explanation(
        search_result, search_result.solution, data / np.sqrt(max(1.0, dispersion)), min(1.0, dispersion)
    )


def _candidate(
    searched: Explanations, best: Hypothesis, failed: set[Hypothesis], calibration: Calibration
) -> Hypothesis | None:
    """The most probable hypothesis without a search, by the linearisation of the best; None if none may matter."""
    others = [h for h in HYPOTHESES if h not in searched and h not in failed]
    scores = [hypothesis_score(searched[best].under(h), h, calibration) for h in others]
    scores += [hypothesis_score(explained.under(h), h, calibration) for h, explained in searched.items()]
    probability = softmax(scores)[: len(others)]
    if not others or probability.max() < _LEAST_PROBABILITY:
        return None
    return others[int(np.argmax(probability))]


def probabilities(searched: Explanations, calibration: Calibration) -> FloatArray:
    """Probability of each hypothesis, in the order of `searched`."""
    return softmax([hypothesis_score(explained.under(h), h, calibration) for h, explained in searched.items()])


def flattened(scores: FloatArray, part: float) -> FloatArray:
    """Weights of all hypotheses for the interval, (h,), from the logarithms of their odds.

    Of the logarithm of their evidence only `part` counts, and several changes at once are not less probable than each.
    """
    odds = np.array([log_odds(hypothesis) for hypothesis in HYPOTHESES])
    together = np.array([max(0, len(hypothesis) - 1) for hypothesis in HYPOTHESES]) * LOG_ODDS_TOGETHER
    return softmax(part * (scores - odds) + odds - together)


def hypothesis_score(posterior: GaussianPosterior, hypothesis: Hypothesis, calibration: Calibration) -> float:
    """Logarithm of the odds of a hypothesis: evidence, beyond that in the calibration recordings, and prior odds.

    What a change would explain in the calibration recordings, where nothing has changed, is an error of the model.
    """
    errors = calibration.position_only
    of_model = max(0.0, errors.evidence(hypothesis)) if errors else 0.0
    return posterior.log_evidence - of_model + log_odds(hypothesis)


def softmax(scores: Sequence[float] | FloatArray) -> FloatArray:
    """Probabilities from logarithms of odds."""
    odds = np.exp(np.asarray(scores) - np.max(scores))
    result: FloatArray = odds / odds.sum()
    return result


def log_root(problem: Problem) -> float:
    """Logarithm of the determinant of the root of the joint prior."""
    return 0.0 if problem.prior_root is None else float(np.linalg.slogdet(problem.prior_root)[1])


def errors_in_x(coordinates: Sequence[Coordinate], hypothesis: Hypothesis, calibration: Calibration) -> FloatArray:
    """Error in x, shape (k,), of a fit to position alone under a hypothesis, as on the calibration recordings."""
    if calibration.position_only is None:
        return np.zeros(len(coordinates))
    shift: FloatArray = calibration.position_only.shift(hypothesis, [c.base for c in coordinates])
    return shift / np.array([c.width for c in coordinates], dtype=np.float64)


#: Part of the errors of a fit to position alone that is different in another recording.
ERRORS_REPEAT = 0.5

#: A viscous friction below this share of the calibrated one counts as this share.
_LEAST_RATIO = 0.1


#: Least position in m at which a constant error of the load is required: at rest the load of the paper's basis is 0.
_NEAR_REST = 5e-4


class IntervalSettings(NamedTuple):
    """Settings of the interval of the load. Provenance: `benchmarks/bands.py`, docs/derivations.md, "Intervals".

    `evidence` is the part of the logarithm of the evidence that counts, because a wrong explanation is often as good as
    the right one; `missed` the standard deviation of what the model misses of the load, as a share of it, where the
    viscous friction is larger or smaller by a factor of e; `least` that of the load at any position, as a share of its
    peak; `scale` multiplies the standard deviations that the data leave under a hypothesis.
    """

    evidence: float = 0.3
    missed: float = 0.03
    least: float = 0.003
    scale: float = 1.0


#: As shipped, from position alone and where the supply pressure is recorded.
INTERVAL_SETTINGS = IntervalSettings()
WITH_SUPPLY = IntervalSettings(scale=0.7)


def interval_settings(problem: Problem) -> IntervalSettings:
    """Settings of the interval of a load, by whether all of its recordings measure the supply pressure."""
    measured = all(str(ParameterName("P_S", stem)) in problem.measured for stem in problem.stems)
    return WITH_SUPPLY if measured else INTERVAL_SETTINGS


def mixture(
    searched: Explanations, calibration: Calibration, misfit: float = 1.0, settings: IntervalSettings | None = None
) -> Mixture:
    """Posterior over the hypotheses: mean over those `searched`, spread over all of them.

    Those without a search are judged by the linearisation at the best one. The errors that the calibration has found of
    fits to position alone are subtracted; part of them counts as uncertain.

    Parameters
    ----------
    misfit : 1
        See `Departure`: where the model misses more than in the calibration recordings, all covariances are as much
        larger.
    settings : IntervalSettings, optional
        Of the interval of the load; by default by whether the supply pressure is measured.
    """
    best = most_probable(searched, calibration)
    band = settings or interval_settings(searched[best].result.problem)
    explanations = {hypothesis: searched.get(hypothesis, searched[best]) for hypothesis in HYPOTHESES}
    scores, means, covariances = [], [], []
    for hypothesis, explained in explanations.items():
        problem, posterior = explained.result.problem, explained.under(hypothesis)
        shift = errors_in_x(problem.coordinates, hypothesis, calibration)
        mean = explained.solution.x + posterior.step - shift
        missed = band.missed * _log_friction(problem, mean) * _scale_of_load(problem, mean)
        least = band.least * _constant_load(problem, mean)
        scores.append(hypothesis_score(posterior, hypothesis, calibration))
        means.append(mean)
        covariances.append(
            np.fmax(1.0, misfit)
            * (
                band.scale**2 * (posterior.covariance + ERRORS_REPEAT**2 * np.outer(shift, shift))
                + np.outer(missed, missed)
            )
            + np.outer(least, least)
        )
    probability = dict(zip(searched, probabilities(searched, calibration).tolist(), strict=True))
    return Mixture(
        tuple(explanations),
        np.array([probability.get(hypothesis, 0.0) for hypothesis in explanations]),
        flattened(np.array(scores), band.evidence),
        np.array(means),
        np.array(covariances),
    )


def most_probable(searched: Explanations, calibration: Calibration) -> Hypothesis:
    """The most probable of the hypotheses with a search."""
    return max(
        searched, key=dict(zip(searched, probabilities(searched, calibration).tolist(), strict=True)).__getitem__
    )


def _log_friction(problem: Problem, x: FloatArray) -> float:
    """Logarithm of the viscous friction over the calibrated one, rms over the recordings."""
    calibrated = problem.actuator.value("D_v")
    frictions = [c.si(value) for c, value in zip(problem.coordinates, x.tolist(), strict=True) if c.base == "D_v"]
    logarithms = [np.log(max(value / calibrated, _LEAST_RATIO)) for value in frictions if calibrated > 0.0]
    return float(np.sqrt(np.mean(np.square(logarithms)))) if logarithms else 0.0


def _scale_of_load(problem: Problem, x: FloatArray) -> FloatArray:
    """Direction in x, shape (k,), in which the load grows by its own size."""
    weights = problem.actuator.load.names
    of_each = zip(problem.coordinates, x.tolist(), strict=True)
    return np.array([c.si(value) / c.slope(value) if c.base in weights else 0.0 for c, value in of_each])


def _constant_load(problem: Problem, x: FloatArray) -> FloatArray:
    """Direction in x, shape (k,), in which the load grows by its peak at all positions alike, as far as it can."""
    load = problem.load_of(x)
    at = [i for i, c in enumerate(problem.coordinates) if c.base in load.names]
    columns = [load.names.index(problem.coordinates[i].base) for i in at]
    y = np.linspace(_NEAR_REST, problem.actuator.parameters.y_max, 100)
    phi, direction = load.phi(y)[:, columns] * problem.slopes(x)[at], np.zeros_like(x)
    direction[at] = np.linalg.lstsq(phi, np.full(y.size, load.force(y).max()), rcond=None)[0]
    return direction


def changes(problem: Problem, posterior: Mixture) -> tuple[Change, ...]:
    """Changes, certain or suspected, by recording.

    A group is listed if the data at least double the odds of its change; of its parameters those that have
    moved by more than their standard deviation, but at least the one that has moved most.
    """
    before = prior_probability()
    std = np.sqrt(np.diag(posterior.covariance))
    result = []
    for stem in problem.stems:
        own = [i for i, c in enumerate(problem.coordinates) if c.stem == stem and c.name in problem.changing]
        for group in GROUPS:
            at = [i for i in own if _of_group(problem.actuator.rows[problem.coordinates[i].base], group)]
            if at and _odds(posterior.of_group(group)) >= 2.0 * _odds(before[group]):
                moved = np.abs(posterior.x[at]) / std[at]
                shown = [
                    i for i, far in zip(at, moved.tolist(), strict=True) if far > min(1.0, float(moved.max()) - 1e-9)
                ]
                result += [_change(problem, posterior, i, stem, group, float(std[i])) for i in shown]
    return tuple(result)


def _of_group(row: Row, group: str) -> bool:
    return any(change.group == group for change in row.changes)


def _odds(probability: float) -> float:
    return probability / max(1.0 - probability, np.finfo(float).tiny)


def _change(problem: Problem, posterior: Mixture, at: int, stem: str, group: str, std: float) -> Change:
    c, x = problem.coordinates[at], float(posterior.x[at])
    before, after = problem.actuator.value(c.base), c.si(x)
    return Change(
        stem, c.base, before, after, std * c.slope(x), problem.actuator.unit(c.base), posterior.of_group(group), group
    )
