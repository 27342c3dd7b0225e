"""Mean and covariance over hypotheses about what has changed, and the changes with their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from clutchid.estimation.changes import Change
from clutchid.estimation.hypotheses import Explanations, errors_in_x, flattened, probabilities
from clutchid.estimation.search_result import SolutionT
from clutchid.inference.smoother.problem import FitProblem
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, Hypothesis, prior_probability
from clutchid.log import FloatArray
from clutchid.parameters import GROUPS, Row

#: Part of the errors of a fit to position alone that is different in another recording.
ERRORS_REPEAT = 0.5

#: A viscous friction below this share of the calibrated one counts as this share.
LEAST_RATIO = 0.1


class Band(NamedTuple):
    """How certain the load is taken to be. Provenance: `benchmarks/bands.py`, docs/derivations.md, "Intervals".

    `evidence` is the part of the logarithm of the evidence that counts: a likelihood of correlated residuals is too
    sure of the best hypothesis; `missed` the standard deviation of what the model misses of the load, as a share of it,
    where the viscous friction is larger or smaller by a factor of e.
    """

    evidence: float = 0.5
    missed: float = 0.03


#: As shipped.
BAND = Band()


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Posterior over hypotheses: mean x (k,), covariance (k, k), and the probability of each that was searched."""

    x: FloatArray
    covariance: FloatArray
    probability: dict[Hypothesis, float]

    def of_group(self, group: str) -> float:
        """Probability that a group has changed."""
        return sum(p for hypothesis, p in self.probability.items() if group in hypothesis)


def mixture(
    known: Explanations[SolutionT], calibration: Calibration, misfit: float = 1.0, band: Band = BAND
) -> Mixture:
    """Posterior over the hypotheses: mean over those `known`, covariance over all of them.

    The errors that the calibration has found of fits to position alone are subtracted; part of them counts as
    uncertain. The covariance is about the mean, with the flattened evidence of every hypothesis; those without a search
    are judged by the linearisation at the best one.

    Parameters
    ----------
    misfit : 1
        See `Departure`: where the model misses more than in the calibration recordings, all covariances are as much
        larger.
    band : Band
        How certain the load is taken to be.
    """
    probability = dict(zip(known, probabilities(known, calibration).tolist(), strict=True))
    best = known[max(probability, key=probability.__getitem__)]
    explanations = {hypothesis: known.get(hypothesis, best) for hypothesis in HYPOTHESES}
    posteriors = {hypothesis: one.under(hypothesis) for hypothesis, one in explanations.items()}
    means, covariances = {}, {}
    for hypothesis, one in explanations.items():
        problem, posterior = one.result.problem, posteriors[hypothesis]
        shift = errors_in_x(problem.coordinates, hypothesis, calibration)
        means[hypothesis] = one.solution.x + posterior.step - shift
        missed = band.missed * _log_friction(problem, means[hypothesis]) * _scale_of_load(problem, means[hypothesis])
        covariances[hypothesis] = (
            posterior.covariance + ERRORS_REPEAT**2 * np.outer(shift, shift) + np.outer(missed, missed)
        )
    x = np.sum([p * means[hypothesis] for hypothesis, p in probability.items()], axis=0)
    covariance = sum(
        weight * (np.fmax(1.0, misfit) * covariances[h] + np.outer(means[h] - x, means[h] - x))
        for h, weight in flattened(posteriors, calibration, band.evidence).items()
    )
    return Mixture(x, np.asarray(covariance), probability)


def _log_friction(problem: FitProblem, x: FloatArray) -> float:
    """How far the viscous friction is from the calibrated one, as a logarithm, rms over the recordings."""
    calibrated = problem.actuator.value("D_v")
    found = [c.si(value) for c, value in zip(problem.coordinates, x.tolist(), strict=True) if c.base == "D_v"]
    logarithms = [np.log(max(value / calibrated, LEAST_RATIO)) for value in found if calibrated > 0.0]
    return float(np.sqrt(np.mean(np.square(logarithms)))) if logarithms else 0.0


def _scale_of_load(problem: FitProblem, x: FloatArray) -> FloatArray:
    """Direction in x, shape (k,), in which the load grows by its own size."""
    weights = problem.actuator.load.names
    of_each = zip(problem.coordinates, x.tolist(), strict=True)
    return np.array([c.si(value) / c.slope(value) if c.base in weights else 0.0 for c, value in of_each])


def changes(problem: FitProblem, found: Mixture) -> tuple[Change, ...]:
    """What has changed, or may have, in which recording.

    A group is listed if the data at least double the odds of its change; of its parameters those that have
    moved by more than their standard deviation, but at least the one that has moved most.
    """
    before = prior_probability()
    std = np.sqrt(np.diag(found.covariance))
    result = []
    for stem in problem.stems:
        own = [i for i, c in enumerate(problem.coordinates) if c.stem == stem and c.name in problem.changing]
        for group in GROUPS:
            at = [i for i in own if _of_group(problem.actuator.rows[problem.coordinates[i].base], group)]
            if at and _odds(found.of_group(group)) >= 2.0 * _odds(before[group]):
                moved = np.abs(found.x[at]) / std[at]
                shown = [
                    i for i, far in zip(at, moved.tolist(), strict=True) if far > min(1.0, float(moved.max()) - 1e-9)
                ]
                result += [_change(problem, found, i, stem, group, float(std[i])) for i in shown]
    return tuple(result)


def _of_group(row: Row, group: str) -> bool:
    return any(change.group == group for change in row.changes)


def _odds(probability: float) -> float:
    return probability / max(1.0 - probability, np.finfo(float).tiny)


def _change(problem: FitProblem, found: Mixture, at: int, stem: str, group: str, std: float) -> Change:
    c, x = problem.coordinates[at], float(found.x[at])
    before, after = problem.actuator.value(c.base), c.si(x)
    return Change(
        stem, c.base, before, after, std * c.slope(x), problem.actuator.unit(c.base), found.of_group(group), group
    )
