"""Which numbers a recording determines in combination only, from the information it carries."""

import numpy as np
import pytest

from clutchid.inference.uncertainty.identifiability import collinear, identifiability_warnings
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
