"""The posterior over hypotheses of a small linear problem, against normal distributions of its data and sampling."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from clutchid.errors import ParameterError
from clutchid.estimation.hypotheses import (
    ERRORS_REPEAT,
    INTERVAL_SETTINGS,
    WITH_SUPPLY,
    Explanation,
    IntervalSettings,
    changes,
    errors_in_x,
    flattened,
    interval_settings,
    mixture,
    probabilities,
    softmax,
)
from clutchid.estimation.method import SearchResult
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.uncertainty.calibration import Calibration, PositionOnlyErrors
from clutchid.inference.uncertainty.change_prior import HYPOTHESES as ALL
from clutchid.inference.uncertainty.change_prior import change_priors, log_odds, prior_probability
from clutchid.inference.uncertainty.coordinates import Prior, coordinates
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.model import Actuator
from clutchid.parameters import GROUPS
from clutchid.simulation.noise import Noise

NAMES = ("theta_1", "P_S@w", "C_vs@w", "D_v@w")
NONE, SUPPLY, VALVES = (), ("supply pressure",), ("valves",)
HYPOTHESES = (NONE, SUPPLY, VALVES, SUPPLY + VALVES)

#: Rows ``[J | r]`` of the data at x = 0: the supply has changed rather than the valves.
DATA = np.array([
    [0.5, 2.0, 1.5, 0.4, -2.2], [-0.4, 3.0, 2.5, -0.3, -3.4], [0.3, 1.0, -2.0, 0.6, -0.6], [0.0, 0.5, 0.5, -0.8, 0.8]
])  # fmt: skip


@pytest.fixture(scope="module")
def problem():
    actuator = Actuator()
    priors = {f"{name}@w": change_priors(actuator)[name] for name in ("P_S", "C_vs", "D_v")}
    return Problem(
        actuator=actuator,
        coordinates=coordinates(actuator, NAMES, {}, priors),
        stems=("w",),
        measure=("position",),
        noise=Noise(),
        curvature=1.0,
        changing=NAMES[1:],
    )


def explanations(problem, x=(0.0, 0.0, 0.0, 0.0), scatter=1.0, size=1.0):
    """The data linearised at x under every hypothesis; `size` scales the residuals at x = 0."""
    x = np.array(x)
    data = DATA.copy()
    data[:, -1] = size * data[:, -1] + DATA[:, :-1] @ x
    solution = SimpleNamespace(x=x, status="converged", evaluations=1)
    explanation = Explanation(SearchResult(problem, solution), solution, data, scatter)
    return dict.fromkeys(HYPOTHESES, explanation)


def calibration(**errors):
    return Calibration((), np.zeros((0, 0)), position_only=PositionOnlyErrors(**errors) if errors else None)


def gaussians(problem, hypotheses=HYPOTHESES):
    """Density of the data, mean and covariance of x under each hypothesis, from the joint distribution of both."""
    J, target = DATA[:, :-1], -DATA[:, -1]
    densities, means, covariances = [], [], []
    for hypothesis in hypotheses:
        root = with_hypothesis(problem, hypothesis).prior_root
        prior = np.linalg.inv(root.T @ root)
        data = np.eye(4) + J @ prior @ J.T
        gain = prior @ J.T @ np.linalg.inv(data)
        densities.append(multivariate_normal(np.zeros(4), data).pdf(target))
        means.append(gain @ target)
        covariances.append(prior - gain @ J @ prior)
    return np.array(densities), np.array(means), np.array(covariances)


def weights_of(densities, hypotheses=HYPOTHESES):
    weights = densities * np.exp([log_odds(hypothesis) for hypothesis in hypotheses])
    return weights / weights.sum()


def band_weights(densities):
    """Weights of all hypotheses in the band: part of the evidence, and a change does not make another less probable."""
    weights = densities**INTERVAL_SETTINGS.evidence * np.exp([sum(GROUPS[group] for group in h) for h in ALL])
    return weights / weights.sum()


def missed(problem, mean):
    """Covariance of what the model misses of the load, here of its first weight, as far as the friction has changed."""
    weight, friction = problem.coordinates[0], problem.coordinates[3]
    share = INTERVAL_SETTINGS.missed * np.log(friction.si(mean[3]) / problem.actuator.value("D_v"))
    size = weight.si(mean[0]) / weight.slope(mean[0])
    return np.diag([(share * size) ** 2, 0.0, 0.0, 0.0])


def least(problem, mean):
    """Covariance of the least error of the load: of its only free weight, as near to a constant as it comes."""
    load = problem.actuator_of(mean, "w").load
    y = np.linspace(5e-4, problem.actuator.parameters.y_max, 100)
    phi = load.phi(y)[:, load.names.index("theta_1")] * problem.coordinates[0].slope(mean[0])
    size = INTERVAL_SETTINGS.least * load.force(y).max() * phi.sum() / (phi @ phi)
    return np.diag([size**2, 0.0, 0.0, 0.0])


def inside_and_between(problem, x, shift_of=lambda _hypothesis: np.zeros(4), misfit=1.0):
    """Parts of the covariance about x: of the hypotheses, with errors `shift_of`, and between them."""
    densities, means, covariances = gaussians(problem, ALL)
    shifts = np.array([shift_of(hypothesis) for hypothesis in ALL])
    inside = [
        misfit * (c + missed(problem, m - s) + ERRORS_REPEAT**2 * np.outer(s, s)) + least(problem, m - s)
        for m, c, s in zip(means, covariances, shifts, strict=True)
    ]
    weights, apart = band_weights(densities), means - shifts - x
    return np.einsum("h,hij->ij", weights, inside), np.einsum("h,hi,hj->ij", weights, apart, apart)


def test_probabilities_are_those_of_the_data_under_each_prior(problem):
    weights = weights_of(gaussians(problem)[0])
    weighted = probabilities(explanations(problem), calibration())
    assert weighted == pytest.approx(weights, abs=1e-10)
    assert weighted.sum() == pytest.approx(1.0, abs=1e-12)
    assert weighted.min() > 1e-3, "all of them have to matter"
    elsewhere = probabilities(explanations(problem, (0.3, -1.0, 2.0, 0.5)), calibration())
    assert elsewhere == pytest.approx(weights, abs=1e-10), "wherever a linear problem is linearised"


def test_the_mean_is_that_of_the_weighted_gaussians(problem):
    densities, means, _ = gaussians(problem)
    weights = weights_of(densities)
    posterior = mixture(explanations(problem), calibration())
    np.testing.assert_allclose(posterior.x, weights @ means, atol=1e-10)
    assert posterior.of_group("supply pressure") == pytest.approx(weights[1] + weights[3])
    assert posterior.of_group("temperature and grease") == 0.0


def test_the_covariance_is_about_that_mean_with_a_part_of_the_evidence(problem):
    posterior = mixture(explanations(problem), calibration())
    assert posterior.weights == pytest.approx(band_weights(gaussians(problem, ALL)[0]), abs=1e-10)
    inside, between = inside_and_between(problem, posterior.x)
    np.testing.assert_allclose(posterior.covariance, inside + between, atol=1e-10)
    assert np.abs(between).max() > 0.02, "the hypotheses have to differ"


def test_a_misfit_widens_what_each_hypothesis_leaves_open_and_a_good_fit_narrows_nothing(problem):
    explained = explanations(problem)
    as_usual, better, unknown, worse = (mixture(explained, calibration(), m) for m in (1.0, 0.5, np.nan, 2.0))
    for hypothesis in (better, unknown):
        np.testing.assert_array_equal(hypothesis.covariance, as_usual.covariance)
    inside, between = inside_and_between(problem, worse.x, misfit=2.0)
    np.testing.assert_allclose(worse.covariance, inside + between, atol=1e-9)
    np.testing.assert_allclose(worse.x, as_usual.x, atol=1e-12)


def test_a_recorded_supply_narrows_what_the_data_leave_open_under_a_hypothesis(problem):
    measured = replace(problem, measured={"P_S@w": Prior(9e5, 7e3)})
    assert interval_settings(measured) == WITH_SUPPLY
    assert interval_settings(problem) == INTERVAL_SETTINGS
    explained = explanations(problem)
    wide, narrow = (mixture(explained, calibration(), settings=s) for s in (IntervalSettings(), WITH_SUPPLY))
    fixed = mixture(explained, calibration(), settings=IntervalSettings(scale=0.0)).covariances
    ratio = WITH_SUPPLY.scale**2
    np.testing.assert_allclose(narrow.covariances, fixed + ratio * (wide.covariances - fixed), atol=1e-12)
    assert ratio < 1.0


def test_a_mean_where_no_actuator_is_admissible_has_a_covariance(problem):
    # recordings of another truck have led to air of 1050 K by linearisation
    posterior = mixture(explanations(problem, size=1e3), calibration())
    with pytest.raises(ParameterError, match="P_S"):
        problem.actuator_of(posterior.x, "w")
    assert np.all(np.linalg.eigvalsh(posterior.covariance) > 0.0)


def test_the_band_gives_an_explanation_that_is_nearly_as_good_its_weight():
    scores = np.array([0.0, -4.0, *[-50.0] * (len(ALL) - 2)])
    spread = flattened(scores, INTERVAL_SETTINGS.evidence)
    assert spread[1] > 5.0 * softmax(scores)[1]
    assert spread.sum() == pytest.approx(1.0)


def test_data_that_scatter_less_than_assumed_change_the_covariance_only(problem):
    as_assumed, less = (mixture(explanations(problem, scatter=s), calibration()) for s in (1.0, 0.25))
    for estimate, expected in ((less.weights, as_assumed.weights), (less.probabilities, as_assumed.probabilities)):
        np.testing.assert_array_equal(estimate, expected)
    np.testing.assert_allclose(less.x, as_assumed.x, atol=1e-12)
    assert np.all(np.diag(less.covariance) < np.diag(as_assumed.covariance))


def test_errors_of_position_alone_are_subtracted_and_a_part_of_them_is_uncertain(problem):
    errors = {
        "hypotheses": (NONE, SUPPLY),
        "names": ("C_vs", "theta_1"),
        "shifts": np.array([[0.03, 2e3], [-0.02, -5e3]]),
        "log_evidence": np.zeros(2),
    }
    widths = np.array([c.width for c in problem.coordinates])
    wanted = {NONE: np.array([2e3, 0.0, 0.03, 0.0]) / widths, SUPPLY: np.array([-5e3, 0.0, -0.02, 0.0]) / widths}
    plain, corrected = (mixture(explanations(problem), calibration(**options)) for options in ({}, errors))
    shifts = [wanted.get(hypothesis, wanted[NONE]) for hypothesis in ALL]
    np.testing.assert_allclose(plain.means - corrected.means, shifts, atol=1e-12)
    for hypothesis in (NONE, SUPPLY):
        shift = errors_in_x(problem.coordinates, hypothesis, calibration(**errors))
        np.testing.assert_allclose(shift, wanted[hypothesis])
    inside, between = inside_and_between(problem, corrected.x, lambda h: wanted.get(h, wanted[NONE]))
    np.testing.assert_allclose(corrected.covariance, inside + between, atol=1e-9)
    unknown = errors_in_x(problem.coordinates, VALVES, calibration(**errors))
    np.testing.assert_array_equal(unknown, wanted[NONE], "a hypothesis that is not known has the errors of none")


def test_what_a_change_explains_in_the_calibration_recordings_is_no_evidence_for_it(problem):
    def errors(gain):
        return {
            "hypotheses": (NONE, SUPPLY),
            "names": (),
            "shifts": np.zeros((2, 0)),
            "log_evidence": np.array([-100.0, -100.0 + gain]),
        }

    plain, more, less = (
        probabilities(explanations(problem), calibration(**options)) for options in ({}, errors(1.5), errors(-1.5))
    )
    assert np.log(more[1] / more[0]) == pytest.approx(np.log(plain[1] / plain[0]) - 1.5)
    assert more[2] / more[0] == pytest.approx(plain[2] / plain[0])
    assert less == pytest.approx(plain), "what explained less than nothing there speaks for no change here"


def posterior(x, std, **probability):
    hypotheses = {"none": NONE, "supply": SUPPLY, "valves": VALVES}
    places = tuple(hypotheses[name] for name in probability)
    means, covariances = np.array([x] * len(places)), np.array([np.diag(np.square(std))] * len(places))
    weights = np.array([*probability.values()])
    return Mixture(places, weights, weights, means, covariances)


def test_a_change_has_its_value_before_and_after_its_deviation_and_the_probability_of_its_group(problem):
    (change,) = changes(problem, posterior([0.0, -1.0, 0.1], [1.0, 0.2, 0.5], none=0.02, supply=0.96, valves=0.02))
    width = problem.coordinates[1].width
    after = 9e5 * np.exp(-width)
    assert (change.recording, change.name, change.unit, change.group) == ("w", "P_S", "Pa", "supply pressure")
    assert (change.before, change.after) == (9e5, pytest.approx(after))
    assert change.std == pytest.approx(0.2 * width * after)
    assert change.probability == pytest.approx(0.96)


def test_a_group_is_listed_if_the_data_double_the_odds_of_its_change(problem):
    def doubled(group):
        odds = 2.0 * prior_probability()[group] / (1.0 - prior_probability()[group])
        return odds / (1.0 + odds)

    below, above = doubled("supply pressure") - 0.01, doubled("valves") + 0.01
    assert changes(problem, posterior([0.0, -1.0, 0.1], [1.0, 0.2, 0.5], none=1.0 - below, supply=below)) == ()
    # the valves have moved by less than their standard deviation
    (change,) = changes(problem, posterior([0.0, -1.0, 0.1], [1.0, 0.2, 0.5], none=1.0 - above, valves=above))
    assert (change.name, change.probability) == ("C_vs", pytest.approx(above))
