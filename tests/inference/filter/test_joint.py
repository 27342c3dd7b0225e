"""The joint recursion on a linear model, against the textbook filter of the augmented state and batch least squares."""

import numpy as np
import pytest

from clutchid.inference.filter.setup import (
    Derived,
    FilterArrays,
    FilterOutput,
    FilterState,
    FreeArrays,
    Intervals,
    ModelArrays,
    SettingsArrays,
    Window,
    scratch,
)
from clutchid.simulation.sensors import lag_coefficients
from clutchid.simulation.stiffness import AS_PLANNED
from fixtures.filters import A, B, D, allocated

#: States of the model and with the outputs of two sensors; parameters: two in the model, and the offset of a sensor.
N, SIZE, K, SAMPLES = 3, 5, 3, 40
SENSORS = np.array([[3, 0, -1, -1], [4, 2, -1, 2]])
MEAN, WIDTH = np.array([0.4, -0.2, 0.1]), np.array([0.5, 0.3, 0.2])
TAU, OFFSETS, SIGMA = np.array([5e-4, 2e-4]), np.array([0.05, 0.0]), np.array([0.3, 0.2])
NEVER = 1e9


def recording():
    """Inputs, values with one missing, and process noise."""
    random = np.random.default_rng(5)
    values = random.standard_normal((SAMPLES, 2))
    values[7, 1] = np.nan
    return random.standard_normal((SAMPLES, 1)), values, 0.1 * random.random((SAMPLES - 1, N))


def drawn():
    """State before the first sample."""
    random = np.random.default_rng(6)
    T = np.tril(0.2 * random.standard_normal((K, K))) + np.eye(K)
    moved, none = np.eye(SIZE, K + SIZE, K), np.zeros((4, 1), np.int64)
    return FilterState(
        random.standard_normal(SIZE), random.standard_normal((SIZE, K + SIZE)), 0.1 * random.standard_normal(K), T,
        np.zeros(SIZE), moved, none[0], np.zeros((SIZE, 0)), np.zeros((K, 0)), np.zeros(SIZE), np.zeros_like(moved),
        np.zeros(SIZE), none[1], np.zeros(2), none[2], none[3],
    )  # fmt: skip


def arguments(every, span=(0, SAMPLES), noise=1.0):
    u, values, sigma = recording()
    dt = np.full(SAMPLES - 1, 1e-3)
    lags = np.stack([lag_coefficients(tau, dt) for tau in TAU], axis=1)
    places = np.array([[-1, 0, -1, -1], [-1, 1, -1, -1], [-1, 2, -1, 1]])
    numbers = np.column_stack([MEAN, WIDTH, *np.array([[0.0, -np.inf, np.inf, -50.0, 50.0]] * K).T])
    breakpoints, basis, none = np.zeros(1), np.zeros((1, 2, 4)), np.zeros(0, np.int64)
    for table in (breakpoints, basis):
        table.flags.writeable = False
    model = ModelArrays(np.zeros(3), breakpoints, np.zeros((2, 4)), basis, *[none] * 5, np.zeros(N))
    derived = Derived(np.zeros(1), TAU.copy(), np.column_stack([OFFSETS, SIGMA]), np.ones(K))
    window = Window(none, np.arange(K), none, none, none)
    room = scratch(SIZE, K + SIZE, np.zeros((K, K)), N, 2)
    count = span[1] - span[0]
    output = FilterOutput(
        np.empty((count, 2, 2)), np.empty((count, N)), np.empty((count, N)), np.empty((1, 2, SIZE + 1)),
        np.empty((0, 2, 1)), np.empty((0, 1)),
    )  # fmt: skip
    intervals = Intervals(u, dt, np.ones(SAMPLES - 1, np.int32), noise * sigma, lags)
    settings = SettingsArrays(every, NEVER, -1.0, 1, 0, -1)
    free = FreeArrays(numbers, places, np.zeros((1, 2), np.int64))
    arrays = FilterArrays(model, free, derived, SENSORS, settings, AS_PLANNED, window, room)
    return (arrays, intervals, values, output, (*span, 0)), output


