"""Posterior and evidence of linear least squares, against integrals on a grid."""

import numpy as np
import pytest

from clutchid.inference.uncertainty.gaussian import gaussian_posterior, square_root

#: Rows ``[J | r]`` of five data that determine the second parameter poorly; the linearisation is at x = (0.3, -0.2).
AT = np.array([0.3, -0.2])
DATA = np.array([[2.0, 0.4, 1.1], [1.0, 0.3, -0.7], [-1.5, 0.2, 0.4], [0.5, -0.3, 0.9], [0.0, 0.1, -0.5]])

#: Roots of the information of a prior with mean x = 0: a narrow one, and a wide one with a correlation.
NARROW = np.diag([4.0, 5.0])
WIDE = np.array([[0.8, 0.3], [0.0, 0.6]])


def posterior(root, data=DATA):
    return gaussian_posterior(data, np.column_stack([root, root @ AT]), float(np.linalg.slogdet(root)[1]))


def on_a_grid(root, data=DATA):
    """Mean and covariance of x, and the logarithm of the integral of likelihood and normalised prior."""
    axis = np.linspace(-12.0, 12.0, 1201)
    x = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    residuals = (x - AT) @ data[:, :2].T + data[:, 2]
    prior = x @ root.T
    density = np.exp(-0.5 * (np.sum(residuals**2, axis=-1) + np.sum(prior**2, axis=-1)))
    density *= abs(np.linalg.det(root)) / (2.0 * np.pi)
    area = (axis[1] - axis[0]) ** 2
    total = density.sum()
    mean = np.einsum("ij,ijk->k", density, x) / total
    covariance = np.einsum("ij,ijk,ijl->kl", density, x - mean, x - mean) / total
    return mean, covariance, float(np.log(total * area))


# the trapezoidal rule on a grid that resolves the narrowest Gaussian ten times is exact to rounding
@pytest.mark.parametrize("root", [NARROW, WIDE])
def test_mean_and_covariance_are_those_of_the_integral(root):
    mean, covariance, _ = on_a_grid(root)
    normal = posterior(root)
    np.testing.assert_allclose(AT + normal.step, mean, atol=1e-8)
    np.testing.assert_allclose(normal.covariance, covariance, rtol=1e-8)


def test_the_evidence_for_one_prior_against_another_is_that_of_the_integral():
    narrow, wide = (on_a_grid(root)[2] for root in (NARROW, WIDE))
    evidence = posterior(NARROW).log_evidence - posterior(WIDE).log_evidence
    assert abs(narrow - wide) > 0.5, "the priors have to differ in what they explain"
    assert evidence == pytest.approx(narrow - wide, abs=1e-8)


def test_the_evidence_lacks_a_constant_only():
    # without the normalisation of the prior's own exponential, (2 pi)^(k/2) of the integral over x
    integral = on_a_grid(WIDE)[2]
    assert posterior(WIDE).log_evidence == pytest.approx(integral, abs=1e-8)


def test_fewer_rows_than_parameters_leave_the_rest_to_the_prior():
    normal = posterior(WIDE, DATA[:1])
    mean, covariance, _ = on_a_grid(WIDE, DATA[:1])
    np.testing.assert_allclose(AT + normal.step, mean, atol=1e-8)
    np.testing.assert_allclose(normal.covariance, covariance, rtol=1e-8)
    # without data the prior is the posterior, and explains all that there is
    alone = posterior(WIDE, np.zeros((0, 3)))
    np.testing.assert_allclose(alone.step, -AT, atol=1e-12)
    np.testing.assert_allclose(alone.covariance, np.linalg.inv(WIDE.T @ WIDE), rtol=1e-12)
    assert alone.log_evidence == pytest.approx(0.0, abs=1e-12)


def test_a_square_root_gives_its_covariance_back_also_where_that_is_singular():
    rows = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 3.0]])
    for covariance in (rows @ rows.T, rows.T @ rows, np.zeros((2, 2))):
        root = square_root(covariance)
        np.testing.assert_allclose(root @ root.T, covariance, atol=1e-12)
        # the one that is lower triangular with a positive diagonal: eigenvectors have any sign
        np.testing.assert_allclose(np.triu(root, 1), 0.0, atol=1e-12)
        assert np.all(np.diag(root) >= 0.0)
    # a rounding error below zero is taken as zero
    assert np.isfinite(square_root(np.diag([1.0, -1e-18]))).all()


def test_data_that_scatter_less_have_the_covariance_of_their_estimate():
    # x from the prior, data with a quarter of the assumed variance, estimated as if they had all of it
    rng, draws, scatter = np.random.default_rng(5), 200_000, 0.25
    jacobian = DATA[:, :2]
    true = rng.standard_normal((draws, 2)) @ np.linalg.inv(WIDE).T
    target = true @ jacobian.T + np.sqrt(scatter) * rng.standard_normal((draws, 5))
    estimate = target @ jacobian @ np.linalg.inv(jacobian.T @ jacobian + WIDE.T @ WIDE)
    prior = np.column_stack([WIDE, WIDE @ AT])
    plain, scattered = (gaussian_posterior(DATA, prior, 0.0, by) for by in (1.0, scatter))
    # a covariance of so many draws is known to 5 sqrt(2 / draws) of its deviations
    scale = np.sqrt(np.diag(scattered.covariance))
    happened = np.cov((estimate - true).T)
    assert scattered.covariance / np.outer(scale, scale) == pytest.approx(
        happened / np.outer(scale, scale), abs=5.0 * np.sqrt(2.0 / draws)
    )
    np.testing.assert_array_equal(scattered.step, plain.step)
    assert scattered.log_evidence == plain.log_evidence
    assert np.all(np.diag(scattered.covariance) < np.diag(plain.covariance))
