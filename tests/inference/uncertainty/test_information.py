"""Information in square-root form, against plain inverses of matrices."""

import numpy as np
import pytest

from clutchid.inference.uncertainty.gaussian import Information, natural_sizes
from clutchid.model import Actuator, Load

NAMES = ("theta_1", "theta_2", "P_S", "C_vs", "F_C")


@pytest.fixture
def information():
    return Information(NAMES, np.random.default_rng(0).standard_normal((9, 5)))


def test_natural_sizes_are_values_and_those_of_weights(information):
    actuator = Actuator(load=Load((9e5, -0.3e5, 0.6e5))).replace({"P_S": 8e5, "e_y": 0.0})
    assert natural_sizes(actuator, ("theta_2", "P_S", "e_y")).tolist() == [1e5, 8e5, 1.0]


def test_the_information_of_a_covariance_is_its_inverse_in_natural_sizes():
    root = np.random.default_rng(1).standard_normal((3, 3))
    covariance, sizes = root @ root.T * 1e6, np.array([1e5, 2.0, 0.1])
    R = Information.of_covariance(NAMES[:3], covariance, sizes).R
    np.testing.assert_allclose(R.T @ R, np.linalg.inv(covariance) * np.outer(sizes, sizes), rtol=1e-9)


def test_an_infinite_variance_is_no_information():
    covariance = np.diag([4.0, np.inf, 9.0])
    information = Information.of_covariance(NAMES[:3], covariance, np.ones(3))
    assert information.determined == ("theta_1", "P_S")
    np.testing.assert_allclose(information.R.T @ information.R, np.diag([1 / 4, 0.0, 1 / 9]), rtol=1e-12)
    assert Information.of_covariance(NAMES[:2], np.diag([np.inf] * 2), np.ones(2)).determined == ()


def test_the_covariance_of_the_marginal_is_the_part_of_the_whole(information):
    whole = np.linalg.inv(information.R.T @ information.R)
    part = information.marginal(("C_vs", "theta_1"))
    at = [3, 0]
    np.testing.assert_allclose(np.linalg.inv(part.R.T @ part.R), whole[np.ix_(at, at)], rtol=1e-9)
    np.testing.assert_allclose(information.standard_errors(), np.sqrt(np.diag(whole)), rtol=1e-9)


def test_others_without_information_or_in_combination_only_cost_no_more_than_they_explain(information):
    R = information.R.copy()
    R[:, 3], R[:, 4] = 0.0, 2.0 * R[:, 2]
    plain = Information(NAMES[:3], R[:, :3]).marginal(NAMES[:2]).R
    part = Information(NAMES, R).marginal(NAMES[:2]).R
    np.testing.assert_allclose(part.T @ part, plain.T @ plain, rtol=1e-9)


def test_further_rows_add_their_information(information):
    rows = np.random.default_rng(2).standard_normal((4, 5))
    more = information.plus(rows)
    matrix = information.R.T @ information.R + rows.T @ rows
    np.testing.assert_allclose(more.R.T @ more.R, matrix, rtol=1e-9)
    assert more.nats() == pytest.approx(0.5 * np.linalg.slogdet(matrix)[1], rel=1e-12)
