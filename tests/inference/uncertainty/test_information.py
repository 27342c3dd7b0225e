"""Information in square-root form, against plain inverses of matrices."""

import numpy as np

from clutchid.inference.uncertainty.gaussian import Information, natural_sizes
from clutchid.model import Actuator, Load

NAMES = ("theta_1", "theta_2", "P_S")


def test_natural_sizes_are_values_and_those_of_weights():
    actuator = Actuator(load=Load((9e5, -0.3e5, 0.6e5))).replace({"P_S": 8e5, "e_y": 0.0})
    assert natural_sizes(actuator, ("theta_2", "P_S", "e_y")).tolist() == [1e5, 8e5, 1.0]


def test_the_information_of_a_covariance_is_its_inverse_in_natural_sizes():
    root = np.random.default_rng(1).standard_normal((3, 3))
    covariance, sizes = root @ root.T * 1e6, np.array([1e5, 2.0, 0.1])
    R = Information.of_covariance(NAMES, covariance, sizes).R
    np.testing.assert_allclose(R.T @ R, np.linalg.inv(covariance) * np.outer(sizes, sizes), rtol=1e-9)


def test_an_infinite_variance_is_no_information():
    covariance = np.diag([4.0, np.inf, 9.0])
    information = Information.of_covariance(NAMES, covariance, np.ones(3))
    assert information.determined == ("theta_1", "P_S")
    np.testing.assert_allclose(information.R.T @ information.R, np.diag([1 / 4, 0.0, 1 / 9]), rtol=1e-12)
    assert Information.of_covariance(NAMES[:2], np.diag([np.inf] * 2), np.ones(2)).determined == ()