def textbook(every, noise=1.0, samples=SAMPLES):
    """Mean and covariance of (x, parameters in SI) by a Kalman filter that forms covariances."""
    u, values, sigma = recording()
    x, S, theta, T, *_ = drawn()
    root = np.block([[S[:, :K] * WIDTH @ T, S[:, K:]], [WIDTH[:, None] * T, np.zeros((K, SIZE))]])
    z, P = np.concatenate([x, MEAN + WIDTH * theta]), root @ root.T
    a, b, c = np.stack([lag_coefficients(tau, np.array([1e-3]))[0, :3] for tau in TAU]).T
    F, G, g = np.eye(SIZE + K), np.zeros((SIZE + K, N)), np.zeros(SIZE + K)
    F[:N, :N], F[:N, SIZE : SIZE + 2], G[:N], g[:N] = A, D.T, np.eye(N), B
    for m, (output, state, _, _) in enumerate(SENSORS):
        F[output] = c[m] * F[state]
        F[output, output], F[output, state] = a[m], F[output, state] + b[m]
        G[output], g[output] = c[m] * G[state], c[m] * g[state]
    waiting = np.zeros(N)
    for i in range(samples):
        if i > 0:
            z, P = F @ z + g * u[i - 1], F @ P @ F.T
            waiting += (noise * sigma[i - 1]) ** 2
        if i % every == 0:
            P, waiting = P + G @ np.diag(waiting) @ G.T, np.zeros(N)
            for m, (output, _, _, offset) in enumerate(SENSORS):
                if np.isnan(values[i, m]):
                    continue
                h = np.eye(SIZE + K)[output]
                if offset >= 0:
                    h[SIZE + offset] = 1.0
                gain = P @ h / (h @ P @ h + SIGMA[m] ** 2)
                z = z + gain * (values[i, m] - h @ z - (0.0 if offset >= 0 else OFFSETS[m]))
                P = P - np.outer(gain, h @ P)
    return z, P


def joint_moments(state):
    x, S, theta, T, _, moved, *_ = state
    S = moved[:, K:] @ S + np.hstack([moved[:, :K], np.zeros((SIZE, SIZE))])
    root = np.block([[S[:, :K] * WIDTH @ T, S[:, K:]], [WIDTH[:, None] * T, np.zeros((K, SIZE))]])
    return np.concatenate([x, MEAN + WIDTH * theta]), root @ root.T


def followed(kernels, calls, *args, **options):
    state = drawn()
    inputs, output = arguments(*args, **options)
    assert kernels.follow_segment(*calls, state, *inputs) == -1
    return state, output


@pytest.mark.parametrize(("every", "noise"), [(1, 1.0), (4, 1.0), (10, 1.0), (1, 0.0)])
def test_on_a_linear_model_a_correction_that_ends_late_is_that_of_the_kalman_filter(kernels, calls, every, noise):
    state, _ = followed(kernels, calls, every, noise=noise)
    z, P = textbook(every, noise)
    mean, covariance = joint_moments(state)
    assert mean == pytest.approx(z, abs=1e-9)
    assert covariance == pytest.approx(P, abs=1e-9)


def test_deviations_are_those_of_the_covariance_and_there_are_none_between_corrections(kernels, calls):
    every = SAMPLES // 2
    _, (errors, _, deviations, *_) = followed(kernels, calls, every)
    _, P = textbook(every, samples=every + 1)
    assert deviations[-1] == pytest.approx(np.sqrt(np.diag(P)[:N]), abs=1e-9), "of the sample whose correction ends"
    for output in (deviations[:, 0], errors[:, 0, 0]):
        assert np.isfinite(output).nonzero()[0].tolist() == [every - 1, SAMPLES - 1]


def test_drift_adds_its_covariance_column_by_column_to_that_of_the_parameters(kernels):
    T, wear = drawn()[3], np.array([2 * K])
    root = 0.2 * T
    before = T @ T.T
    for columns in range(1, 2 * K + 1):
        kernels.add_drift(T, root, wear, np.empty((2, K)))
        added = np.hstack([root, root])[:, :columns]
        assert pytest.approx(before + added @ added.T, abs=1e-12) == T @ T.T
        assert np.array_equal(T, np.tril(T))
    assert wear[0] == 0


def test_strokes_that_have_ended_widen_what_is_known_a_column_a_correction(kernels, calls):
    state, worn = drawn(), drawn()
    worn.wear[0] = K
    for at in (state, worn):
        (arrays, *inputs), _ = arguments(4, noise=0.0)
        arrays = arrays._replace(settings=arrays.settings._replace(drifts=0.5 * np.eye(K), least_speed=np.inf))
        kernels.follow_segment(*calls, at, arrays, *inputs)
    assert worn.wear[0] == 0
    assert pytest.approx(state.T @ state.T.T + 0.25 * np.eye(K), abs=1e-12) == worn.T @ worn.T.T


def test_parameters_stay_within_their_bounds_and_the_states_move_as_far_as_they_do(kernels, calls):
    inputs, _ = arguments(1)
    inputs[0].free.numbers[:, 5:] = -0.05, 0.05
    state = drawn()
    state[2][:] = 0.0
    kernels.follow_segment(*calls, state, *inputs)
    assert np.abs(state[2]).max() == 0.05
    assert np.isfinite(state[0]).all()


def test_a_sample_allocates_nothing(kernels, calls):
    few, all_samples = ((*calls, drawn(), *arguments(1, span=(0, last))[0]) for last in (4, SAMPLES))
    assert allocated(kernels.follow_segment, few) == allocated(kernels.follow_segment, all_samples)
