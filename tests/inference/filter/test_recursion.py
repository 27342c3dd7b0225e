"""`predict` and `correct` against the textbook, which forms covariances and inverts them."""

import numpy as np
import pytest

from clutchid.inference.filter.setup import FilterOutput, FilterState, Intervals, ModelArrays, scratch
from clutchid.simulation.sensors import lag_coefficients
from fixtures.filters import NO_FREE, A, B, D, allocated, arrays_for, without_adaptation

#: States of the model, and with two outputs of sensors; free parameters.
N, SIZE, K = 3, 5, 3
#: The outputs stand last, of states 0 and 2; the lag of the first sensor and the offset of the second are parameters.
SENSORS = np.array([[3, 0, 0, -1], [4, 2, -1, 2]])
#: Far from every innovation: none counts as an outlier.
NEVER = 1e9
#: Parameters of the model.
PARAMETERS = np.array([0.7, -0.3])
#: Lags of the sensors in s.
TAU = (5e-4, 2e-4)


def model_arrays():
    breakpoints, basis, places = np.zeros(1), np.zeros((1, 2, 4)), [np.zeros(0, dtype=np.int64)] * 5
    for table in (breakpoints, basis):  # as those of an actuator, so that nothing is compiled for these tests alone
        table.flags.writeable = False
    return ModelArrays(PARAMETERS, breakpoints, np.zeros((2, 4)), basis, *places, np.zeros(N))


def drawn_state(correlated=False):
    rng = np.random.default_rng(1)
    return without_adaptation(rng.standard_normal(SIZE), rng.standard_normal((SIZE, K if correlated else K + SIZE)), K)


def pass_over(samples, correlated=False):
    """Arguments of `follow` but for the functions of the model, for some samples."""
    rng, state, dt = np.random.default_rng(2), drawn_state(correlated), np.full(samples - 1, 1e-3)
    lags = np.stack([lag_coefficients(tau, dt) for tau in TAU], axis=1)
    u, sigma = rng.standard_normal((samples, 1)), np.full((samples - 1, N), 0.1)
    values = rng.standard_normal((samples, 2))
    values[1, 0] = np.nan
    gains = 0.1 * rng.standard_normal((samples, 2, SIZE + 1)) ** 2
    output = FilterOutput(
        np.empty((samples, 2, 2)), np.empty((samples, N)), np.empty((0, N)), gains, np.empty((samples, 2, K + 1)),
        np.empty((samples, K + 1)),
    )  # fmt: skip
    arrays = arrays_for(state, model_arrays(), SENSORS, [[0.1, 0.6], [0.3, 0.7]], TAU, 1.0, watched=2)
    return state, arrays, Intervals(u, dt, np.ones(samples - 1, np.int32), sigma, lags), values, output, (0, samples, 0)


def test_a_triangle_has_the_same_covariance_as_the_wide_matrix(kernels):
    random = np.random.default_rng(0)
    W = np.hstack([random.standard_normal((SIZE, SIZE)), np.tril(random.standard_normal((SIZE, N)))])
    before = W @ W.T
    kernels.lower_triangular(W)
    assert np.array_equal(W, np.tril(W))
    assert pytest.approx(before, abs=1e-14 * np.abs(before).max() * SIZE**2) == W @ W.T


def test_a_row_of_zeros_is_no_trouble_to_a_triangle(kernels):
    W = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 2.0, 0.0]])
    kernels.lower_triangular(W)
    assert np.array_equal(W[0], np.zeros(4))
    assert pytest.approx(np.array([[0.0, 0.0], [0.0, 9.0]]), rel=1e-14) == W @ W.T


def test_a_prediction_moves_state_derivatives_and_covariance_as_the_textbook_says(kernels, calls):
    state, lags = drawn_state(), np.concatenate([lag_coefficients(tau, np.array([1e-3])) for tau in (5e-4, 2e-3)])
    x, S, u, sigma = state.x.copy(), state.S.copy(), np.array([0.4]), np.array([0.1, 0.2, 0.3])
    room = scratch(SIZE, K + SIZE, state.T, N, 2)
    kernels.move(calls[0], x, S, model_arrays(), (u, 1e-3, 1), SENSORS, lags, room.before)
    kernels.add_process_noise(S, sigma, SENSORS, lags[:, 2], room.W)
    F, G, forced = np.zeros((SIZE, SIZE)), np.zeros((SIZE, N)), np.zeros(SIZE)
    F[:N, :N], G[:N], forced[:N] = A, np.eye(N), B * u[0] + D.T @ PARAMETERS
    by_parameter = np.zeros((SIZE, K))
    by_parameter[:N, :2] = D.T
    for m, (output, measured, _, _) in enumerate(SENSORS):
        a, b, c = lags[m, :3]
        F[output, :N], F[output, output] = c * A[measured], a
        F[output, measured] += b
        G[output, measured], forced[output] = c, c * forced[measured]
        by_parameter[output, :2] = c * D.T[measured]
    new = F @ state.x + forced
    by_parameter[3, 0] += lags[0, 3:] @ [state.x[3], state.x[0], new[0]]
    L = state.S[:, K:]
    assert x == pytest.approx(new)
    assert S[:, :K] == pytest.approx(F @ state.S[:, :K] + by_parameter)
    assert S[:, K:] @ S[:, K:].T == pytest.approx(F @ L @ L.T @ F.T + G @ np.diag(sigma**2) @ G.T)


