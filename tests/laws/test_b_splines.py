"""Laws of the B-spline load, for any increasing knots: a partition of unity, smooth inside, straight outside."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.errors import ParameterError
from clutchid.model import Load
from clutchid.model.weighted_load import DEFAULT_KNOTS, b_spline_table

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
def test_the_basis_functions_add_up_to_one_everywhere(t, y):
    assert abs(blank(t).phi(np.array([y])).sum() - 1) <= (len(t) + 2) * rounding(t, y)


@given(knots, st.floats(0, 1))
def test_inside_no_basis_function_is_negative_and_four_at_most_are_at_work(t, part):
    y = t[0] + part * (t[-1] - t[0])
    values = blank(t).phi(np.array([y]))[0]
    assert values.min() >= -100 * EPS
    assert (np.abs(values) > 100 * EPS).sum() <= 4


@given(knots)
def test_at_the_first_knot_only_the_first_weight_counts_and_at_the_last_only_the_last(t):
    first, last = blank(t).phi(np.array([t[0], t[-1]]))
    np.testing.assert_allclose(first, np.eye(len(t) + 2)[0], rtol=0, atol=10 * EPS)
    np.testing.assert_allclose(last, np.eye(len(t) + 2)[-1], rtol=0, atol=10 * EPS)


def jumps(t: tuple[float, ...], at: int, power: int) -> float:
    """Jump of the derivative of order `power` across breakpoint `at`, in units of its size there (force per gap^n)."""
    breakpoints, c = b_spline_table(t)
    left = np.polynomial.polynomial.Polynomial
    step = breakpoints[at] - breakpoints[max(at - 1, 0)]
    sizes = []
    for basis in c:
        before = left(basis[at]).deriv(power)(step) if power else left(basis[at])(step)
        after = left(basis[at + 1]).deriv(power)(0.0) if power else left(basis[at + 1])(0.0)
        sizes.append(abs(before - after))
    smallest = min(b - a for a, b in pairwise(t))
    return float(max(sizes) * smallest**power)


@settings(max_examples=40)
@given(knots)
def test_the_load_is_twice_continuously_differentiable_inside_and_once_at_its_ends(t):
    for at in range(len(t)):
        orders = (0, 1, 2) if 0 < at < len(t) - 1 else (0, 1)
        # the recursion divides by gaps up to 20 times the smallest one; a hundred roundings times that for a power
        assert max(jumps(t, at, power) for power in orders) <= 100 * EPS * 20**3


@given(knots, st.floats(0, 2e-2))
def test_outside_the_knots_every_basis_function_goes_on_as_a_straight_line(t, beyond):
    load = blank(t)
    for end, direction in ((t[0], -1), (t[-1], 1)):
        at = end + direction * np.array([0.0, 0.5, 1.0]) * beyond
        values = load.phi(at)
        allowed = 4 * rounding(t, at[-1])
        assert np.abs(values[2] - 2 * values[1] + values[0]).max() <= allowed
        assert not load.curvature(at[1:] + direction * 1e-9).any()


@given(knots, st.floats(0.02, 0.98))
def test_the_curvature_is_the_second_derivative_of_the_basis(t, part):
    load = blank(t)
    y = t[0] + part * (t[-1] - t[0])
    smallest = min(b - a for a, b in pairwise(t))
    h = 1e-3 * smallest
    low, middle, high = load.phi(np.array([y - h, y, y + h]))
    slope_twice = (low - 2 * middle + high) / h**2
    exact = load.curvature(np.array([y]))[0]
    # a second difference of a cubic is its second derivative exactly, but for a knot between, where the third
    # derivative, 6 / gap^3 at most for a B-spline of this size, jumps; rounding over h^2
    assert np.abs(slope_twice - exact).max() <= 4 * EPS / h**2 + 50 * h / smallest**3


@given(knots, st.floats(-1e6, 1e6), st.floats(-1e4, 1e4))
def test_a_straight_load_has_its_weights_at_the_means_of_three_knots(t, slope, height):
    clamped = np.array([t[0]] * 3 + list(t) + [t[-1]] * 3)
    means = np.array([clamped[i + 1 : i + 4].mean() for i in range(len(t) + 2)])
    load = Load(tuple(height + slope * means), t, basis="b-spline")
    y = np.linspace(t[0] - 2e-3, t[-1] + 2e-3, 40)
    size = abs(height) + abs(slope) * 0.1
    assert np.abs(load.force(y) - height - slope * y).max() <= 20 * rounding(t, t[-1] + 2e-3) * size


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
