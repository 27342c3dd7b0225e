"""The eliminated chain is equivalent to one dense least-squares problem in all states and theta."""

import numpy as np
import pytest

from clutchid.inference.smoother.rows import Eliminated, eliminate, recover
from fixtures.dense import dense_blocks

STATES, K = 3, 4
LENGTHS = pytest.mark.parametrize("length", [1, 2, 3, 12])


def chain_of(length, seed=0, measured=5):
    """Rows of a random chain: on the first state, on each state, and between neighbours."""
    rng = np.random.default_rng(seed)
    first = rng.standard_normal((STATES, STATES + K + 1))
    own = rng.standard_normal((length, measured, STATES + K + 1))
    links = rng.standard_normal((length - 1, STATES, 2 * STATES + K + 1))
    return first, own, links


def dense(first, own, links):
    """All rows in one matrix over x_0 ... x_n and theta, with the residual last."""
    return np.vstack(list(dense_blocks(first, own, links, STATES)))


def without_residuals(chain):
    state_rows = chain.state_rows.copy()
    state_rows[:, :, -1] = 0.0
    return Eliminated(chain.rows, state_rows)


@LENGTHS
def test_states_at_another_theta_are_the_best_ones_there(length):
    parts = chain_of(length)
    matrix, theta = dense(*parts), np.array([0.3, -1.0, 2.0, 0.1])
    X, T, r = np.split(matrix, [length * STATES, length * STATES + K], axis=1)
    best = np.linalg.lstsq(X, -(r[:, 0] + T @ theta), rcond=None)[0]
    states = recover(eliminate(*parts), theta[:, None])[:, :, 0]
    assert states.ravel() == pytest.approx(best, rel=1e-9, abs=1e-9)


@LENGTHS
def test_what_is_left_on_theta_is_the_information_of_the_dense_problem_and_its_cost(length):
    parts = chain_of(length)
    matrix, n = dense(*parts), length * STATES
    H = matrix.T @ matrix
    schur = H[n:, n:] - H[n:, :n] @ np.linalg.solve(H[:n, :n], H[:n, n:])
    rows = eliminate(*parts).rows
    # [theta | r] together: information, gradient and the least cost
    assert rows.T @ rows == pytest.approx(schur, rel=1e-9, abs=1e-9)


@LENGTHS
def test_draws_have_the_covariance_of_the_dense_inverse(length):
    parts = chain_of(length)
    matrix = dense(*parts)[:, :-1]
    covariance = np.linalg.inv(matrix.T @ matrix)
    chain = without_residuals(eliminate(*parts))
    # recover is linear in the noise, so unit vectors give the root of the covariance without sampling
    n = length * STATES
    unit = np.eye(n + K)
    theta = np.linalg.solve(np.linalg.qr(chain.rows[:, :K], mode="r"), unit[n:])
    noise = unit[:n].reshape(length, STATES, n + K)
    root = np.vstack([recover(chain, theta, noise).reshape(n, -1), theta])
    assert root @ root.T == pytest.approx(covariance, rel=1e-8, abs=1e-9)


@LENGTHS
def test_draws_do_not_depend_on_the_signs_of_rows_which_rounding_may_turn(length):
    chain, rng = without_residuals(eliminate(*chain_of(length))), np.random.default_rng(1)
    theta, noise = rng.standard_normal((K, 7)), rng.standard_normal((length, STATES, 7))
    signs = np.where(rng.standard_normal((length, STATES, 1)) > 0.0, 1.0, -1.0)
    turned = recover(Eliminated(chain.rows, signs * chain.state_rows), theta, noise)
    np.testing.assert_allclose(turned, recover(chain, theta, noise), rtol=1e-12, atol=1e-12)


def test_a_state_without_rows_of_its_own_is_determined_by_its_neighbours():
    first, own, links = chain_of(4)
    own[2] = 0.0
    matrix = dense(first, own, links)
    whole = np.linalg.lstsq(matrix[:, :-1], -matrix[:, -1], rcond=None)[0]
    chain = eliminate(first, own, links)
    states = recover(chain, whole[4 * STATES :, None])[:, :, 0]
    assert states.ravel() == pytest.approx(whole[: 4 * STATES], rel=1e-8, abs=1e-8)


def test_a_chain_that_does_not_determine_its_states_is_refused():
    first, own, links = chain_of(4)
    own[3], links[2] = 0.0, 0.0
    with pytest.raises(np.linalg.LinAlgError, match="does not determine its states"):
        recover(eliminate(first, own, links), np.zeros((K, 1)))


def test_with_theta_fixed_only_the_states_are_left():
    first, own, links = chain_of(6)
    fixed = [np.delete(rows, np.s_[width : width + K], axis=-1) for rows, width in ((first, 3), (own, 3), (links, 6))]
    matrix = np.delete(dense(first, own, links), np.s_[6 * STATES : 6 * STATES + K], axis=1)
    best = np.linalg.lstsq(matrix[:, :-1], -matrix[:, -1], rcond=None)[0]
    states = recover(eliminate(*fixed), np.zeros((0, 1)))[:, :, 0]
    assert states.ravel() == pytest.approx(best, rel=1e-9, abs=1e-9)
