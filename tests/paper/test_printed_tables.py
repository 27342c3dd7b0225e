"""Tables 1 and 2 and Eq. (21), typed anew from the page, against the numbers that the study prints beside its own."""

import pytest

from clutchid.study.tables import PRINTED_SLOPE, TABLE_1, TABLE_2, XI_1, XI_2, XI_3, XI_3_ORDER

#: Table 1: N, then theta_1, theta_2, theta_3, in 1e5 N/m.
PAGE_1 = """
ballistic  9.3850  -0.5817  0.3909
2          8.4554  -0.1678  0.0971
4          8.5581  -0.2233  0
8          9.8251  -0.3468  0.5386
16         8.9178  -0.3527  0
32         8.8767  -0.5476  0
"""

#: Table 2: N, then mantissa and exponent of the position error, and of the pressure error.
PAGE_2 = """
ballistic  0.2678 -4  2.7602 12
2          8.8691 -4  1.7203 12
4          8.7327 -4  1.7330 12
8          3.3932 -4  5.3149 12
16         2.5684 -4  2.1805 12
32         4.1361 -3  1.020  12
"""


def rows(page):
    lines = [line.split() for line in page.strip().splitlines()]
    return {None if words[0] == "ballistic" else int(words[0]): [float(word) for word in words[1:]] for words in lines}


def test_table_1_is_the_one_on_the_page():
    assert set(TABLE_1) == set(rows(PAGE_1))
    for number, mantissas in rows(PAGE_1).items():
        assert TABLE_1[number] == pytest.approx([1e5 * mantissa for mantissa in mantissas], rel=1e-12)


def test_table_2_is_the_one_on_the_page():
    assert set(TABLE_2) == set(rows(PAGE_2))
    for number, (y, y_power, p, p_power) in rows(PAGE_2).items():
        assert TABLE_2[number] == pytest.approx([y * 10**y_power, p * 10**p_power], rel=1e-12)


def test_equation_21_is_the_one_on_the_page():
    assert pytest.approx([-76.92308, 1.3077, -3.0769 * 10**-4], rel=1e-12) == list(XI_1)
    assert pytest.approx([7.6923 * 10**-2, -3.0769 * 10**-7, -8.4968 * 10**-3], rel=1e-12) == list(XI_2)
    page = [47.2372, -2.3327 * 10**3, -0.1610, 1.6900, 1.5163 * 10**-4, -6.9439 * 10**-3, -113.7192, 2.3327 * 10**3]
    assert pytest.approx(page, rel=1e-12) == list(XI_3)
    assert XI_3_ORDER == ("b_3", "a_3", "c_3", "g_3", "d_3", "h_3", "f_3", "e_3")
    assert PRINTED_SLOPE == 0.001
