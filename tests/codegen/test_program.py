"""Lowering, differentiation, dead code and staging, against SymPy's own evaluation."""

import math

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.codegen.differentiation import differentiate
from clutchid.codegen.numba_source import block
from clutchid.codegen.program import Assign, Branch, Lookup, live, lower, reads, right_hand_side, targets
from clutchid.codegen.staging import staged
from clutchid.codegen.system import System, TabulatedFunction
from clutchid.model.isothermal import isothermal

pytestmark = pytest.mark.slow

a, b, c, x, y, out = sp.symbols("a b c x y out", real=True)
EPS = 2.0**-52


def execute(statements, values):
    """The variables after running the statements as the generated Python does."""
    names = {"math": math, **{str(symbol): value for symbol, value in values.items()}}
    exec(block(statements), names)
    return names


#: Eighths: sums and products of a few are exact, so rounding never decides a branch.
numbers = st.integers(-24, 24).map(lambda value: value / 8)
leaves = st.sampled_from([a, b, x]) | st.integers(-3, 3).map(sp.Integer)


def _grow(inner):
    def cases(arms):
        first, second, left, right = arms
        return sp.Piecewise((first, left < right), (second, True))

    unary = inner.flatmap(lambda e: st.sampled_from([sp.Abs(e), e**2, sp.sin(e)]))
    binary = st.tuples(inner, inner).flatmap(
        lambda p: st.sampled_from([p[0] + p[1], p[0] * p[1], sp.Max(*p), sp.Min(*p)])
    )
    return unary | binary | st.tuples(inner, inner, inner, inner).map(cases)


expressions = st.recursive(leaves, _grow, max_leaves=8)


def _size(expression, point):
    """An upper bound of all intermediate values: every operation on magnitudes, every branch at once."""
    if not expression.args:
        return abs(float(expression.subs(point))) + 1
    parts = [_size(argument, point) for argument in expression.args if not getattr(argument, "is_Boolean", False)]
    if expression.is_Pow:
        return parts[0] ** abs(int(expression.exp))
    return math.prod(parts) if expression.is_Mul else sum(parts)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(expressions, numbers, numbers, numbers)
def test_a_lowered_expression_has_the_value_of_the_expression(expression, at_a, at_b, at_x):
    point = {a: at_a, b: at_b, x: at_x}
    exact = float(expression.subs({symbol: sp.Rational(value) for symbol, value in point.items()}).evalf(30))
    # Every operation rounds: a few hundred roundings of the largest intermediate value.
    assert execute(lower(out, expression), point)["out"] == pytest.approx(
        exact, abs=300 * EPS * _size(expression, point)
    )


def test_a_piecewise_expression_without_a_last_branch_is_refused():
    with pytest.raises(ValueError, match="every other case"):
        lower(out, sp.Piecewise((x, x > 0)))


def test_an_arm_that_is_not_taken_is_never_computed():
    root = sp.Piecewise((sp.sqrt(x), x > 0), (0, True))
    # math.sqrt(-1) would raise.
    assert execute(lower(out, root), {x: -1.0})["out"] == 0
    extended, by = differentiate(lower(out, root), [x])
    values = execute(extended, {x: -1.0})
    assert values[str(by[out][x])] == 0


def test_auxiliary_names_avoid_those_that_are_taken():
    expression = 1 + sp.Piecewise((x, x > 0), (a, True))
    assert {str(t) for s in lower(out, expression) for t in targets(s)} == {"out_1", "out"}
    assert {str(t) for s in lower(out, expression, {"out_1"}) for t in targets(s)} == {"out_2", "out"}


def test_neighbouring_branches_on_the_same_condition_become_one():
    total = sp.Piecewise((a, x > 0), (b, True)) + sp.Piecewise((b, x > 0), (c, True))
    assert sum(isinstance(s, Branch) for s in lower(out, total)) == 1
    assert execute(lower(out, total), {a: 1, b: 10, c: 100, x: -1})["out"] == 110


def test_reads_and_targets_of_a_branch_are_what_enters_and_what_every_arm_sets():
    inner = sp.Symbol("inner", real=True)
    first = (Assign(inner, a * x), Assign(out, inner + 1))
    branch = Branch(((x > y, first), (sp.true, (Assign(out, b),))))
    assert reads(branch) == {a, b, x, y}
    assert targets(branch) == [out]


def test_dead_statements_are_dropped_inside_branches_too():
    spare = sp.Symbol("spare", real=True)
    arms = tuple(
        (condition, (Assign(spare, value), Assign(out, value))) for condition, value in ((x > 0, a), (sp.true, b))
    )
    program = [Assign(c, a), Branch(arms), Lookup(y, sp.Symbol("slope"), x)]
    run = live(program, [out])
    assert run == [Branch(tuple((condition, (body[1],)) for condition, body in arms))]
    assert live(program, [y]) == [program[2]]
    assert live(program, []) == []


