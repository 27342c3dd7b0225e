"""On a linear model the filter, smoothed backwards, is the off-line smoother, and both are batch least squares."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.setup import ModelArrays, scratch
from clutchid.inference.smoother.rows import eliminate, recover
from clutchid.simulation.sensors import lag_coefficients
from fixtures.filters import NO_FREE, A, B, callbacks, move, without_adaptation

#: States of the model, and with the outputs of two sensors without a lag, of states 0 and 2; samples.
N, SIZE, SAMPLES = 3, 5, 40
MEASURED = [0, 2]
SENSORS = np.array([[3, 0, -1, -1], [4, 2, -1, -1]])
OFFSETS, SIGMA = np.array([0.05, -0.02]), np.array([0.3, 0.2])
#: Far from every innovation: none counts as an outlier.
NEVER = 1e9


def linear_step(x, S, u, p, h, substeps, breakpoints, load, basis, b, c, slot, row, column, work):
    move(x, S, u, work)
    return True


@pytest.fixture(scope="module")
def step():
    """The linear model with the type of a generated step."""
    return callbacks(linear_step)[0]


@pytest.fixture(scope="module")
def recording():
    """Inputs, values with some missing, process noise, and mean and root of the covariance of the first state."""
    random = np.random.default_rng(11)
    values = random.standard_normal((SAMPLES, 2))
    values[7, 1] = values[20:24, 0] = np.nan
    root = np.tril(0.3 * random.standard_normal((N, N))) + np.eye(N)
    noise = 0.05 + 0.1 * random.random((SAMPLES - 1, N))
    return random.standard_normal((SAMPLES, 1)), values, noise, random.standard_normal(N), root


@pytest.fixture(scope="module")
def filtered(step, recording):
    """Predicted and corrected mean and root of each sample, and the corrected root as the model moves it."""
    kernels, (u, values, noise, mean, root) = kernels_in("clutchid.inference.filter.recursion"), recording
    breakpoints, basis, none = np.zeros(1), np.zeros((1, 2, 4)), [np.zeros(0, np.int64)] * 5
    for table in (breakpoints, basis):
        table.flags.writeable = False
    model = ModelArrays(np.zeros(1), breakpoints, np.zeros((2, 4)), basis, *none, np.zeros(N))
    lags = np.array([lag_coefficients(0.0, np.array([1e-3]))[0]] * 2)
    S = np.zeros((SIZE, SIZE))
    S[:N, :N], S[N:, :N] = root, root[MEASURED]
    state = without_adaptation(np.append(mean, mean[MEASURED]), S, 0)
    room, gain, means = scratch(SIZE, SIZE, state.T, N, 2), np.empty(SIZE + 1), []
    for i in range(SAMPLES):
        moved = np.zeros((N, SIZE))
        if i > 0:
            assert kernels.move(step, state.x, S, model, (u[i - 1], 1e-3, 1), SENSORS, lags, room.before)
            moved = S[:N].copy()
            kernels.add_process_noise(S, noise[i - 1], SENSORS, lags[:, 2], room.W)
        predicted = state.x[:N].copy(), S[:N].copy()
        for m in range(2):
            if np.isfinite(values[i, m]):
                measurement = values[i, m], OFFSETS[m], SIGMA[m], NEVER
                kernels.correct(state.x, state, SENSORS[m], measurement, False, NO_FREE, np.ones(0), gain, room)
        means.append((*predicted, state.x[:N].copy(), S[:N].copy(), moved))
    return means


def smoothed(filtered):
    """Means and covariances by the backward pass of the RTS smoother over what the filter has found."""
    means, covariances = [filtered[-1][2]], [filtered[-1][3] @ filtered[-1][3].T]
    for before, after in zip(filtered[-2::-1], filtered[:0:-1], strict=True):
        predicted, L, _, _, moved = after
        _, _, corrected, root, _ = before
        P = L @ L.T
        gain = np.linalg.solve(P, moved @ root.T).T
        means.append(corrected + gain @ (means[-1] - predicted))
        covariances.append(root @ root.T + gain @ (covariances[-1] - P) @ gain.T)
    return np.array(means[::-1]), np.array(covariances[::-1])


def rows_of(recording):
    """Rows ``[x_0 | r]``, ``[x_i | r]`` and ``[x_i | x_i+1 | r]`` of the chain of states, at states 0."""
    u, values, noise, mean, root = recording
    inverse = np.linalg.inv(root)
    first = np.column_stack([inverse, -inverse @ mean])
    windows, links = np.zeros((SAMPLES, 2, N + 1)), np.zeros((SAMPLES - 1, N, 2 * N + 1))
    for i in range(SAMPLES):
        for m, state in enumerate(MEASURED):
            if np.isfinite(values[i, m]):
                windows[i, m, [state, N]] = np.array([1.0, OFFSETS[m] - values[i, m]]) / SIGMA[m]
        if i > 0:
            links[i - 1] = np.column_stack([-A, np.eye(N), -B * u[i - 1, 0]]) / noise[i - 1][:, None]
    return first, windows, links


@pytest.fixture(scope="module")
def batch(recording):
    """Means (samples, n) and covariances (samples, n, n) by one dense least-squares problem in all states."""
    first, windows, links = rows_of(recording)
    rows = [np.column_stack([first[:, :N], np.zeros((N, N * (SAMPLES - 1))), first[:, N:]])]
    for blocks in (windows, links):
        for i, block in enumerate(blocks):
            row = np.zeros((len(block), N * SAMPLES + 1))
            row[:, i * N : i * N + block.shape[1] - 1], row[:, -1] = block[:, :-1], block[:, -1]
            rows.append(row)
    whole = np.vstack(rows)
    means = np.linalg.lstsq(whole[:, :-1], -whole[:, -1], rcond=None)[0].reshape(SAMPLES, N)
    covariance = np.linalg.inv(whole[:, :-1].T @ whole[:, :-1]).reshape(SAMPLES, N, SAMPLES, N)
    return means, np.array([covariance[i, :, i] for i in range(SAMPLES)])


@pytest.mark.slow
def test_the_filter_ends_where_batch_least_squares_do(filtered, batch):
    _, _, x, S, _ = filtered[-1]
    assert x == pytest.approx(batch[0][-1], abs=1e-9)
    assert pytest.approx(batch[1][-1], abs=1e-9) == S @ S.T


def test_the_filter_smoothed_backwards_is_batch_least_squares(filtered, batch):
    means, covariances = smoothed(filtered)
    assert means == pytest.approx(batch[0], abs=1e-9)
    assert covariances == pytest.approx(batch[1], abs=1e-9)
    assert np.trace(covariances[0]) < 0.9 * np.trace(filtered[0][3] @ filtered[0][3].T)


def test_the_smoother_of_windows_finds_the_same_states(recording, filtered, batch):
    chain = eliminate(*rows_of(recording))
    states = recover(chain, np.zeros((0, 1)))[:, :, 0]
    assert states == pytest.approx(batch[0], abs=1e-9)
    assert states == pytest.approx(smoothed(filtered)[0], abs=1e-9)
