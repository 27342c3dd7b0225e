"""Which numbers a recording determines in combination only, from the information it carries."""

import numpy as np
import pytest

from clutchid.inference.uncertainty.identifiability import collinear, identifiability, identifiability_warnings
from clutchid.model import Actuator

NAMES = ("C_vs", "C_ve", "P_S", "F_C", "D_v")


@pytest.fixture
def factor():
    """Triangular factor of a Jacobian whose columns 0, 2 and 3 lie in a plane but for a millionth."""
    q = np.linalg.qr(np.random.default_rng(4).standard_normal((40, 5)))[0]
    J = np.column_stack([q[:, 0], q[:, 1], q[:, 2], (q[:, 0] + q[:, 2]) / np.sqrt(2) + 1e-6 * q[:, 3], q[:, 4]])
    return np.linalg.qr(100.0 * J)[1]


def test_of_three_entangled_and_two_other_numbers_the_three_are_found(factor):
    assert collinear(factor) == [0, 2, 3]
    # how large the numbers are does not matter
    assert collinear(factor * [1.0, 1e6, 1e-3, 10.0, 1.0]) == [0, 2, 3]


def test_a_combination_is_named_by_its_members_and_none_where_each_stands_alone(factor):
    *pairs, together = identifiability_warnings(factor, NAMES, Actuator(), 20e-3, True)
    assert together.startswith("only combinations of C_vs, P_S and F_C")
    # of the three each two can be told from their sum only, too
    named = sorted(" ".join(pair.split()[:3]) for pair in pairs)
    assert named == ["C_vs and F_C", "C_vs and P_S", "P_S and F_C"]
    assert identifiability_warnings(100.0 * np.eye(5), NAMES, Actuator(), 20e-3, True) == []


def test_the_ranking_goes_from_the_best_determined_to_the_one_that_the_others_make_up_for(factor):
    sizes = np.array([1.0, 0.5, 2.0, 1.0, 1e-3])
    of = identifiability(factor * sizes, NAMES, np.full(5, 10.0))
    assert of.ranking[0].name == "P_S", "a step of it changes the residuals most"
    first, last = of.ranking[0], of.ranking[-1]
    assert first.ranked == pytest.approx(first.alone) == pytest.approx(10.0 / 200.0)
    assert first.collinearity == pytest.approx(1.0)
    by_name = {row.name: row for row in of.ranking}
    assert by_name["D_v"].ranked == pytest.approx(by_name["D_v"].alone) == pytest.approx(10.0 / 0.1)
    assert last.name in ("C_vs", "F_C"), "of C_vs, P_S and F_C only two are determined"
    assert last.ranked > 1e5 * last.alone
    assert last.collinearity > 1e5
    (group,) = of.dependencies
    assert set(group.names) == {"C_vs", "P_S", "F_C"}
    assert group.condition > 1e5


def test_what_the_data_say_nothing_about_stands_at_the_end():
    R = np.diag([3.0, 0.0, 1.0])
    of = identifiability(R, NAMES[:3], np.ones(3))
    assert [row.name for row in of.ranking] == ["C_vs", "P_S", "C_ve"]
    assert of.ranking[-1].alone == of.ranking[-1].ranked == np.inf
    assert of.dependencies == ()
    nothing = identifiability(np.zeros((2, 2)), NAMES[:2], np.ones(2))
    assert [row.alone for row in nothing.ranking] == [np.inf, np.inf]


def test_the_standard_deviations_are_those_of_the_inverse_information():
    R = np.triu(np.random.default_rng(2).standard_normal((4, 4))) + 3 * np.eye(4)
    of = identifiability(R, NAMES[:4], np.ones(4))
    last = of.ranking[-1]
    inverse = np.linalg.inv(R.T @ R)
    place = NAMES.index(last.name)
    assert last.ranked == pytest.approx(np.sqrt(inverse[place, place]))
