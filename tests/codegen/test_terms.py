"""Terms as plain Python: the same numbers as the kernels, each at its turn."""

import importlib.util
import math

import numpy as np
import pytest
import sympy as sp

from clutchid.codegen.numba_source import elementwise_source, numba_source, terms_source
from clutchid.codegen.system import System


@pytest.fixture(scope="module")
def made():
    """Run the source of a system's terms: made(system) has `terms` and `TERMS`."""

    def make(system):
        module = {"math": math}
        exec(terms_source(system), module)
        return module

    return make


def test_terms_come_in_the_order_of_the_text_and_then_the_rates(made, assorted):
    module = made(assorted)
    assert [name for name, *_ in module["TERMS"]] == ["drag", "outflow", "d_a", "d_h", "d_m", "d_w"]
    # b = 2, q = 3, f = 0.5 at a = -2, h = 4, m = 1, w = 0 and s = 5
    values = list(module["terms"]([-2.0, 4.0, 1.0, 0.0], [5.0], [2.0, 3.0], 0.5))
    assert values == [-8.0, 6.0, 8.0, -6.0, 4.0, -0.5]


def test_every_term_names_the_parameters_and_the_states_and_terms_that_stand_in_it(made, assorted):
    rows = {name: rest for name, *rest in made(assorted)["TERMS"]}
    assert rows["drag"] == [("b",), ("a",)]
    assert rows["outflow"] == [("q",), ("h",)]
    assert rows["d_a"] == [(), ("drag",)]
    assert rows["d_w"] == [(), ("f",)]


def test_a_derivative_that_is_a_definition_itself_names_what_stands_in_that_one(made):
    x, y, k, s, pull = sp.symbols("x y k s pull", real=True)
    module = made(System("pulled", (x, y), (s,), (k,), ((pull, k * (s - x)),), (pull, -2 * pull)))
    assert module["TERMS"] == (("pull", ("k",), ("x",)), ("d_x", ("k",), ("x",)), ("d_y", (), ("pull",)))
    assert list(module["terms"]([1.0, 0.0], [3.0], [4.0])) == [8.0, 8.0, -16.0]


def test_names_that_the_code_wants_for_itself_are_told_as_the_text_has_them(made, oscillator):
    module = made(oscillator)
    assert module["TERMS"] == (("d_x", (), ("v",)), ("d_v", ("k", "c", "S"), ("x", "v")))
    assert list(module["terms"]([1.0, 2.0], [3.0], [4.0, 5.0, 6.0])) == pytest.approx([2.0, -11.0 / 6.0])


def test_a_term_that_cannot_be_computed_raises_at_its_turn(made, oscillator):
    values = made(oscillator)["terms"]([1.0, 2.0], [3.0], [4.0, 5.0, 0.0])
    assert next(values) == 2.0
    with pytest.raises(ZeroDivisionError):
        next(values)


def test_an_elementwise_function_computes_every_row(tmp_path, logistic):
    t, low, high = sp.symbols("t low high", real=True)
    path = tmp_path / "rows.py"
    middle = elementwise_source("middle", (t,), (low, high), abs(t - (low + high) / 2))
    path.write_text(numba_source(logistic) + middle)
    spec = importlib.util.spec_from_file_location("rows_of_a_test", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.middle(np.array([0.0, 2.0, 5.0]), 1.0, 3.0).tolist() == [2.0, 0.0, 3.0]
