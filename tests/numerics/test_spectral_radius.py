"""The bound of a spectral radius against eigenvalues."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in

bound = kernels_in("clutchid.numerics.spectral_radius").spectral_radius


def radius(matrices: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(matrices)).max())


@pytest.mark.parametrize("size", [1, 2, 5, 12])
def test_the_bound_lies_above_the_largest_eigenvalue_by_less_than_two_percent(size):
    rng = np.random.default_rng(size)
    scale = 10.0 ** rng.uniform(-8, 6, size)  # metres beside pascals
    matrices = rng.standard_normal((200, size, size)) * rng.uniform(1.0, 1e4, (200, 1, 1)) * scale[:, None] / scale
    assert radius(matrices) * (1 - 1e-9) <= bound(matrices, scale) <= 1.02 * radius(matrices)


def test_a_rotation_and_a_stiff_chain_have_their_rates():
    rotation = np.array([[0.0, 300.0], [-300.0, 0.0]])
    chain = np.array([[-1.0, 1e9], [0.0, -250.0]])  # far from normal
    unit = np.ones(2)
    assert bound(np.array([rotation]), unit) == pytest.approx(300.0)
    assert 250.0 <= bound(np.array([chain]), np.array([1e4, 1e-2])) <= 258.0


def test_nothing_moves_by_itself_in_a_nilpotent_system_and_what_is_not_finite_is_left_out():
    shift = np.array([[0.0, 5.0], [0.0, 0.0]])
    nan = np.full((2, 2), np.nan)
    assert bound(np.array([shift, nan]), np.ones(2)) == 0.0
    assert bound(np.array([nan, np.diag([-7.0, 2.0]), [[np.inf, 0.0], [0.0, 1.0]]]), np.ones(2)) == pytest.approx(7.0)
    assert bound(np.array([nan]), np.ones(2)) == 0.0
