"""Section 2.5: knots and Eqs. (15)-(21), typed again from the page."""

import numpy as np
import pytest
import sympy as sp

from clutchid.model import PAPER_KNOTS, Load
from clutchid.model.load import xi_1, xi_2, xi_3

MM = sp.Rational(1, 1000)
T_1, T_2, T_3, T_4 = 0 * MM, 2 * MM, sp.Rational(17, 2) * MM, sp.Rational(23, 2) * MM
AS_PUBLISHED = sp.Rational(1, 1000)


def numbers(values) -> list[float]:
    return [float(value) for value in values]


def test_the_knots_are_0_2_8_5_and_11_5_millimetres():
    assert PAPER_KNOTS == (0.0, 2e-3, 8.5e-3, 11.5e-3)
    assert Load().knots == PAPER_KNOTS


def test_the_fifth_knot_is_at_21_millimetres():
    np.testing.assert_allclose(Load().breakpoints, [0, 2e-3, 8.5e-3, 11.5e-3, 21e-3], rtol=1e-15)


def test_xi_1_is_as_printed():
    a_1, b_1, c_1 = numbers(xi_1(T_1, T_2, T_3))
    # half a unit in the last printed place
    assert a_1 == pytest.approx(-76.92308, abs=5e-6)
    assert b_1 == pytest.approx(1.3077, abs=5e-5)
    assert c_1 == pytest.approx(-3.0769e-4, abs=5e-9)


def test_xi_1_meets_its_three_printed_conditions_exactly():
    a_1, b_1, c_1 = xi_1(T_1, T_2, T_3)
    assert a_1 * T_2**2 + b_1 * T_2 + c_1 == T_2 - T_1
    assert 2 * a_1 * T_2 + b_1 == 1
    assert 2 * a_1 * T_3 + b_1 == 0


def test_the_printed_mantissas_of_xi_2_belong_to_a_slope_of_a_thousandth():
    a_2, b_2, c_2, d_2 = numbers(xi_2(T_2, T_3, AS_PUBLISHED))
    # printed: 7.6923e-2, -3.0769e-7, -8.4968e-3: three numbers for four, one of b_2 and c_2 is lost and a sign with it
    assert a_2 == pytest.approx(7.6923e-2, abs=5e-7)
    assert b_2 == pytest.approx(-3.0769e-4, abs=5e-9)
    assert c_2 == pytest.approx(3.0769e-7, abs=5e-12)
    # -8.49675e-3 was rounded away from zero
    assert d_2 == pytest.approx(-8.4968e-3, abs=5.1e-8)
    assert d_2 == pytest.approx(-8.49675e-3, rel=1e-12)


def test_xi_2_meets_its_four_printed_conditions_exactly():
    a_2, b_2, c_2, d_2 = xi_2(T_2, T_3)
    assert a_2 * T_2**2 + b_2 * T_2 + c_2 == 0
    assert 2 * a_2 * T_2 + b_2 == 0
    assert a_2 * T_3**2 + b_2 * T_3 + c_2 == T_3 + d_2
    assert 2 * a_2 * T_3 + b_2 == 1


def test_xi_3_is_as_printed_in_the_order_b_a_c_g_d_h_f_e():
    a_3, b_3, c_3, d_3, e_3, f_3, g_3, h_3 = numbers(xi_3(T_2, T_4))
    printed = [47.2372, -2.3327e3, -0.1610, 1.6900, 1.5163e-4, -6.9439e-3, -113.7192, 2.3327e3]
    ours = [b_3, a_3, c_3, g_3, d_3, h_3, f_3, e_3]
    half_a_place = [5e-5, 5e-2, 5e-5, 5e-5, 5e-9, 5e-8, 5e-5, 5e-2]
    for value, number, allowed in zip(ours, printed, half_a_place, strict=True):
        assert value == pytest.approx(number, abs=allowed)


def test_xi_3_meets_its_eight_printed_conditions_exactly():
    a_3, b_3, c_3, d_3, e_3, f_3, g_3, h_3 = xi_3(T_2, T_4)
    t_5 = 2 * T_4 - T_2
    assert t_5 == 21 * MM
    assert a_3 * T_2**3 + b_3 * T_2**2 + c_3 * T_2 + d_3 == 0
    assert 3 * a_3 * T_2**2 + 2 * b_3 * T_2 + c_3 == 0
    assert a_3 * T_4**3 + b_3 * T_4**2 + c_3 * T_4 + d_3 == MM  # printed: a_3 t_3^4
    assert 3 * a_3 * T_4**2 + 2 * b_3 * T_4 + c_3 == 0
    assert e_3 * t_5**3 + f_3 * t_5**2 + g_3 * t_5 + h_3 == 0
    assert 3 * e_3 * t_5**2 + 2 * f_3 * t_5 + g_3 == 0
    assert e_3 * T_4**3 + f_3 * T_4**2 + g_3 * T_4 + h_3 == MM
    assert 3 * e_3 * T_4**2 + 2 * f_3 * T_4 + g_3 == 0


def test_phi_1_and_phi_2_add_up_to_the_position_with_the_stated_conditions_and_not_as_published():
    y = np.linspace(0, 25e-3, 251)
    stated, published = Load(), Load(phi2_slope=0.001)
    np.testing.assert_allclose(stated.phi(y)[:, :2].sum(axis=1), y, atol=3e-18 * 10)
    # errata: broken by up to 3.25 mm, nearly all of the 3.25 mm that phi_2 has lost at t_3
    assert np.abs(published.phi(y)[:, :2].sum(axis=1) - y).max() == pytest.approx(3.25e-3 * 0.999, rel=1e-12)


def test_basis_functions_at_hand_computed_positions():
    y = np.array([-1e-3, 1e-3, 2e-3, 5e-3, 8.5e-3, 10e-3, 25e-3])
    # 5 mm: 2 + 3 - 9 / 13 mm and 9 / 13 mm; s = (5 - 2) / 9.5 and 8 / 9.5 at 10 mm
    third = [s**2 * (3 - 2 * s) for s in (0, 0, 0, 3 / 9.5, 6.5 / 9.5, 8 / 9.5, 0)]
    expected = 1e-3 * np.array([[0, 1, 2, 5 - 9 / 13, 5.25, 5.25, 5.25], [0, 0, 0, 9 / 13, 3.25, 4.75, 19.75], third])
    np.testing.assert_allclose(Load().phi(y), expected.T, atol=1e-16)