def corrected(kernels, value, sigma, outlier, sensor=1):
    """State, derivatives, covariance and gain after one measurement."""
    state, gain = drawn_state(), np.zeros(SIZE + 1)
    room, measurement = scratch(SIZE, K + SIZE, state.T, N, 2), (value, 0.3, sigma, outlier)
    e = kernels.correct(state.x, state, SENSORS[sensor], measurement, False, NO_FREE, np.ones(K), gain, room)
    L = state.S[:, K:]
    return state.x, state.S[:, :K], L @ L.T, gain, e


def test_a_measurement_moves_state_derivatives_and_covariance_as_the_textbook_says(kernels):
    (x, S, *_), c, sigma = drawn_state(), np.eye(SIZE)[4], 0.5
    P, dx = S[:, K:] @ S[:, K:].T, S[:, :K]
    s = c @ P @ c + sigma**2
    gain, e = P @ c / s, 1.7 - (x[4] + 0.3)
    new_x, new_dx, new_P, gains, innovation = corrected(kernels, 1.7, sigma, NEVER)
    assert innovation == pytest.approx(e)
    assert gains == pytest.approx([*gain, s])
    assert new_x == pytest.approx(x + gain * e)
    # the offset of this sensor is the last free parameter
    assert new_dx == pytest.approx(dx - np.outer(gain, c @ dx + np.eye(K)[2]))
    assert new_P == pytest.approx((np.eye(SIZE) - np.outer(gain, c)) @ P)


def test_an_outlier_moves_the_state_as_a_sensor_would_whose_error_lies_at_the_bound(kernels):
    (x, S, *_), c, sigma, outlier = drawn_state(), np.eye(SIZE)[4], 0.5, 3.0
    P = S[:, K:] @ S[:, K:].T
    s = c @ P @ c + sigma**2
    value = x[4] + 0.3 + 5 * outlier * np.sqrt(s)
    new_x, _, new_P, gains, e = corrected(kernels, value, sigma, outlier)
    assert new_x == pytest.approx(x + P @ c / (5 * s) * e)
    assert gains[-1] == pytest.approx(s), "the innovation is judged by the predicted variance"
    worse = np.sqrt(5 * s - c @ P @ c)
    assert new_P == pytest.approx(corrected(kernels, value, worse, NEVER)[2])


def test_a_given_gain_moves_state_and_derivatives_alone(kernels):
    state, gain = drawn_state(correlated=True), np.arange(1.0, SIZE + 2.0)
    moved, room = drawn_state(correlated=True), scratch(SIZE, K, state.T, N, 2)
    e = kernels.correct(moved.x, moved, SENSORS[0], (0.4, 0.1, 0.6, NEVER), False, NO_FREE, np.ones(K), gain, room)
    assert e == pytest.approx(0.3 - state.x[3])
    assert moved.x == pytest.approx(state.x + gain[:SIZE] * e)
    assert pytest.approx(state.S - np.outer(gain[:SIZE], state.S[3])) == moved.S


def test_a_copy_of_the_state_rewinds_the_filter(kernels, calls):
    state, *others = pass_over(4)
    before = FilterState(*(array.copy() for array in state))
    kernels.follow_segment(*calls, state, *others)
    assert np.abs(state.x - before.x).max() > 0.1
    kernels.follow_segment(*calls, before, *others)
    for again, once in zip(before, state, strict=True):
        assert np.array_equal(again, once)


@pytest.mark.parametrize("correlated", [False, True])
def test_the_compiled_recursion_does_what_its_python_text_says(kernels, calls, correlated):
    results = []
    for follow in (kernels.follow_segment, kernels.follow_segment.py_func):
        state, *arguments = pass_over(6, correlated)
        assert follow(*calls, state, *arguments) == -1
        results.append([*state, *arguments[3]])
    for compiled, plain in zip(*results, strict=True):
        # six samples of sums of some ten terms of order one
        assert compiled == pytest.approx(plain, rel=1e-11, abs=1e-11, nan_ok=True)


def test_a_missing_measurement_has_a_row_of_zeros_and_no_innovation(kernels, calls):
    arguments = pass_over(3)
    kernels.follow_segment(*calls, *arguments)
    errors, rows = arguments[4].errors, arguments[4].rows
    assert np.isnan(errors[1, 0]).all()
    assert np.array_equal(rows[1, 0], np.zeros(K + 1))
    assert np.isfinite(np.delete(errors.reshape(6, 2), 2, axis=0)).all()


def test_the_first_sample_that_is_not_finite_is_named(kernels, calls):
    arguments = pass_over(6)
    arguments[2].inputs[3] = np.nan  # of the interval before sample 4
    assert kernels.follow_segment(*calls, *arguments) == 4


def test_a_sample_allocates_nothing(kernels, calls):
    few, many = ((*calls, *pass_over(samples)) for samples in (3, 300))
    assert allocated(kernels.follow_segment, few) == allocated(kernels.follow_segment, many)
