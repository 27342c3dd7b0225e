"""Laws of the three splines, for any strictly increasing knots: the conditions of Section 2.5, and the table."""

from itertools import pairwise

import numpy as np
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from clutchid.model import Load
from clutchid.model.load import paper_basis

EPS = 2.3e-16
gaps = st.floats(5e-4, 2e-2)
knots = st.tuples(st.floats(-5e-3, 5e-3), gaps, gaps, gaps).map(lambda g: tuple(float(t) for t in np.cumsum(g)))
slopes = st.sampled_from([1.0, 0.001, 0.5])


def phi(load: Load, y: float) -> np.ndarray:
    return load.phi(np.array([y]))[0]


def slope_at(load: Load, y: float, side: int) -> np.ndarray:
    """One-sided slope from the coefficients of the segment on that side of y."""
    segment = int(np.searchsorted(load.breakpoints, y, side="right" if side > 0 else "left"))
    offset = y - load.breakpoints[max(segment - 1, 0)]
    c = load.coefficients[:, segment]
    return c[:, 1] + offset * (2 * c[:, 2] + 3 * offset * c[:, 3])


def value_at(load: Load, y: float, side: int) -> np.ndarray:
    segment = int(np.searchsorted(load.breakpoints, y, side="right" if side > 0 else "left"))
    offset = y - load.breakpoints[max(segment - 1, 0)]
    c = load.coefficients[:, segment]
    return c[:, 0] + offset * (c[:, 1] + offset * (c[:, 2] + offset * c[:, 3]))


def conditioned(t: tuple[float, ...]) -> float:
    """Rounding of a value in m: some hundred operations, and cubic coefficients that cancel over (reach / gap)^3."""
    gap = min(b - a for a, b in pairwise(t))
    reach = 2 * t[3] - t[1] - min(t[0], 0)
    return 100 * EPS * reach * (reach / gap) ** 3


@given(knots, slopes)
def test_every_basis_function_is_continuous_at_every_knot(t, slope):
    load = Load(knots=t, phi2_slope=slope)
    for knot in load.breakpoints:
        np.testing.assert_allclose(value_at(load, knot, -1), value_at(load, knot, +1), rtol=0, atol=conditioned(t))


@given(knots, slopes)
def test_slopes_at_the_knots_are_those_of_the_paper(t, slope):
    load = Load(knots=t, phi2_slope=slope)
    t_1, t_2, t_3, t_4 = t
    t_5 = 2 * t_4 - t_2
    tolerance = conditioned(t) / min(b - a for a, b in pairwise(t))
    expected = {
        (t_1, -1): (0, 0, 0), (t_1, +1): (1, 0, 0), (t_2, -1): (1, 0, 0), (t_2, +1): (1, 0, 0),
        (t_3, -1): (0, slope, None), (t_3, +1): (0, 1, None), (t_4, -1): (0, 1, 0), (t_4, +1): (0, 1, 0),
        (t_5, -1): (0, 1, 0), (t_5, +1): (0, 1, 0),
    }  # fmt: skip
    for (knot, side), wanted in expected.items():
        for of_basis, number in zip(slope_at(load, knot, side), wanted, strict=True):
            assert number is None or abs(of_basis - number) <= tolerance, (knot, side, of_basis, number)


@given(knots, st.floats(-0.02, 0.08))
def test_with_the_stated_conditions_the_first_two_add_up_to_the_way_from_the_first_knot(t, y):
    value = phi(Load(knots=t), y)
    tolerance = conditioned(t) + 100 * EPS * abs(y)
    assert abs(value[0] + value[1] - max(0.0, y - t[0])) <= tolerance


@given(knots, slopes, st.floats(0, 0.05))
def test_the_first_rises_from_the_first_knot_and_is_constant_beyond_the_third(t, slope, beyond):
    load = Load(knots=t, phi2_slope=slope)
    assert phi(load, t[0] - beyond)[0] == 0
    height = (t[1] - t[0]) + (t[2] - t[1]) / 2  # a unit slope that falls to 0 linearly
    assert abs(phi(load, t[2] + beyond)[0] - height) <= conditioned(t) + 100 * EPS * beyond


@given(knots, slopes, st.floats(0, 0.05))
def test_the_second_starts_at_the_second_knot_and_runs_on_with_slope_one(t, slope, beyond):
    load = Load(knots=t, phi2_slope=slope)
    assert phi(load, t[1] - 1e-9 - beyond)[1] == 0
    expected = slope * (t[2] - t[1]) / 2 + beyond
    assert abs(phi(load, t[2] + beyond)[1] - expected) <= conditioned(t) + 100 * EPS * beyond


@given(knots, slopes, st.floats(-1.5, 1.5))
def test_the_third_is_a_symmetric_hump_of_a_millimetre_and_zero_outside(t, slope, s):
    load = Load(knots=t, phi2_slope=slope)
    half = t[3] - t[1]
    tolerance = conditioned(t)
    assert abs(phi(load, t[3])[2] - 1e-3) <= tolerance
    value = phi(load, t[3] + s * half)[2]
    assert abs(value - phi(load, t[3] - s * half)[2]) <= 2 * tolerance
    assert -tolerance <= value <= 1e-3 + tolerance
    if abs(s) > 1 + 1e-9:
        assert abs(value) <= tolerance


@settings(max_examples=15)
@given(
    st.tuples(*[st.integers(-20, 60)] * 4),
    st.sampled_from([sp.Integer(1), sp.Rational(1, 1000)]),
    st.integers(-30, 150),
)
def test_the_table_is_the_printed_pieces_evaluated_exactly(tenths, slope, y_tenths):
    tenths = sorted(tenths)
    assume(all(b - a >= 3 for a, b in pairwise(tenths)))
    exact = [sp.Rational(t, 10000) for t in tenths]
    at = sp.Rational(y_tenths, 10000) + sp.Rational(1, 30000)  # never on a knot
    y = sp.Symbol("y", real=True)
    values = []
    for pieces in paper_basis(y, *exact, slope):
        polynomial = next(piece for end, piece in pieces if at < end)
        values.append(float(sp.sympify(polynomial).subs(y, at)))
    t = tuple(float(k) for k in exact)
    load = Load(knots=t, phi2_slope=float(slope))
    tolerance = conditioned(t) + 100 * EPS * (abs(float(at)) / (t[1] - t[0]) + 1)
    np.testing.assert_allclose(phi(load, float(at)), values, rtol=0, atol=tolerance)
