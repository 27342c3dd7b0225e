"""The B-spline load, for any increasing knots: that of SciPy inside, straight outside."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from clutchid.errors import ParameterError
from clutchid.model import Load
from clutchid.model.weighted_load import DEFAULT_KNOTS

pytestmark = pytest.mark.slow

EPS = 2.3e-16
gaps = st.lists(st.floats(3e-4, 6e-3), min_size=1, max_size=12)
knots = st.tuples(st.floats(-2e-3, 4e-3), gaps).map(lambda g: tuple(float(t) for t in np.cumsum([g[0], *g[1]])))
positions = st.floats(-5e-3, 4e-2)


def blank(t: tuple[float, ...]) -> Load:
    return Load((0.0,) * (len(t) + 2), t, basis="b-spline")


def rounding(t: tuple[float, ...], y: float) -> float:
    """Rounding of a basis function: some dozens of operations; outside it grows with the way in units of a gap."""
    smallest = min(b - a for a, b in pairwise(t))
    outside = max(t[0] - y, y - t[-1], 0.0)
    return 100 * EPS * (1 + 3 * outside / smallest)


@given(knots, positions)
def test_the_basis_and_its_curvature_are_those_of_scipy_inside_and_straight_lines_outside(t, y):
    """So it adds up to one, is nowhere negative inside, and is twice continuously differentiable there."""
    load, spline = blank(t), BSpline([t[0]] * 3 + list(t) + [t[-1]] * 3, np.eye(len(t) + 2), 3)
    at, smallest = min(max(y, t[0]), t[-1]), min(b - a for a, b in pairwise(t))
    expected = spline(at) + (y - at) * spline(at, 1)
    np.testing.assert_allclose(load.phi(np.array([y]))[0], expected, rtol=0, atol=4 * rounding(t, y))
    bent = spline(at, 2) if t[0] <= y < t[-1] else np.zeros(len(t) + 2)
    # the recursion divides by gaps twice
    np.testing.assert_allclose(load.curvature(np.array([y]))[0], bent, rtol=0, atol=400 * EPS / smallest**2)


def test_the_table_of_a_load_is_read_alike_by_the_kernels_and_by_the_load_itself():
    # The slope that the Jacobian has is that of the load: M dv_dot/dy = - f_l' where neither stop nor gas depends on y.
    from clutchid.model.compiled import kernels
    from clutchid.parameters import Parameters

    theta = np.random.default_rng(4).uniform(0, 5e3, len(DEFAULT_KNOTS) + 2)
    load = Load(tuple(theta), DEFAULT_KNOTS, basis="b-spline")
    y = np.random.default_rng(5).uniform(1e-5, 24.9e-3, 300)
    x = np.column_stack([y, np.zeros((300, 1)), np.full((300, 2), 1.095e5), np.zeros((300, 1))])
    rates, jacobian = np.empty_like(x), np.empty((300, 5, 5))
    arguments = (np.zeros((300, 2)), Parameters().array(), load.breakpoints, load.combined())
    kernels("isothermal").linearise(x, *arguments, rates, jacobian)
    np.testing.assert_allclose(-10 * rates[:, 1], load.force(y), rtol=0, atol=1e-10)
    h = 1e-7
    slope = (load.force(y + h) - load.force(y - h)) / (2 * h)
    # rounding of 5 kN over the step, and h^2 / 6 of a third derivative of 1e4 N over 0.5 mm cubed
    np.testing.assert_allclose(-10 * jacobian[:, 1, 0], slope, rtol=0, atol=5e3 * 4 * EPS / h + h**2 * 6e14)


def test_a_load_on_b_splines_comes_near_the_one_that_it_is_made_from():
    paper = Load((9e5, -0.3e5, 0.6e5))
    y = np.linspace(0, 25e-3, 501)
    # 5 kN of load; a cubic spline misses the kinks of phi_2' and phi_3'' by some newtons with knots a millimetre apart
    assert np.abs(Load.on_b_splines(paper).force(y) - paper.force(y)).max() < 20
    again = Load.on_b_splines(Load.on_b_splines(paper))
    assert np.abs(again.force(y) - Load.on_b_splines(paper).force(y)).max() < 1e-8 * 5e3
    assert Load.on_b_splines() == Load.on_b_splines(Load())


@pytest.mark.parametrize("t", [(0.0,), (), (0.0, 0.0), (2e-3, 1e-3), (0.0, float("nan"))])
def test_knots_of_a_b_spline_must_be_two_or_more_and_increase(t):
    with pytest.raises(ParameterError, match="two or more strictly increasing"):
        Load((0.0,) * (len(t) + 2), t, basis="b-spline")
    with pytest.raises(ParameterError, match="two or more strictly increasing"):
        Load.on_b_splines(knots=t)


@pytest.mark.parametrize("theta", [(1.0,) * 4, (1.0,) * 6, (1.0,) * 4 + (float("nan"),)])
def test_a_b_spline_has_two_weights_more_than_knots(theta):
    with pytest.raises(ParameterError, match="5 finite weights in N are needed"):
        Load(theta, (0.0, 1e-2, 2e-2), basis="b-spline")


def test_a_basis_that_does_not_exist_is_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'b-spline'"):
        Load(basis="bspline")
