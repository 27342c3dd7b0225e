"""Moments and quantiles of a mixture of normal distributions, against sampling and the normal distribution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.numerics.interval import QUANTILE

SUPPLY, VALVES = ("supply pressure",), ("valves",)


def mixture(weights=(0.7, 0.2, 0.1), means=((0.0, 0.0), (3.0, 1.0), (-8.0, 2.0))):
    covariances = [[[1.0, 0.5], [0.5, 2.0]], [[2.0, -0.6], [-0.6, 0.5]], [[0.3, 0.0], [0.0, 0.1]]]
    weights = np.array(weights)
    return Mixture(((), SUPPLY, SUPPLY + VALVES), weights, weights, np.array(means), np.array(covariances))


ONE = Mixture(((),), np.ones(1), np.ones(1), np.array([[2.0, -1.0]]), np.array([[[4.0, 1.0], [1.0, 0.5]]]))


def test_its_moments_are_those_of_its_samples():
    rng, mixed, draws = np.random.default_rng(1), mixture(), 200_000
    which = rng.choice(3, draws, p=mixed.weights)
    roots = np.linalg.cholesky(mixed.covariances)[which]
    samples = mixed.means[which] + np.einsum("nij,nj->ni", roots, rng.standard_normal((draws, 2)))
    error = 4.0 * np.sqrt(np.diag(mixed.covariance) / draws)
    assert np.all(np.abs(samples.mean(axis=0) - mixed.x) < error)
    np.testing.assert_allclose(np.cov(samples.T), mixed.covariance, rtol=0.05)


def test_the_probability_of_a_group_is_that_of_its_hypotheses():
    mixed = mixture()
    assert mixed.of_group("supply pressure") == pytest.approx(0.3)
    assert mixed.of_group("valves") == pytest.approx(0.1)
    assert mixed.of_group("leak") == 0.0


def test_the_interval_of_one_normal_distribution_is_its_own():
    low, high = ONE.interval(np.eye(2))
    half = norm.ppf(0.975) * np.sqrt([4.0, 0.5])
    np.testing.assert_allclose([low, high], [ONE.x - half, ONE.x + half], atol=1e-4)
    assert norm.ppf(0.975) == pytest.approx(QUANTILE, abs=1e-4)


def test_the_ends_of_an_interval_are_quantiles_of_what_is_linear_in_x():
    mixed, row = mixture(), np.array([2.0, -1.0])
    means, std = mixed.means @ row, np.sqrt(np.einsum("i,hij,j->h", row, mixed.covariances, row))
    expected = [
        brentq(lambda q, level=level: mixed.weights @ norm.cdf((q - means) / std) - level, -100.0, 100.0)
        for level in (0.025, 0.975)
    ]
    (low,), (high,) = mixed.interval(row[None])
    assert (low, high) == pytest.approx(tuple(expected), abs=1e-4)
    mean = float(mixed.x @ row)
    assert mean - low > 1.5 * (high - mean), "an improbable hypothesis far to one side makes it lopsided"


def test_the_mean_lies_in_its_interval_however_far_away_an_improbable_hypothesis_is():
    far = mixture((0.97, 0.01, 0.02), ((0.0, 0.0), (1e3, 0.0), (0.0, 1e3)))
    low, high = far.interval(np.eye(2))
    assert np.all(low <= far.x)
    assert np.all(far.x <= high)


def test_weights_that_are_less_sure_spread_it_about_the_same_mean():
    sure = mixture()
    spread = replace(sure, weights=np.array([0.4, 0.3, 0.3]))
    np.testing.assert_array_equal(spread.x, sure.x)
    assert spread.of_group("supply pressure") == sure.of_group("supply pressure")
    apart = sure.means - sure.x
    expected = np.einsum("h,hij->ij", spread.weights, sure.covariances + apart[:, :, None] * apart[:, None])
    np.testing.assert_allclose(spread.covariance, expected)
    (low, *_), (high, *_) = spread.interval(np.eye(2))
    (narrow_low, *_), (narrow_high, *_) = sure.interval(np.eye(2))
    assert low < narrow_low < narrow_high < high


def test_a_moved_mixture_has_the_same_covariance():
    step = np.array([0.5, -2.0])
    mixed, moved = mixture(), mixture().moved(step)
    np.testing.assert_allclose(moved.x, mixed.x + step)
    np.testing.assert_allclose(moved.covariance, mixed.covariance)


def test_a_known_change_of_one_parameter_moves_the_others_as_their_covariance_says():
    np.testing.assert_allclose(ONE.slope([1], np.array([0.5])), [1.0 / 0.5 * 0.5, 0.5])
    shapes = [P[:, 0] / P[0, 0] for P in mixture().covariances]
    np.testing.assert_allclose(mixture().slope([0], np.ones(1)), mixture().weights @ shapes)
