"""The prior for changes between recordings: what changes together, by how much, and what cannot change."""

from itertools import combinations

import numpy as np
import pytest

from clutchid.inference.uncertainty.change_prior import (
    HYPOTHESES,
    change_covariance,
    change_priors,
    changeable,
    directions,
    drift,
    log_odds,
    prior_probability,
)
from clutchid.model import Actuator
from clutchid.parameters import GROUPS, Parameters

AVERAGED = {"n_vs", "n_ve", "tau_vs", "tau_ve"}
#: Drift of the Appendix's parameters in their own unit, worked out by hand.
DRIFTS = {
    "P_S": 2700.0, "D_v": 100.0, "T_0": 0.586, "T_w": 0.586, "h_A": 1.5, "C_vs": 3.8e-11, "C_ve": 4.28e-11,
    "C_r": 1e-10, "V_0A": 7.4e-6, "F_C": 30.0, "c_F": 9e-6, "V_S": 6e-4, "A_A": 3.69e-6, "P_0": 1642.5, "n_vs": 1e-3,
    "n_ve": 1e-3, "tau_vs": 2e-5, "tau_ve": 2e-5,
    "R_0vs": 6e-4, "R_0ve": 6e-4, "R_1vs": 6e-4, "R_1ve": 6e-4, "a_0vs": 1e-3, "a_0ve": 1e-3, "t_vs": 1e-3,
    "t_ve": 1e-3, "s_vs": 1e-3, "s_ve": 1e-3, "tau_y": 3e-5, "mu_h": 3e-4, "m_ve": 3e-3, "C_A0": 5e-13,
    "K_z": 1.5e5, "R_S": 0.1, "v_S": 2e-3,
}  # fmt: skip

SWITCHED = {"t_vs", "t_ve", "s_vs", "s_ve", "a_0vs", "a_0ve"}


@pytest.fixture(scope="module")
def actuator():
    """An actuator in which every parameter of the prior acts but those of switched valves."""
    return Actuator(model="energy-balance-stribeck-proportional").replace({"mu_h": 0.01})


@pytest.fixture(scope="module")
def switched():
    return Actuator(model="energy-balance-stribeck").replace(
        {"T_pwm": 0.02, "t_vs": 2e-3, "t_ve": 0.0, "a_0vs": 1e-3, "mu_h": 0.01}
    )


def test_a_parameter_of_the_appendix_differs_between_two_recordings_by_so_much():
    appendix = Actuator()
    drifts = {name: drift(appendix, name) for name in appendix.names if drift(appendix, name) > 0.0}
    assert drifts == pytest.approx(DRIFTS, rel=1e-12)


def test_a_drift_in_shares_follows_the_value_and_one_in_units_does_not():
    other = Actuator().replace({"P_S": 8e5, "R_0vs": 0.1})
    assert drift(other, "P_S") == pytest.approx(2400.0)
    assert drift(other, "R_0vs") == 6e-4


def deviations(actuator, hypothesis, names):
    """Standard deviations in shares of the values."""
    covariance = change_covariance(actuator, names, hypothesis)
    values = np.array([actuator.value(name) for name in names])
    return covariance / np.outer(values, values)


@pytest.mark.parametrize("hypothesis", HYPOTHESES)
@pytest.mark.parametrize("kind", ["actuator", "switched"])
def test_the_covariance_of_a_change_is_symmetric_and_positive_definite(hypothesis, kind, request):
    actuator = request.getfixturevalue(kind)
    names = changeable(actuator)
    covariance = change_covariance(actuator, names, hypothesis)
    assert np.array_equal(covariance, covariance.T)
    # widths from 1e-10 to 1e4: the correlation is what may be singular
    width = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(width, width)).min() > 1e-6


def test_where_nothing_has_changed_every_parameter_drifts_a_little_by_itself(actuator):
    names = changeable(actuator)
    covariance = change_covariance(actuator, names, ())
    assert np.array_equal(covariance, np.diag([drift(actuator, name) ** 2 for name in names]))
    assert np.sqrt(covariance[names.index("P_S"), names.index("P_S")]) == pytest.approx(DRIFTS["P_S"])


def test_up_to_three_groups_change_at_once():
    assert set(HYPOTHESES) == {h for size in range(4) for h in combinations(GROUPS, size)}
    assert ("supply pressure", "temperature and grease", "valves") in HYPOTHESES


