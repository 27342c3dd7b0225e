"""Information criteria of fits of the same samples."""

import numpy as np
import pytest

import clutchid


@pytest.fixture(scope="module")
def fits():
    """One load weight, the three that made the data, and these with two parameters that are as they were."""
    log = clutchid.bundled_recording().slice(0, 6000)
    truth = clutchid.Actuator(load=clutchid.Load((9.5e5, -4e4, 0.0)))
    noise = 2e-5 * np.random.default_rng(4).standard_normal(len(log))
    log = log.with_columns(position=clutchid.simulate(truth, log).log["position"] + noise)
    return [clutchid.fit(log, free=free) for free in ("theta_1", "theta_1,theta_2", "theta_1,theta_2,F_C,V_0A")]


def test_the_model_that_made_the_data_has_the_smallest_criteria(fits):
    fewest = min((fit.evidence for fit in fits), key=lambda e: e.criteria(0).independent)
    small, right, large = (fit.evidence.criteria(len(fit.parameters), fewest) for fit in fits)
    assert right.aic < small.aic
    assert right.bic < small.bic
    assert right.bic < large.bic
    assert small.independent == right.independent == large.independent


def test_white_residuals_count_each_and_correlated_ones_for_fewer(fits):
    poor, right, _ = (fit.evidence.criteria(len(fit.parameters)) for fit in fits)
    assert right.independent == pytest.approx(6000, rel=0.15)
    assert poor.independent < 0.2 * right.independent


def test_a_parameter_more_costs_two_and_the_logarithm_of_the_number(fits):
    judged = fits[1].evidence
    three, two = judged.criteria(3), judged.criteria(2)
    assert three.aic - two.aic == pytest.approx(2.0)
    assert three.bic - two.bic == pytest.approx(np.log(two.independent))
