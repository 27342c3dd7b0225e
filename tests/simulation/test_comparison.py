"""The inner loops of estimation against plain twins of NumPy."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.numerics.least_squares import triangular
from clutchid.simulation.sensors import lagged
from fixtures.sensors import lag_derivative

STEP, SIGMA, OUTLIER = 1e-3, 5e-5, 4.0


@pytest.fixture(scope="module")
def by():
    return kernels_in("clutchid.simulation.comparison")


@pytest.fixture(scope="module")
def window():
    """States, their derivatives to six numbers, and what was measured of two states, with holes."""
    rng = np.random.default_rng(4)
    states = np.cumsum(1e-4 * rng.standard_normal((60, 4)), axis=0)
    measured = states[:, (0, 2)].T + 2e-4 * rng.standard_normal((2, 60))
    measured[0, [0, 7, 59]], measured[1, 20:30] = np.nan, np.nan
    return states, rng.standard_normal((60, 3, 6)), measured


def sensors(lags=(2e-3, -1e-3)):
    return np.array([(0, lags[0], 1e-4, STEP, SIGMA), (2, lags[1], -2e-4, STEP, 2 * SIGMA)])


def compared(window, lags, slopes):
    """Rows of a window as NumPy makes them, column after column: [six | its lag | its offset | r]."""
    states, sens, measured = window
    parts = []
    for number, (at, tau, offset, _, sigma) in enumerate(sensors(lags)):
        x, own = states[:, int(at)], np.zeros((60, 2))
        shown = lagged(x, tau, STEP)
        if number == 0:
            own = np.column_stack([lag_derivative(x, shown, tau, STEP), np.ones(60)])
        J = np.column_stack([lagged(sens[:, int(at)], tau, STEP), own]) * slopes
        parts.append(np.column_stack([J, shown + offset - measured[number]]) / sigma)
    rows = np.vstack(parts)
    return rows[np.isfinite(rows[:, -1])]


@pytest.mark.parametrize("lags", [(2e-3, -1e-3), (0.0, 5e-3), (1e-4, 1e-3)])
def test_rows_of_a_window_are_those_of_numpy_without_the_missing_samples(by, window, lags):
    slopes, own = np.linspace(0.5, 3.0, 8), np.array([(6, 7), (-1, -1)])
    rows = np.full((120, 9), np.nan)
    count = by.compare(*window[:2], sensors(lags), own, window[2], slopes, rows)
    expected = compared(window, lags, slopes)
    assert count == 120 - 13
    assert rows[:count] == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_the_cost_of_a_window_is_the_sum_of_the_losses_of_its_rows(by, window):
    r = compared(window, (2e-3, -1e-3), np.ones(8))[:, -1]
    size = np.abs(r)
    expected = np.where(size > OUTLIER, OUTLIER * (2 * size - OUTLIER), size**2).sum()
    assert (size > OUTLIER).any()
    assert (size < OUTLIER).any()
    assert by.compare_cost(window[0], sensors(), window[2], OUTLIER) == pytest.approx(expected, rel=1e-9)
    values = np.empty(1)
    by.row_losses(r[None], OUTLIER, values)
    assert values[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("shape", [(104, 34), (40, 7), (5, 9), (1, 1), (3000, 6), (257, 3)])
def test_the_triangular_factor_is_that_of_numpy_whatever_the_shape(shape):
    A = np.random.default_rng(sum(shape)).standard_normal(shape)
    R = triangular(A)
    expected = np.linalg.qr(A, mode="r")
    assert R.shape == expected.shape
    assert np.array_equal(R, np.triu(R))
    assert R * np.sign(np.diag(R))[:, None] == pytest.approx(expected * np.sign(np.diag(expected))[:, None], abs=1e-11)


def test_a_column_of_zeros_stays_one_and_the_others_keep_their_information():
    A = np.random.default_rng(2).standard_normal((300, 6))
    A[:, 2] = 0.0
    R = triangular(A)
    assert np.all(R[:, 2] == 0.0)
    assert np.all(R[5] == 0.0), "five columns have five rows"
    assert np.allclose(R.T @ R, A.T @ A, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("empty", [0, 1, 3])
def test_stacked_triangles_have_the_factor_of_numpy_with_the_first_rows_of_all_first_or_not(empty):
    triangles = np.triu(np.random.default_rng(empty).standard_normal((90, 9, 9)), k=empty)
    expected = np.linalg.qr(triangles.reshape(-1, 9), mode="r")
    for stacked in (triangles, triangles.swapaxes(0, 1)):
        R = triangular(stacked.reshape(-1, 9))
        assert np.array_equal(R, np.triu(R))
        assert np.allclose(R.T @ R, expected.T @ expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("tiny", [1e-140, 1e-155, 1e-160, 1e-200, 1e-300, 1e160, 1e300])
def test_columns_whose_squares_are_out_of_range_have_the_factor_of_numpy(tiny):
    A = np.random.default_rng(7).standard_normal((200, 5))
    A[:, 1] *= tiny
    A[:100, 3] *= tiny
    A[0, 4] = 0.0
    size = np.linalg.norm(A / np.abs(A).max(axis=0), axis=0) * np.abs(A).max(axis=0)
    assert np.abs(triangular(A)) / size == pytest.approx(np.abs(np.linalg.qr(A, mode="r")) / size, abs=1e-12)


def test_no_rows_at_all_have_a_factor_without_rows():
    assert triangular(np.zeros((0, 4))).shape == (0, 4)


def test_a_number_that_is_not_finite_is_not_hidden_by_the_factor():
    A = np.ones((30, 3))
    A[17, 1] = np.nan
    assert np.isnan(triangular(A)).any()


def test_the_reach_of_a_motion_counts_its_start_and_no_missing_sample(by):
    assert by.value_range(np.array([np.nan, 3.0, 1.0, np.nan]), 2.0) == (1.0, 3.0)
    assert by.value_range(np.full(3, np.nan), 2.0) == (2.0, 2.0)


def test_columns_are_put_where_they_stand_among_zeros(by):
    wide = np.full((2, 5), np.nan)
    by.scatter_columns(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([3, 1]), wide)
    assert np.array_equal(wide, [[0.0, 2.0, 0.0, 1.0, 0.0], [0.0, 4.0, 0.0, 3.0, 0.0]])
