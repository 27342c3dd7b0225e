"""Laws of the three splines, for any strictly increasing knots: what Section 2.5 says of them, and the table."""

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


def conditioned(t: tuple[float, ...]) -> float:
    """Rounding of a value in m: some hundred operations, and cubic coefficients that cancel over (reach / gap)^3."""
    gap = min(b - a for a, b in pairwise(t))
    reach = 2 * t[3] - t[1] - min(t[0], 0)
    return 100 * EPS * reach * (reach / gap) ** 3


def closed_form(t: tuple[float, ...], slope: float, y: float) -> list[float]:
    """A slope that falls linearly from 1 to 0 between the second and third knot, one that rises, and a cubic hump."""
    t_1, t_2, t_3, t_4 = t
    way, width = min(max(y - t_2, 0.0), t_3 - t_2), t_3 - t_2
    rising = min(max(y - t_1, 0.0), t_2 - t_1) + way - way**2 / (2 * width)
    inside = max(0.0, 1 - abs(y - t_4) / (t_4 - t_2))
    return [rising, slope * way**2 / (2 * width) + max(y - t_3, 0.0), 1e-3 * inside**2 * (3 - 2 * inside)]


@given(knots, slopes, st.floats(-0.02, 0.08))
def test_the_basis_has_its_closed_form_everywhere_and_on_both_sides_of_every_knot(t, slope, anywhere):
    load = Load(knots=t, phi2_slope=slope)
    for y in (anywhere, *load.breakpoints, *(load.breakpoints - 1e-12), *(load.breakpoints + 1e-12)):
        allowed = conditioned(t) + 100 * EPS * abs(y)
        np.testing.assert_allclose(phi(load, y), closed_form(t, slope, y), rtol=0, atol=allowed)
    assert not phi(load, t[0] - 1e-6).any(), "no rounding makes a load before the first knot"
    assert not phi(load, t[1] - 1e-6)[1:].any()


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
