"""Equal means, lines and independence: against textbook formulas, and at the level that they promise."""

import numpy as np
import pytest
from scipy.stats import binom, linregress

from clutchid.rig.weighted import Component, equality, gls, independent, satterthwaite, student


def own(variances, degrees_of_freedom):
    return [
        Component(np.diag(np.where(np.arange(len(variances)) == i, v, 0.0)), n)
        for i, (v, n) in enumerate(zip(variances, degrees_of_freedom, strict=True))
    ]


def welch(means, variances, degrees_of_freedom):
    """Welch's analysis of variance, as it is printed in textbooks."""
    k, w = len(means), 1 / np.array(variances)
    centre = np.sum(w * means) / w.sum()
    spread = np.sum((1 - w / w.sum()) ** 2 / degrees_of_freedom)
    F = np.sum(w * (means - centre) ** 2) / (k - 1) / (1 + 2 * (k - 2) / (k**2 - 1) * spread)
    return F, (k**2 - 1) / (3 * spread)


def test_means_with_a_variance_each_are_tested_by_welchs_analysis_of_variance():
    generator = np.random.default_rng(2)
    for k in (2, 3, 6):
        means, variances = generator.standard_normal(k), generator.uniform(0.1, 2.0, k)
        freedom = generator.integers(2, 30, k).astype(float)
        F, last = welch(means, variances, freedom)
        test_of_means = equality(means, own(variances, freedom))
        # 1e-12 of the largest square is added to variances of a tenth and more
        assert test_of_means.statistic == pytest.approx(F, rel=1e-10)
        assert test_of_means.degrees_of_freedom == pytest.approx((k - 1, last), rel=1e-10)


def test_a_variance_that_all_means_have_in_common_changes_nothing():
    means, parts = np.array([1.0, 1.5, 0.2]), own([0.1, 0.2, 0.3], [5, 6, 7])
    shared = Component(np.full((3, 3), 4.0), 2.0)
    assert equality(means, [*parts, shared]).p_value == pytest.approx(equality(means, parts).p_value, rel=1e-6)


def test_equal_means_are_rejected_as_often_as_the_level_says():
    generator, trials, rejected = np.random.default_rng(3), 800, 0
    sigma, n = np.array([0.1, 0.3, 0.05, 0.4]), 9
    for _ in range(trials):
        values = 5.0 + sigma[:, None] * generator.standard_normal((4, n))
        parts = own(values.var(axis=1, ddof=1) / n, [n - 1] * 4)
        rejected += equality(values.mean(axis=1), parts).p_value < 0.05
    # Welch's approximation is within 0.5 % of its level for groups of nine
    assert binom.ppf(0.001, trials, 0.045) <= rejected <= binom.ppf(0.999, trials, 0.055)


def test_a_line_through_means_of_one_variance_has_the_textbook_slope_and_standard_error():
    x, y = np.array([1.0, 2.0, 4.0, 7.0]), np.array([3.1, 4.4, 5.8, 9.9])
    X = np.column_stack([np.ones(4), x])
    expected = linregress(x, y)
    scattered = gls(X, y, own([1e-6] * 4, [9] * 4))[1]
    assert scattered.value == pytest.approx(expected.slope, rel=1e-6)
    assert scattered.std == pytest.approx(expected.stderr, rel=1e-6)
    # two levels of freedom are left
    assert (scattered.high - scattered.value) / scattered.std == pytest.approx(4.302653, rel=1e-6)
    quiet = gls(X, y, own([1.0] * 4, [1e9] * 4))[1]
    assert quiet.std == pytest.approx(1 / np.sqrt(np.sum((x - x.mean()) ** 2)), rel=1e-6)
    assert (quiet.high - quiet.value) / quiet.std == pytest.approx(1.959964, rel=1e-6)


def test_means_without_scatter_are_fitted_exactly():
    intercept, slope = gls(np.column_stack([np.ones(2), [1.0, 3.0]]), np.array([2.0, 6.0]), own([0, 0], [1, 1]))
    assert (intercept.value, slope.value) == pytest.approx((0.0, 2.0), abs=1e-9)


def test_one_large_error_in_common_does_not_hide_that_the_means_are_equal_to_a_part_in_a_million():
    swings = np.array([1.0, 1.001, 0.999])
    parts = [*own([1e-16] * 3, [9] * 3), Component(np.outer(swings, swings), 1.0)]
    assert equality(np.array([5.0, 5.0, 5.0]), parts).p_value > 0.9
    assert all(np.isfinite(c.std) for c in gls(np.column_stack([np.ones(3), [1.0, 2.0, 4.0]]), swings, parts))


def test_values_without_order_are_called_dependent_in_one_of_twenty_cases():
    generator, trials = np.random.default_rng(4), 4000
    for n in (4, 10, 30):
        rejected = sum(not independent(generator.standard_normal(n)) for _ in range(trials))
        # two moments of a beta variable: within 1 % of the level, also for four values
        assert binom.ppf(0.001, trials, 0.04) <= rejected <= binom.ppf(0.999, trials, 0.06), n


def test_a_drift_of_three_standard_deviations_over_ten_values_is_nearly_always_seen():
    generator, trials = np.random.default_rng(5), 1000
    seen = sum(not independent(np.linspace(0, 6, 10) + generator.standard_normal(10)) for _ in range(trials))
    assert seen > 0.9 * trials


def test_fewer_than_four_values_or_equal_ones_look_independent():
    assert independent(np.array([1.0, 2.0, 3.0]))
    assert independent(np.full(20, 5.0))


def test_an_interval_without_a_degree_of_freedom_is_infinite():
    assert student(5.0, 1.0, 0.0).std == np.inf
    assert student(5.0, np.inf, 3.0).low == -np.inf
    assert student(5.0, 1.0, 9.0).high == pytest.approx(5 + 2.262157, rel=1e-6)


def test_the_sum_of_two_equal_variances_has_the_freedom_of_both():
    assert satterthwaite([0.3, 0.3], [7, 7]) == pytest.approx(14)
    assert satterthwaite([0.3, 0.0], [7, 1]) == pytest.approx(7)
    assert satterthwaite([0.0], [3]) == np.inf