def test_a_hypothesis_adds_the_changes_of_its_groups_and_those_of_several_groups_add_up(actuator):
    names = changeable(actuator)
    none = change_covariance(actuator, names, ())
    added = {h: change_covariance(actuator, names, h) - none for h in HYPOTHESES}
    scale = np.sqrt(np.diag(change_covariance(actuator, names, tuple(GROUPS))))
    for several in HYPOTHESES[1 + len(GROUPS) :]:
        total = np.sum([added[(group,)] for group in several], axis=0)
        np.testing.assert_allclose(added[several] / np.outer(scale, scale), total / np.outer(scale, scale), atol=1e-12)
    for group in GROUPS:
        moved = {name for name, by in zip(names, np.diag(added[(group,)]), strict=True) if by > 0.0}
        assert moved == {name for direction in directions(actuator.rows, group) for name in direction} & set(names)


def test_with_the_temperature_the_air_the_flow_and_the_grease_change_together(actuator):
    names = ("T_0", "T_w", "C_vs", "C_ve", "D_v")
    shares = deviations(actuator, ("temperature and grease",), names)
    correlation = shares / np.sqrt(np.outer(np.diag(shares), np.diag(shares)))
    # a warmer chamber: air passes valves by the inverse root of its temperature, and grease gets thinner
    assert correlation[0, 1] > 0.99
    assert correlation[2, 3] > 0.99
    assert np.all(correlation[0, 2:4] < -0.99)
    assert correlation[0, 4] < -0.8, "the grease has a part of its own as well"
    width = np.sqrt(np.diag(shares))
    assert width[2] / width[0] == pytest.approx(0.5, rel=0.01), "the inverse root"
    assert width[0] == pytest.approx(25.0 / 293.15, rel=0.01), "25 K"
    assert not np.any(change_covariance(actuator, ("P_S", *names), ("temperature and grease",))[0, 1:])


def test_of_averaged_valves_times_and_steps_cannot_change_and_of_switched_ones_exponents(actuator, switched):
    assert set(changeable(actuator)) >= AVERAGED
    assert not SWITCHED & set(changeable(actuator))
    assert set(changeable(switched)) & (AVERAGED | SWITCHED) == SWITCHED - {"t_ve"}, "a travel of 0 stays 0"


def test_what_is_0_or_not_in_the_equations_cannot_change(actuator):
    assert {"mu_h", "h_A", "T_w", "V_S", "c_F"} <= set(changeable(actuator))
    assert "h_A" not in changeable(actuator.replace({"h_A": 0.0}))
    plain = changeable(Actuator())
    assert not {"h_A", "T_w", "V_S"} & set(plain)
    assert "tau_y" in plain, "the lag of the sensor is outside of the equations"
    assert set(plain) <= set(DRIFTS)


def test_the_prior_of_each_parameter_alone_is_as_wide_as_its_widest_change(actuator):
    priors = change_priors(actuator)
    assert tuple(priors) == changeable(actuator)
    assert all(priors[name].mean == actuator.value(name) for name in priors)
    assert priors["P_S"].std == pytest.approx(np.hypot(0.05 * 9e5, DRIFTS["P_S"]))
    assert priors["V_0A"].std == pytest.approx(DRIFTS["V_0A"]), "no group has it"
    assert priors["R_0vs"].std == pytest.approx(np.hypot(0.015, DRIFTS["R_0vs"])), "in its unit, not a share"


def test_every_change_of_a_row_is_one_of_a_known_group():
    groups = {change.group for row in Parameters.rows().values() for change in row.changes}
    assert groups == set(GROUPS)


def test_parameters_along_one_direction_change_together_and_others_alone():
    rows = Parameters.rows()
    warmer, grease = directions(rows, "temperature and grease")
    assert grease == {"D_v": 0.3}
    assert warmer == {"T_0": 0.085, "T_w": 0.085, "C_vs": -0.0425, "C_ve": -0.0425, "C_r": -0.0425, "D_v": -0.5}
    valves = directions(rows, "valves")
    assert valves[0] == {"C_vs": 0.07, "C_ve": 0.07}
    assert all(len(alone) == 1 for alone in valves[1:])


def test_every_change_is_less_probable_than_none_and_two_less_than_each():
    assert log_odds(()) == 0.0
    assert {group: log_odds((group,)) for group in GROUPS} == dict(GROUPS)
    for hypothesis in HYPOTHESES[1:]:
        assert log_odds(hypothesis) < min(log_odds(hypothesis[:-1]), log_odds(hypothesis[1:]))


def test_the_probability_before_is_that_of_all_hypotheses_with_the_group():
    before = prior_probability()
    odds = {h: np.exp(log_odds(h)) for h in HYPOTHESES}
    assert set(before) == set(GROUPS)
    for group, probability in before.items():
        without = sum(o for h, o in odds.items() if group not in h)
        assert probability == pytest.approx(1.0 - without / sum(odds.values()))