smooth = st.recursive(
    leaves,
    lambda inner: (
        inner.map(sp.sin)
        | inner.map(lambda e: e**2)
        | st.tuples(inner, inner).map(lambda p: p[0] + p[1])
        | st.tuples(inner, inner).map(lambda p: p[0] * p[1])
        | st.tuples(inner, inner).map(lambda p: sp.Piecewise((p[0], x > sp.Rational(1, 7)), (p[1], True)))
    ),
    max_leaves=8,
)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(smooth, smooth, numbers, numbers, numbers)
def test_forward_derivatives_are_those_of_sympy(first, second, at_a, at_b, at_x):
    point = {a: at_a, b: at_b, x: at_x}
    program = [*lower(y, first), *lower(out, second * y + y)]
    extended, by = differentiate(program, [a, b, x])
    values = execute(extended, point)
    whole = second * first + first
    exact_point = {symbol: sp.Rational(value) for symbol, value in point.items()}
    for seed in (a, b, x):
        derivative = by.get(out, {}).get(seed, sp.Integer(0))
        computed = values[str(derivative)] if derivative.is_Symbol else float(derivative)
        slope = sp.diff(whole, seed)
        exact = float(slope.subs(exact_point).evalf(30))
        scale = _size(whole, point) * _size(slope, point) if slope != 0 else _size(whole, point)
        assert computed == pytest.approx(exact, abs=1000 * EPS * scale)


def test_the_derivative_of_a_table_goes_through_its_slope_and_its_weights():
    f, slope = sp.symbols("f f_slope", real=True)
    extended, by = differentiate([Assign(y, x**2), Lookup(f, slope, y), Assign(out, 3 * f)], [x, f])
    program = [s for s in extended if not isinstance(s, Lookup)]
    values = execute(program, {x: 2.0, f: 5.0, slope: 7.0})
    assert values[str(by[out][x])] == 3 * 7 * 2 * 2
    assert by[out][f] == 3


def _staged_values(parts, point):
    return execute([*parts.constants, *parts.held, *parts.stage], point)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(expressions, expressions, numbers, numbers, numbers)
def test_a_staged_program_computes_what_the_unstaged_one_does(first, second, at_a, at_b, at_x):
    point = {a: at_a, b: at_b, x: at_x}
    program = [*lower(y, first), *lower(out, second * (y + a) + a * b)]
    parts = staged(program, [a], [b])
    scale = _size(second, point) * (_size(first, point) + 4) + 10
    assert _staged_values(parts, point)["out"] == pytest.approx(execute(program, point)["out"], abs=300 * EPS * scale)


def test_what_depends_on_parameters_only_is_computed_once_a_run_and_on_inputs_once_a_sample():
    program = [Assign(y, sp.sqrt(a) + 1), Assign(c, y * sp.exp(b)), Assign(out, x * c + sp.sin(a * x) / a)]
    parts = staged(program, [a], [b])
    symbols_of = {
        name: {t for s in getattr(parts, name) for t in targets(s)} for name in ("constants", "held", "stage")
    }
    assert y in symbols_of["constants"]
    assert c in symbols_of["held"]
    assert symbols_of["stage"] == {out}
    assert not any(s.value.has(sp.exp) or s.value.has(sp.sqrt) for s in parts.stage)


def test_nothing_that_is_computed_early_reads_what_is_known_late():
    statements, parameters, inputs = _isothermal_program()
    parts = staged(statements, parameters, inputs)
    system = isothermal()
    names = set(system.parameters)
    for name, more in (("constants", ()), ("held", inputs), ("stage", system.states)):
        names |= set(more)
        for statement in getattr(parts, name):
            assert reads(statement) <= names
            names |= set(targets(statement))


def _isothermal_program():
    """Without its table, whose value becomes an input."""
    system = isothermal()
    statements, _ = right_hand_side(system)
    inputs = (*system.inputs, system.table.value)
    return [s for s in statements if not isinstance(s, Lookup)], system.parameters, inputs


def test_definitions_are_computed_in_order_and_the_table_before_its_first_use():
    f, first, second = sp.symbols("f first second", real=True)
    system = System("s", (x,), (), (a,), ((first, a * x), (second, first + f)), (second,), TabulatedFunction(f, x))
    statements, rates = right_hand_side(system)
    assert [str(t) for s in statements for t in targets(s)] == ["first", "f", "f_slope", "second", "d_x"]
    assert [str(rate) for rate in rates] == ["d_x"]
