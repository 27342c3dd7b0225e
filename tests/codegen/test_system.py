"""A `System` is valid from birth."""

import pytest
import sympy as sp

from clutchid.codegen.numba_source import function_source
from clutchid.codegen.system import Jump, System, Table

x, y, a, b, d, f = sp.symbols("x y a b d f", real=True)


def test_a_symbol_must_be_defined_before_it_is_used():
    with pytest.raises(ValueError, match=r"d uses b before it is defined"):
        System("s", (x,), (), (a,), ((d, a * b),), (d,))
    with pytest.raises(ValueError, match=r"x uses y"):
        System("s", (x,), (), (a,), (), (y,))


def test_a_name_must_not_stand_twice():
    with pytest.raises(ValueError, match="x named twice"):
        System("s", (x,), (x,), (), (), (x,))
    with pytest.raises(ValueError, match="a named twice"):
        System("s", (x,), (), (a,), (), (x,), Table(a, x))


def test_every_state_needs_a_derivative():
    with pytest.raises(ValueError, match="2 states but 1 derivatives"):
        System("s", (x, y), (), (), (), (x,))


def test_a_jump_sets_every_state_from_states_parameters_and_measured_values():
    assert System("s", (x,), (), (a,), (), (x,), measured=(b,), jumps=(Jump("j", (a * x + b,)),)).jumps
    with pytest.raises(ValueError, match=r"jump j: 2 of 1 states"):
        System("s", (x,), (), (), (), (x,), jumps=(Jump("j", (x, x)),))
    with pytest.raises(ValueError, match=r"jump j uses d"):
        System("s", (x,), (), (a,), ((d, a * x),), (d,), jumps=(Jump("j", (d,)),))


def test_a_function_of_numbers_is_printed_with_nested_results():
    names: dict = {}
    exec("import math" + function_source("g", (x, y), [x + y, [x * y, sp.sqrt(x)]]), names)
    assert names["g"](4.0, 3.0) == (7.0, (12.0, 2.0))
