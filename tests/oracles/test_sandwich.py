"""The covariance for coloured residuals against plain loops, the white formula, and what it promises: coverage."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from clutchid.inference.uncertainty.gaussian import sandwich
from clutchid.numerics.least_squares import compress

pytestmark = pytest.mark.slow


def factor_of(J: np.ndarray) -> np.ndarray:
    return compress(np.column_stack([J, np.zeros(len(J))]))[:-1, :-1]


def coloured(generator: np.random.Generator, n: int, rho: float) -> np.ndarray:
    """A stationary first-order autoregression with unit innovations."""
    noise = generator.standard_normal(n)
    noise[0] /= np.sqrt(1 - rho**2)
    return lfilter([1.0], [1.0, -rho], noise)


def andrews(scores: np.ndarray) -> int:
    """Bandwidth of Andrews (1991) for Bartlett weights, Eqs. (6.2) and (6.4), column by column."""
    n, top, bottom = scores.shape[0], 0.0, 0.0
    for s in scores.T:
        rho = sum(s[t] * s[t + 1] for t in range(n - 1)) / sum(s[t] ** 2 for t in range(n - 1))
        rho = min(0.97, max(-0.97, rho))
        sigma2 = np.mean([(s[t + 1] - rho * s[t]) ** 2 for t in range(n - 1)])
        weight = 1 / np.mean(s**2) ** 2
        top += weight * 4 * rho**2 * sigma2**2 / ((1 - rho) ** 6 * (1 + rho) ** 2)
        bottom += weight * sigma2**2 / (1 - rho) ** 4
    return int(min(n // 4, 1.1447 * (top / bottom * n) ** (1 / 3)))


def plain(J: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, int]:
    """Newey and West with two loops over the samples."""
    n, k = J.shape
    inverse = np.linalg.inv(J.T @ J)
    scores = J * r[:, None]
    bandwidth = andrews(scores @ inverse * np.linalg.norm(J, axis=0))
    middle = np.zeros((k, k))
    for t in range(n):
        for u in range(max(0, t - bandwidth), min(n, t + bandwidth + 1)):
            middle += (1 - abs(t - u) / (bandwidth + 1)) * np.outer(scores[t], scores[u])
    return inverse @ middle @ inverse * n / (n - k), bandwidth


def test_the_covariance_is_that_of_a_plain_double_loop():
    generator = np.random.default_rng(4)
    J = generator.standard_normal((240, 3)) * [1.0, 1e3, 1e-4]
    J[:, 1:] *= 0.2
    J[:, 1] += 1e3 * np.sin(np.arange(240) / 30)
    J[:, 2] += 1e-4 * np.cos(np.arange(240) / 20)
    r = coloured(generator, 240, 0.7)
    expected, bandwidth = plain(J, r)
    computed = sandwich(factor_of(J), [J * r[:, None]])
    assert bandwidth > 2
    # some ten thousand products, well conditioned columns
    np.testing.assert_allclose(computed.matrix, expected, rtol=1e-10, atol=1e-14 * np.abs(expected).max())
    assert computed.degrees_of_freedom == 1.5 * 240 / (bandwidth + 1) - 3


def test_two_segments_are_independent_their_lag_sums_add_up():
    generator = np.random.default_rng(5)
    J = generator.standard_normal((400, 2))
    r = coloured(generator, 400, 0.5)
    scores = J * r[:, None]
    apart = sandwich(factor_of(J), [scores[:150], scores[150:]]).matrix
    together = sandwich(factor_of(J), [scores]).matrix
    assert not np.array_equal(apart, together)
    # only the products across the cut differ: some ten lags out of four hundred samples
    np.testing.assert_allclose(apart, together, atol=0.1 * np.abs(together).max())


def test_long_recordings_are_summed_in_blocks_and_still_see_slow_colours():
    generator = np.random.default_rng(7)
    n, rho, trials = 20000, 0.98, 20
    J = np.column_stack([np.ones(n), np.sin(np.arange(n) / 900)])
    # for regressors slow against the 50 samples of the colour, its variances add up to 1 / (1 - rho)^2
    expected = np.diag(np.linalg.inv(J.T @ J)) / (1 - rho) ** 2
    variances = np.zeros(2)
    for _ in range(trials):
        r = coloured(generator, n, rho)
        variances += np.diag(sandwich(factor_of(J), [J * r[:, None]]).matrix) / trials
    # one estimate scatters by sqrt(4 b / 3 n) = 0.18 with b = 100 of 4000 blocks, the mean of 20 by 0.04; Bartlett's
    # weights lose 50 / (5 * 100) = 0.10 of the variance
    assert np.all(np.abs(variances / expected - (1 - 0.10)) < 3 * 0.04)


def test_a_parameter_without_information_has_infinite_variance_and_leaves_the_others_alone():
    generator = np.random.default_rng(8)
    J = np.column_stack([generator.standard_normal((300, 2)), np.zeros(300)])
    r = generator.standard_normal(300)
    computed = sandwich(factor_of(J), [J * r[:, None]])
    assert np.isinf(computed.matrix[2, 2])
    assert computed.matrix[2, :2].tolist() == [0.0, 0.0]
    alone = sandwich(factor_of(J[:, :2]), [J[:, :2] * r[:, None]]).matrix
    np.testing.assert_allclose(computed.matrix[:2, :2], alone * 298 / 297, rtol=1e-12)


def test_fewer_samples_than_parameters_say_nothing():
    J = np.ones((2, 3))
    assert np.isinf(np.diag(sandwich(np.triu(np.ones((3, 3))), [J]).matrix)).all()


def test_nineteen_of_twenty_intervals_contain_the_truth_when_residuals_are_coloured():
    generator = np.random.default_rng(9)
    n, trials, rho = 4000, 500, 0.8
    t = np.arange(n)
    J = np.column_stack([np.ones(n), np.sin(t / 40), np.where(t % 300 < 90, 1.0, 0.0)])
    R, pseudo = factor_of(J), np.linalg.pinv(J)
    inside, white = np.zeros(3), np.zeros(3)
    naive = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    for _ in range(trials):
        noise = coloured(generator, n, rho)
        error = pseudo @ noise  # estimate minus truth
        r = noise - J @ error
        covariance = sandwich(R, [J * r[:, None]])
        inside += np.abs(error) <= covariance.quantile() * np.sqrt(np.diag(covariance.matrix))
        white += np.abs(error) <= 1.96 * naive * np.std(r)
    # Bartlett's weights cut tails: a colour of (1 + rho) / (1 - rho) / 2 = 4.5 samples and a bandwidth of 45 lose 10 %
    # of the variance, 5 % of the standard error; 1.96 * 0.95 covers 93.7 %. Between the two the count is binomial.
    low, high = binom.ppf(0.001, trials, 0.937), binom.ppf(0.999, trials, 0.95)
    assert np.all((inside >= low) & (inside <= high)), inside / trials
    # the usual formula for white residuals is short by sqrt(1.8 / 0.2) = 3: it covers what 1.96 / 3 covers, 49 %
    assert np.all(white <= binom.ppf(0.999, trials, 0.49 + 0.05))


def test_unknown_starts_of_many_segments_do_not_cost_the_degrees_of_freedom_of_what_is_shared():
    generator = np.random.default_rng(5)
    segments, n = 40, 250
    jacobians = []
    for number in range(segments):
        J = np.zeros((n, 1 + 2 * segments))
        J[:, 0] = generator.standard_normal(n)
        J[:, 1 + 2 * number : 3 + 2 * number] = generator.standard_normal((n, 2))
        jacobians.append(J)
    R = np.linalg.qr(np.vstack(jacobians), mode="r")
    scores = [J * generator.standard_normal((n, 1)) for J in jacobians]
    told = sandwich(R, scores, shared=1)
    # white scores: one lag or two, so thousands of independent samples stand behind the shared parameter
    assert told.degrees_of_freedom > 1000
    assert told.quantile() == pytest.approx(1.96, abs=0.01)
    # 1 / sum of squares, but for the sampling error of its estimate, sqrt(2 / 10^4), seven times
    assert told.matrix[0, 0] == pytest.approx(1 / (R[0, 0] ** 2), rel=0.1)


def test_constants_with_an_error_shift_the_estimate_by_their_pull():
    generator = np.random.default_rng(11)
    n, trials, std = 200, 2000, np.array([0.5, 0.2])
    J, j = generator.standard_normal((n, 3)) * [1.0, 1e4, 1e-3], generator.standard_normal((n, 2))
    R, pseudo, scores = factor_of(J), np.linalg.pinv(J), [J * generator.standard_normal((n, 1))]
    added = sandwich(R, scores, constants=J.T @ j * std).matrix - sandwich(R, scores).matrix
    # the estimate moves by the error of a constant times the pull of its column
    moved = (pseudo @ j @ (std[:, None] * generator.standard_normal((2, trials)))).T
    scale = np.sqrt(np.diag(added))
    # the scatter of a variance over 2000 trials is sqrt(2 / 2000) of it
    np.testing.assert_allclose(np.cov(moved.T) / np.outer(scale, scale), added / np.outer(scale, scale), atol=0.1)
