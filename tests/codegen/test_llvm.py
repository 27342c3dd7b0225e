"""Printed in LLVM's language, expressions and branches mean what they mean in SymPy."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from numba.core.errors import TypingError

from clutchid.codegen.cache import load_module
from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.llvm import ArrayElement, Interface, function
from clutchid.codegen.numba_source import elementwise_source, module_head
from clutchid.codegen.program import lower

pytestmark = pytest.mark.slow

EPS = np.finfo(float).eps

x, y = sp.symbols("x y", real=True)


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """Values of an expression in x and y for arrays of both, by compiled code."""
    numbers = itertools.count()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CLUTCHID_CACHE", str(tmp_path_factory.mktemp("kernels")))

        def compute(value, first, second):
            name = f"f{next(numbers)}"
            text = module_head(name) + elementwise_source(name, (x, y), (), value)
            module = load_module(name, [Path(__file__)], lambda: text)
            return getattr(module, name)(np.asarray(first, float), np.asarray(second, float))

        yield compute


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_gives_what_the_standard_library_gives(computed, name):
    points = np.array([0.15, 0.4, 0.85])
    arguments = (x, y) if name == "pow" else (x,)
    value = x**y if name == "pow" else getattr(sp, name)(x)
    expected = [getattr(math, name)(*([a, 1 - a] if len(arguments) == 2 else [a])) for a in points]
    # libraries round the last bits of a function differently
    np.testing.assert_allclose(computed(value, points, 1 - points), expected, rtol=4 * EPS)


@pytest.mark.parametrize("exponent", [-7, -6, -3, -1, 2, 5, 6, 7, sp.Rational(1, 2), sp.Rational(-1, 2), 0.3])
def test_powers_are_exact_to_their_roundings(computed, exponent):
    points = np.array([0.3, 1.0, 2.7])
    values = computed(x**exponent, points, points)
    np.testing.assert_allclose(values, points ** float(exponent), rtol=8 * EPS)


def test_a_power_of_one_is_one_whatever_the_exponent(computed):
    assert (computed(x**y, [1.0, 1.0, 1.0], [0.0, np.inf, -3.3]) == 1.0).all()
    assert np.isnan(computed(x**y, [np.nan], [0.5])).all()


CONDITIONS = [
    (sp.And(x > 0, y > 0), lambda a, b: a > 0 and b > 0),
    (sp.Or(x > 0, y >= 1), lambda a, b: a > 0 or b >= 1),
    (sp.Not(sp.And(x > 0, y > 0), evaluate=False), lambda a, b: not (a > 0 and b > 0)),
    (sp.ITE(x < 0, y > 0, sp.Ne(y, 1)), lambda a, b: b > 0 if a < 0 else b != 1),
    (sp.Eq(x, y), lambda a, b: a == b),
    (sp.And(x <= y, sp.Or(x < 0, y < 1)), lambda a, b: a <= b and (a < 0 or b < 1)),
]


@pytest.mark.parametrize(("condition", "holds"), CONDITIONS)
def test_conditions_hold_where_they_hold(computed, condition, holds):
    first, second = np.array(list(itertools.product([-1.0, 0.0, 1.0, 2.0], repeat=2))).T
    values = computed(sp.Piecewise((1, condition), (2, True)), first, second)
    assert values.tolist() == [1.0 if holds(a, b) else 2.0 for a, b in zip(first, second, strict=True)]


def test_what_one_arm_computes_is_not_taken_over_by_another(computed):
    shared = sp.sqrt(x * y + 1)
    inner = sp.Piecewise((shared, y > 0), (shared + 1, True))
    value = sp.Piecewise((shared * inner, x > 0), (inner - shared, x > -1), (shared, True)) + shared
    first, second = np.array(list(itertools.product([-2.0, -0.5, 0.5], [-0.4, 0.3]))).T
    expected = [float(value.subs({x: a, y: b})) for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(computed(value, first, second), expected, rtol=8 * EPS)


def test_the_arm_that_is_not_taken_cannot_poison_the_value(computed):
    value = sp.Piecewise((sp.sqrt(x) / y, sp.And(x > 0, y > 0)), (0, True))
    assert computed(value, [-1.0, 4.0, 4.0], [1.0, 0.0, 2.0]).tolist() == [0.0, 0.0, 1.0]


def test_a_column_that_is_not_contiguous_is_refused_by_name(computed):
    with pytest.raises(TypingError, match=r"out is .*; wanted is an array of float64 in the order of C"):
        _call_with(np.zeros((4, 4))[:, 0])
    with pytest.raises(TypingError, match="wanted is an array of float64"):
        _call_with(np.zeros(4, np.float32))


def _call_with(array):
    import numba

    from clutchid.codegen.linked import linked

    law = function("one", Interface(("out",)), lower(x, sp.Integer(1)), {}, [(ArrayElement("out", 0), x)])
    write = linked(law.name, law.arguments, law.text)

    @numba.njit
    def kernel(out):
        write(out)

    kernel(array)


def test_equal_texts_have_one_name_and_others_have_their_own():
    def name(value):
        return function("f", Interface(("out",)), lower(x, value), {}, [(ArrayElement("out", 0), x)]).name

    assert name(sp.Integer(1)) == name(sp.Integer(1))
    assert name(sp.Integer(1)) != name(sp.Integer(2))


@pytest.mark.parametrize("value", [sp.gamma(x), sp.oo, sp.Piecewise((1, sp.Xor(x > 0, y > 0)), (0, True))])
def test_what_cannot_be_printed_is_refused_by_name(value):
    with pytest.raises(NotImplementedError, match=r"no (gamma\(\)|number oo|Xor) in this language"):
        elementwise_source("f", (x, y), (), value)
