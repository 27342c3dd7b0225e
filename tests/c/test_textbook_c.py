"""Generated C of textbook systems: every shape of a system compiles strictly and follows its exact solution."""

import math

import numpy as np
import pytest
import sympy as sp

from clutchid.codegen.c99 import c99_source
from clutchid.codegen.system import System

pytestmark = pytest.mark.slow


def _symbols(names):
    return sp.symbols(names, real=True, seq=True)


def test_a_system_whose_names_are_words_of_c_compiles_and_follows_its_exact_solution(build):
    x, double, u, k, c, step = _symbols("x double u k c step")
    system = System("spring", (x, double), (u,), (k, c, step), (), (double, (u - k * x - c * double) / step))
    status, out, _ = build(system).run([0.0, 0.0], [[2.0]] * 1001, [9.0, 0.0, 1.0], [1e-3] * 1000)
    t = 1e-3 * np.arange(1001)
    # Classical RK4: T h^4 omega^5 / 120 times the amplitude 2 / 9; plus a thousand roundings.
    np.testing.assert_allclose(out[:, 0], 2 / 9 * (1 - np.cos(3 * t)), atol=1e-12 * 3**5 / 120 * 2 / 9 + 1e3 * 2.0**-52)
    assert status == -1


@pytest.mark.parametrize(("real", "eps"), [("double", 2.0**-52), ("float", 2.0**-23)])
def test_a_system_without_inputs_parameters_and_table_compiles(build, real, eps):
    (x,) = _symbols("x")
    status, out, _ = build(System("decay", (x,), (), (), (), (-x,)), real).run(
        [1.0], np.zeros((51, 0)), [], [0.02] * 50
    )
    assert status == -1
    # One step is the Taylor series of order 4, wrong by exp(h) h^5 / 120 of its value; and a few roundings a step.
    np.testing.assert_allclose(
        out[:, 0], np.exp(-0.02 * np.arange(51)), rtol=50 * (math.exp(0.02) * 0.02**5 / 120 + 4 * eps)
    )


@pytest.mark.parametrize(("real", "eps"), [("double", 2.0**-52), ("float", 2.0**-23)])
def test_functions_branches_and_inputs_that_are_used_at_every_stage(build, real, eps):
    x, q, u, a = _symbols("x q u a")
    root = sp.Piecewise((sp.sqrt(q), q > 0), (0, True))
    system = System("mixed", (x, q), (u,), (a,), (), (u * sp.sin(x) - sp.Abs(x) * a, -a * root))
    status, out, _ = build(system, real).run([1.0, 4.0], [[0.0]] * 101, [0.3], [0.01] * 100)
    assert status == -1
    t = 0.01 * np.arange(101)
    tolerance = 100 * 10 * eps + 0.01**4
    np.testing.assert_allclose(out[:, 0], np.exp(-0.3 * t), rtol=tolerance)
    np.testing.assert_allclose(out[:, 1], (2 - 0.15 * t) ** 2, rtol=tolerance)
    _, driven, _ = build(system, real).run([1.0, -1.0], [[1.0]] * 101, [0.0], [0.01] * 100)
    # x' = sin x: tan(x / 2) grows like exp t; an empty tank stays as it is.
    np.testing.assert_allclose(driven[:, 0], 2 * np.arctan(math.tan(0.5) * np.exp(t)), rtol=tolerance)
    assert (driven[:, 1] == -1).all()


@pytest.mark.parametrize("real", ["double", "float"])
def test_the_first_sample_that_is_not_finite_is_returned(build, real):
    (x,) = _symbols("x")
    status, out, _ = build(System("blow_up", (x,), (), (), (), (x**2,)), real).run(
        [1.0], np.zeros((301, 0)), [], [0.01] * 300
    )
    assert 100 < status < 130
    assert np.isfinite(out[:status]).all()
    assert not np.isfinite(out[status]).any()


def test_notes_become_comments_at_their_names():
    x, a = _symbols("x a")
    code = c99_source(System("noted", (x,), (), (a,), (), (-a * x,)), notes={"a": "rate, 1/s"})
    assert "noted_p_a = 0 /* rate, 1/s */" in code.header


def test_definitions_are_named_where_they_are_computed_case_by_case():
    x, a, flow = _symbols("x a flow")
    system = System("named", (x,), (), (a,), ((flow, sp.Piecewise((a * x, x > 0), (0, True))),), (-flow,))
    assert "/* flow, case by case */" in c99_source(system).source


def test_unused_parameters_are_not_unpacked():
    x, a, b = _symbols("x a b")
    code = c99_source(System("spare", (x,), (), (a, b), (), (-b * x,))).source
    assert "b = p[1]" in code
    assert "a = p[0]" not in code


def test_an_unknown_number_type_and_an_impossible_name_are_refused():
    (x,) = _symbols("x")
    with pytest.raises(ValueError, match="known are double, float"):
        c99_source(System("decay", (x,), (), (), (), (-x,)), real="half")
    with pytest.raises(ValueError, match="not a C identifier"):
        c99_source(System("predator-prey", (x,), (), (), (), (-x,)))


def test_loading_the_library_leaves_the_arithmetic_of_the_process_alone(build):
    (x,) = _symbols("x")
    build(System("decay", (x,), (), (), (), (-x,)), "double", ("-O3", "-ffast-math")).library()
    assert np.float64(5e-324) * 1.0 > 0  # a subnormal number is not flushed to zero
