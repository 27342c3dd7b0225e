"""One sample of the filter against the textbook, which forms covariances and inverts them."""

import numpy as np
import pytest

from clutchid.filter.recursion import correct, triangularise, update, weigh
from clutchid.simulation.sensors import lag_coefficients

N, K = 4, 3
#: Far from every error: nothing counts as an outlier.
NEVER = 1e9


@pytest.fixture
def drawn():
    """State, derivatives, square root beside process noise, and a measured combination of the states."""
    rng = np.random.default_rng(0)
    W = np.column_stack([rng.standard_normal((N, N)), np.diag([0.1, 0.0, 2.0, 0.3])])
    return rng.standard_normal(N), rng.standard_normal((N, K)), W, rng.standard_normal(N)


def test_a_triangle_has_the_same_covariance_as_the_wide_matrix(drawn):
    W = drawn[2].copy()
    before = W @ W.T
    triangularise(W)
    assert np.array_equal(W, np.tril(W))
    assert pytest.approx(before, abs=1e-14 * np.abs(before).max() * N**2) == W @ W.T


def test_a_row_of_zeros_is_no_trouble_to_a_triangle():
    W = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 2.0, 0.0]])
    triangularise(W)
    assert np.array_equal(W[0], np.zeros(4))
    assert pytest.approx(np.array([[0.0, 0.0], [0.0, 9.0]]), rel=1e-14) == W @ W.T


def taken(drawn, e, sigma, outlier):
    x, dx, W, c = (part.copy() for part in drawn)
    gain = np.zeros(N + 1)
    weigh(W, np.concatenate([c @ dx, c @ W]), e, sigma, outlier, gain)
    correct(x, dx, gain, c @ dx, e, K)
    return x, dx, W @ W.T, gain


def test_a_measurement_moves_state_derivatives_and_covariance_as_the_textbook_says(drawn):
    x, dx, W, c = drawn
    P, e, sigma = W @ W.T, 0.7, 0.5
    s = c @ P @ c + sigma**2
    gain = P @ c / s
    new_x, new_dx, new_P, found = taken(drawn, e, sigma, NEVER)
    assert found == pytest.approx([*gain, s])
    assert new_x == pytest.approx(x + gain * e)
    assert new_dx == pytest.approx((np.eye(N) - np.outer(gain, c)) @ dx)
    assert new_P == pytest.approx((np.eye(N) - np.outer(gain, c)) @ P)


def test_an_outlier_moves_the_state_as_a_sensor_would_whose_error_lies_at_the_bound(drawn):
    x, _, W, c = drawn
    P, sigma, outlier = W @ W.T, 0.5, 3.0
    s = c @ P @ c + sigma**2
    e = 5 * outlier * np.sqrt(s)
    new_x, _, new_P, found = taken(drawn, e, sigma, outlier)
    assert new_x == pytest.approx(x + P @ c / (5 * s) * e)
    assert found[-1] == pytest.approx(s), "the error is judged by the variance that was foreseen"
    worse = np.sqrt(5 * s - c @ P @ c)
    assert new_P == pytest.approx(taken(drawn, e, worse, NEVER)[2])


#: Two of the N rows are what the sensors show, of the first state and of the last of the model.
STATE = np.array([0, 1])


def arrays(k, size, fixed):
    """What `update` works on, for one sample: x, S and what was before; then where it writes."""
    rng = np.random.default_rng(1)
    S = rng.standard_normal((size, k if fixed else k + size))
    now = rng.standard_normal(size), S, rng.standard_normal((2, 1 + S.shape[1]))
    output = np.empty((1, 2, k + 1)), np.empty((1, 2, 2)), np.empty((1, size - 2)), np.empty((1, k + 1))
    return now, output


def test_a_sample_without_measurements_adds_the_process_noise_and_says_nothing():
    (x, S, before), output = arrays(K, N, fixed=False)
    P, start = S[:, K:] @ S[:, K:].T, x.copy()
    noise, none = np.array([[0.1, 0.2]]), np.full((1, 2), np.nan)
    lags = np.tile([0.0, 0.0, 1.0, 0.0, 1e3, -1e3], (1, 2, 1))
    sensors, own, gains = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, NEVER]), np.full(4, -1), np.zeros((1, 2, N + 1))
    update(0, False, (x, S, before), none, noise, lags, sensors, own, STATE, gains, output, False)
    # sensors without a lag show the states of this sample, with its noise
    shows = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]])
    assert S[:, K:] @ S[:, K:].T == pytest.approx(shows @ (P + np.diag([0.01, 0.04, 0.0, 0.0])) @ shows.T)
    assert x == pytest.approx(shows @ start)
    assert np.array_equal(output[0], np.zeros((1, 2, K + 1)))
    assert np.isnan(output[1]).all()
    assert output[3][0, -1] == pytest.approx(np.sqrt(P[1, 1] + 0.04))
    assert before == pytest.approx(np.column_stack([x[STATE], S[STATE]]))


@pytest.mark.parametrize("fixed", [False, True])
def test_the_compiled_sample_does_what_its_python_text_says(fixed):
    measured, noise = np.array([[0.4, 0.9]]), np.full((1, N - 2), 0.1)
    sensors, own = np.array([5e-4, 2e-4, 0.1, 0.3, 0.6, 0.7, 1.0]), np.array([0, -1, -1, 2])
    lags = np.stack([lag_coefficients(tau, np.array([1e-3])) for tau in (5e-4, 2e-4)], axis=1)
    results = []
    for function in (update, update.py_func):
        now, output = arrays(K, N, fixed)
        gains = np.random.default_rng(2).standard_normal((1, 2, N + 1)) ** 2
        function(0, False, now, measured, noise, lags, sensors, own, STATE, gains, output, fixed)
        results.append([*now, *output, gains])
    for compiled, plain in zip(*results, strict=True):
        assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-12)
