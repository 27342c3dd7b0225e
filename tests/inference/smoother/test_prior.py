"""A joint prior of the free parameters, and what the data alone say of them."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.inference.problem import prior_rows
from clutchid.inference.smoother.problem import condense, data_factor, linearise
from clutchid.inference.uncertainty.coordinates import coordinates

NAMES = ("theta_9", "C_vs", "P_S", "F_C")

#: Root of the information of a joint prior: supply and flow are known together.
ROOT = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 1.5, 0.0], [0.0, 0.0, 3.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of([recorded_by(plant, seconds=2.0)], plant, NAMES)


@pytest.fixture(scope="module")
def joint(problem):
    return replace(problem, prior_root=ROOT)


def test_without_a_joint_prior_every_parameter_has_a_row_of_its_own(problem, joint):
    x = np.array([0.3, -0.2, 0.5, 0.1])
    np.testing.assert_array_equal(prior_rows(problem, x)[:4], np.column_stack([np.eye(4), x]))
    np.testing.assert_allclose(prior_rows(joint, x)[:4], np.column_stack([ROOT, ROOT @ x]))
    np.testing.assert_array_equal(prior_rows(joint, x)[4:], prior_rows(problem, x)[4:], "the smoothness of the load")


def test_extra_parameters_have_no_prior(joint, problem, plant):
    x = np.array([0.3, -0.2, 0.5, 0.1])
    for narrow in (problem, joint):
        wide = narrow.widened(coordinates(plant, ("T_w", "tau_y"), {}, {}))
        assert wide.names == (*NAMES, "T_w", "tau_y")
        rows, own = prior_rows(wide, np.append(x, [0.7, -0.4])), prior_rows(narrow, x)
        np.testing.assert_allclose(np.delete(rows, [4, 5], axis=1), own, atol=1e-15)
        assert not rows[:, 4:6].any()


def test_rows_of_data_and_rows_of_the_prior_are_the_whole_problem(problem, joint, starts_of):
    x = np.array([0.1, -0.05, 0.02, 0.1])
    for posed in (problem, joint):
        linear = linearise(posed, x, starts_of(posed))
        data, (whole, _) = data_factor(posed, linear), condense(posed, linear)
        information = data[:, :4].T @ data[:, :4] + linear.prior[:, :4].T @ linear.prior[:, :4]
        np.testing.assert_allclose(whole[:, :4].T @ whole[:, :4], information, rtol=1e-9, atol=1e-9)
        gradient = data[:, :4].T @ data[:, 4] + linear.prior[:, :4].T @ linear.prior[:, 4]
        np.testing.assert_allclose(whole[:, :4].T @ whole[:, 4], gradient, rtol=1e-6, atol=1e-6)


def test_the_data_do_not_depend_on_the_prior(problem, joint, starts_of):
    x, X = np.zeros(4), starts_of(problem)
    separate, together = (data_factor(p, linearise(p, x, X)) for p in (problem, joint))
    np.testing.assert_array_equal(separate, together)
    assert linearise(joint, x + 0.1, X).cost > linearise(problem, x + 0.1, X).cost, "the cost has the joint prior"
