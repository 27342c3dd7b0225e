"""Printed expressions: exact with rational numbers, and as text."""

from fractions import Fraction

import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from clutchid.codegen.language import C_DOUBLE, C_FLOAT, PYTHON, Language

a, b, x = sp.symbols("a b x", real=True)
#: Numbers are printed as decimals of a double: the nearest fraction with a small denominator was meant.
EXACT = Language(
    "Fraction", "Fraction('{}').limit_denominator(1000)", "and", "or", "not ", "True", "False", {"pow": "pow"}
)

halves = st.integers(-12, 12).map(lambda n: sp.Rational(n, 4))
arithmetic = st.recursive(
    st.sampled_from([a, b, x]) | halves,
    lambda inner: (
        st.tuples(inner, inner).map(lambda p: p[0] + p[1])
        | st.tuples(inner, inner).map(lambda p: p[0] - p[1])
        | st.tuples(inner, inner).map(lambda p: p[0] * p[1])
        | inner.map(lambda e: -e)
        | inner.map(lambda e: e**3)
        | inner.map(lambda e: 1 / (e**2 + 1))
        | inner.map(lambda e: (e**2 + 2) ** -2)
    ),
    max_leaves=10,
)
fractions = st.fractions(-4, 4, max_denominator=9)


@pytest.mark.slow
@settings(max_examples=100, deadline=None, derandomize=True)
@given(arithmetic, fractions, fractions, fractions)
def test_printed_arithmetic_is_exact_in_rational_numbers(expression, first, two, three):
    assume(all(number.q <= 1000 and abs(number.p) < 1000 for number in expression.atoms(sp.Rational)))
    text = EXACT.print(expression)
    printed = eval(text, {"Fraction": Fraction, "a": first, "b": two, "x": three})
    exact = sp.Rational(*_ratio(expression, {a: first, b: two, x: three}))
    assert sp.Rational(Fraction(printed).numerator, Fraction(printed).denominator) == exact


def _ratio(expression, point):
    value = expression.subs({symbol: sp.Rational(q.numerator, q.denominator) for symbol, q in point.items()})
    return sp.Rational(value).p, sp.Rational(value).q


@pytest.mark.parametrize(
    ("expression", "python", "double", "single"),
    [
        (x / 2, "0.5*x", "0.5*x", "0.5F*x"),
        (a / x, "a*(1.0/x)", "a*(1.0/x)", "a*(1.0F/x)"),
        (x**2, "x*x", "x*x", "x*x"),
        (sp.sqrt(x), "math.sqrt(x)", "sqrt(x)", "sqrtf(x)"),
        (1 / sp.sqrt(x), "(1.0/math.sqrt(x))", "(1.0/sqrt(x))", "(1.0F/sqrtf(x))"),
        (x**a, "math.pow(x, a)", "pow(x, a)", "powf(x, a)"),
        (sp.exp(-x), "math.exp(-x)", "exp(-x)", "expf(-x)"),
        (sp.pi * x, "3.141592653589793*x", "3.141592653589793*x", "3.141592653589793F*x"),
        (sp.And(x > 0, a <= b), "(a <= b) and (x > 0.0)", "(a <= b) && (x > 0.0)", "(a <= b) && (x > 0.0F)"),
        (sp.Or(x > 0, sp.Ne(a, b)), None, "(x > 0.0) || (a != b)", "(x > 0.0F) || (a != b)"),
        (sp.true, "True", "1", "1"),
        (sp.Float("1e-9") * x, "1e-09*x", "1e-09*x", "1e-09F*x"),
    ],
)
def test_each_language_spells_numbers_logic_and_functions_its_own_way(expression, python, double, single):
    printed = [language.print(expression) for language in (PYTHON, C_DOUBLE, C_FLOAT)]
    if isinstance(expression, sp.Or):  # the order of the arguments is SymPy's
        assert all(
            sorted(p.split(" || ")) == sorted(q.split(" || "))
            for p, q in zip(printed[1:], (double, single), strict=True)
        )
    else:
        assert printed == [python, double, single]


def test_a_negation_that_sympy_cannot_resolve_is_printed():
    p = sp.Symbol("p")
    assert C_DOUBLE.print(sp.Not(sp.And(p, x > 0), evaluate=False)).startswith("!(")


@pytest.mark.parametrize(
    ("expression", "named"),
    [(sp.gamma(x), "gamma"), (sp.Abs(x), "Abs"), (sp.oo, "finite"), (sp.Xor(sp.Symbol("p"), x > 0), "Xor")],
)
def test_what_a_language_cannot_say_is_refused_by_name(expression, named):
    with pytest.raises(NotImplementedError, match=named):
        C_DOUBLE.print(expression)
