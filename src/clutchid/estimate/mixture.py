"""Mean and covariance over hypotheses about what has changed, and the changes with their probabilities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.estimate.changes import Change
from clutchid.estimate.hypotheses import Explanations, errors_in_x, probabilities
from clutchid.estimate.search_result import SolutionT
from clutchid.log import FloatArray
from clutchid.smoother.problem import FitProblem
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.change_prior import GROUPS, Hypothesis, prior_probability

#: Part of the errors of a fit to position alone that is different in another recording.
ERRORS_REPEAT = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Posterior over all hypotheses: mean x (k,), covariance (k, k), and the probability of each hypothesis."""

    x: FloatArray
    covariance: FloatArray
    probability: dict[Hypothesis, float]

    def of_group(self, group: str) -> float:
        """Probability that a group has changed."""
        return sum(p for hypothesis, p in self.probability.items() if group in hypothesis)


def mixture(known: Explanations[SolutionT], calibration: Calibration) -> Mixture:
    """Posterior over the hypotheses `known`.

    The errors that the calibration has found of fits to position alone are subtracted; part of them counts as
    uncertain.
    """
    weights = probabilities(known, calibration)
    means, covariances = [], []
    for hypothesis, one in known.items():
        posterior = one.under(hypothesis)
        shift = errors_in_x(one.result.problem.coordinates, hypothesis, calibration)
        means.append(one.solution.x + posterior.step - shift)
        covariances.append(posterior.covariance + ERRORS_REPEAT**2 * np.outer(shift, shift))
    x = weights @ np.array(means)
    spread = [c + np.outer(m - x, m - x) for m, c in zip(means, covariances, strict=True)]
    return Mixture(
        x, np.einsum("h,hij->ij", weights, np.array(spread)), dict(zip(known, weights.tolist(), strict=True))
    )


def changes(problem: FitProblem, found: Mixture) -> tuple[Change, ...]:
    """What has changed, or may have, in which recording.

    A group is listed if the data make its change more probable than it was before; of its parameters those that have
    moved by more than their standard deviation, but at least the one that has moved most.
    """
    before = prior_probability()
    std = np.sqrt(np.diag(found.covariance))
    result = []
    for stem in problem.stems:
        own = [i for i, c in enumerate(problem.coordinates) if c.stem == stem and c.name in problem.changing]
        for group, directions in GROUPS.items():
            names = {name for direction in directions for name in direction}
            at = [i for i in own if problem.coordinates[i].base in names]
            if at and found.of_group(group) > before[group]:
                moved = np.abs(found.x[at]) / std[at]
                shown = [
                    i for i, far in zip(at, moved.tolist(), strict=True) if far > min(1.0, float(moved.max()) - 1e-9)
                ]
                result += [_change(problem, found, i, stem, group, float(std[i])) for i in shown]
    return tuple(result)


def _change(problem: FitProblem, found: Mixture, at: int, stem: str, group: str, std: float) -> Change:
    c, x = problem.coordinates[at], float(found.x[at])
    before, after = problem.actuator.value(c.base), c.si(x)
    return Change(
        stem, c.base, before, after, std * c.slope(x), problem.actuator.unit(c.base), found.of_group(group), group
    )
