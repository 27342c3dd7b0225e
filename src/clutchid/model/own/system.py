"""The equations of an `OwnModel`: those of its variant with terms and rates replaced, states added and left out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import sympy as sp

from clutchid.codegen.system import Expr, Jump, System, symbols_in

if TYPE_CHECKING:
    from clutchid.model.own.model import OwnModel

#: Name of a term of the variant within the expression that replaces it.
BEFORE = "{}_base"


def canonical(value: Expr) -> Expr:
    """`value` with real symbols, which are known by their names alone."""
    expression = sp.sympify(value)
    return expression.xreplace({s: _real(s.name) for s in expression.free_symbols})


def own_system(model: OwnModel, base: System) -> System:
    """The equations of `model` on top of the system `base`, without the terms that are used no longer.

    Raises
    ------
    ValueError
        If terms depend on each other in a circle, or a symbol is not defined.
    """
    rates, terms = combined_rates(model, base), combined_terms(model, base)
    used = ordered(terms, rates.values())
    needed = ordered(terms, [_real(name) for name in terms if name in used])  # as in the variant, where that can be
    symbols = tuple(_real(name) for name in rates)
    return replace(
        base,
        name=model.name,
        states=symbols,
        parameters=(*base.parameters, *(_real(name) for name in model.parameters)),
        frequent=(*base.frequent, *(_real(name) for name, row in model.parameters.items() if row.adapts)),
        definitions=tuple((_real(name), terms[name]) for name in needed),
        derivatives=tuple(rates.values()),
        jumps=tuple(_jump(jump, base, symbols) for jump in base.jumps),
    )


def combined_rates(model: OwnModel, base: System) -> dict[str, Expr]:
    """Rates of change by state, in the order of the states."""
    rates = {str(state): rate for state, rate in zip(base.states, base.derivatives, strict=True)}
    base_rates = {name: rate for name, rate in rates.items() if name not in model.without}
    new = {name: canonical(value) for name, value in model.rates.items()}
    return {**base_rates, **{name: new[name] for name in (*base_rates, *model.states) if name in new}}


def combined_terms(model: OwnModel, base: System) -> dict[str, Expr]:
    """All terms by name: those of the variant, then those of the model in their place or in addition."""
    terms = {str(symbol): value for symbol, value in base.definitions}
    for name, value in model.terms.items():
        new = canonical(value)
        if name in terms and _real(name) in new.free_symbols:
            before = BEFORE.format(name)
            terms[before] = terms[name]
            new = new.xreplace({_real(name): _real(before)})
        terms[name] = new
    return terms


def ordered(terms: Mapping[str, Expr], values: Iterable[Expr]) -> tuple[str, ...]:
    """Names of the terms that `values` need, each after those that it needs itself.

    Raises
    ------
    ValueError
        If terms depend on each other in a circle; the text has the circle.
    """
    names: dict[str, None] = {}

    def visit(value: Expr, way: tuple[str, ...]) -> None:
        for name in sorted(s.name for s in symbols_in([value]) if s.name in terms):
            if name in way:
                raise ValueError(" -> ".join((*way[way.index(name) :], name)))
            if name not in names:
                visit(terms[name], (*way, name))
                names[name] = None

    for value in values:
        visit(value, ())
    return tuple(names)


def _jump(jump: Jump, base: System, states: tuple[Expr, ...]) -> Jump:
    """A reset of the variant; new states go on."""
    resets = dict(zip(base.states, jump.states, strict=True))
    return Jump(jump.name, tuple(resets.get(state, state) for state in states))


def _real(name: str) -> Expr:
    return sp.Symbol(name, real=True)
