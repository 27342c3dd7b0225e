"""Checks of an `OwnModel`: its names, units and equations; each problem is one sentence."""

from __future__ import annotations

import difflib
import keyword
import math
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import sympy as sp

from clutchid.codegen.numba_source import block
from clutchid.codegen.program import lower
from clutchid.codegen.system import Expr, System, symbols_in
from clutchid.errors import ParameterError
from clutchid.log import COLUMNS
from clutchid.log.states import STATES
from clutchid.model.own.rows import OwnParameter, OwnState
from clutchid.model.own.system import canonical, combined_rates, combined_terms, ordered
from clutchid.model.own.units import dimension_of, unit_problems
from clutchid.model.variants import VARIANTS, variant_system
from clutchid.names import unknown_name
from clutchid.parameters import GROUPS, GroupChange, Parameters

if TYPE_CHECKING:
    from clutchid.model.own.model import OwnModel

#: States that measurement, resets and the load need.
_REQUIRED = ("y", "v", "p_A", "p_B")

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

#: Words that mean something else where a parameter or state is named.
_TAKEN = ("load", "auto", "time", "f_l", "y_measured", "p_A_measured", "y_start", "p_A_start")


def check_own_model(model: OwnModel) -> None:
    """Refuse a model whose names, units or equations do not fit.

    Raises
    ------
    ParameterError
        The text lists all problems.
    """
    if model.base not in VARIANTS:
        raise ParameterError(f"base: {unknown_name(str(model.base), VARIANTS, 'model variant')}")
    base = variant_system(model.base)
    problems = (
        [*_wrong_types(model)]
        or [*_name_problems(model, base), *_row_problems(model), *_equation_problems(model, base)]
        or [*_use_problems(model, base)]
        or [*unit_problems(model, base)]
    )
    ParameterError.raise_for(problems)


def _wrong_types(model: OwnModel) -> Iterator[str]:
    """Entries that are no records or expressions."""
    mappings = ("parameters", "states", "terms", "rates")
    wrong = [key for key in mappings if not isinstance(getattr(model, key), Mapping)]
    yield from (f"{key} = {getattr(model, key)!r}: a dictionary by name is needed." for key in wrong)
    if isinstance(model.without, str):
        yield f"without = {model.without!r}: a tuple of names is needed, ({model.without!r},)."
    if wrong:
        return
    for key, kind in (("parameters", OwnParameter), ("states", OwnState)):
        for name, row in getattr(model, key).items():
            if not isinstance(row, kind):
                yield f"{key}: {name} = {row!r}: write {kind.__name__}(...)."
    for key in ("terms", "rates"):
        for name, value in getattr(model, key).items():
            try:
                expression = None if isinstance(value, str) else sp.sympify(value)
            except sp.SympifyError:
                expression = None
            if not isinstance(expression, sp.Expr):
                yield f"{key}: {name} = {value!r}: a SymPy expression of symbols('...') is needed, no text."


def _name_problems(model: OwnModel, base: System) -> Iterator[str]:
    """New names that are no identifiers or have a meaning already, and states that cannot be left out."""
    terms = {str(symbol) for symbol, _ in base.definitions}
    meanings = {
        **dict.fromkeys(_TAKEN, "a word of clutchid"),
        **dict.fromkeys((*COLUMNS, *(str(s) for s in base.inputs)), "a column or input"),
        **dict.fromkeys(terms, f"a term of {model.base}"),
        **dict.fromkeys(STATES, "a state of clutchid"),
        **dict.fromkeys(Parameters.names(), "a parameter of clutchid"),
    }
    new = [("parameter", name) for name in model.parameters] + [("state", name) for name in model.states]
    new += [("term", name) for name in model.terms if name not in terms] + [("model", model.name)]
    seen: dict[str, str] = {}
    for what, name in new:
        if not isinstance(name, str) or not _NAME.fullmatch(name) or keyword.iskeyword(name):
            yield (
                f"{what} {name!r}: a name has letters, digits and _, begins with a letter and is not a Python keyword."
            )
        elif what != "model" and (name in meanings or re.fullmatch(r"theta_\d+", name)):
            yield f"{what} {name}: the name is taken, by {meanings.get(name, 'a load weight')}; choose another one."
        elif what == "term" and name.startswith("d_"):
            yield f"term {name}: names that begin with d_ are those of rates; choose another one."
        elif what != "model" and name in seen:
            yield f"{what} {name}: the name is taken, by a {seen[name]} of this model; choose another one."
        seen[name] = what
    states = [str(state) for state in base.states]
    for name in model.without:
        if name in _REQUIRED or name not in states:
            others = ", ".join(state for state in states if state not in _REQUIRED)
            yield f"without: {name}: of the states of {model.base}, {others} can be left out."


def _row_problems(model: OwnModel) -> Iterator[str]:
    for name, parameter in model.parameters.items():
        yield from (f"parameter {name}: {problem}" for problem in _parameter_problems(parameter))
    for name, state in model.states.items():
        yield from (f"state {name}: {problem}" for problem in _state_problems(state, model))


def _no_numbers(entries: Mapping[str, object]) -> list[str]:
    """Problems with entries that are no numbers."""
    wrong = {key: v for key, v in entries.items() if isinstance(v, bool) or not isinstance(v, (int, float))}
    return [f"{key} = {value!r}: a number is needed." for key, value in wrong.items()]


def _parameter_problems(parameter: OwnParameter) -> Iterator[str]:
    yield from _bad_unit(parameter.unit)
    limits = parameter.range if isinstance(parameter.range, tuple | list) else ()
    entries = {
        "default": parameter.default,
        "drift": parameter.drift,
        **{f"range[{i}]": v for i, v in enumerate(limits)},
    }
    optional = {key: v for key in ("std", "adapts") if (v := getattr(parameter, key)) is not None}
    if problems := [*_no_numbers(entries | optional), *_change_problems(parameter.changes)]:
        yield from problems
        return
    if parameter.range is None:
        yield "no admissible range; give range=(SMALLEST, LARGEST), with -inf or inf where it is open."
    elif len(limits) != 2 or not parameter.range[0] < parameter.range[1]:
        yield f"range = {parameter.range}: the smallest and the largest admissible value are needed, in this order."
    elif not parameter.row.admits(parameter.default):
        yield f"default = {parameter.default!r} {parameter.unit}: it must be {parameter.row.allowed}."
    for key, std in optional.items():
        if not 0.0 < std < math.inf:
            of = "a prior" if key == "std" else "a change on line"
            yield f"{key} = {std!r} {parameter.unit}: the standard deviation of {of} is above 0 and finite."
    if not 0.0 <= parameter.drift < math.inf:
        yield f"drift = {parameter.drift!r} {parameter.unit}: a standard deviation is at least 0 and finite."


def _change_problems(changes: object) -> list[str]:
    """Entries of `changes` that are no changes with a group."""
    if not isinstance(changes, tuple) or not all(isinstance(change, GroupChange) for change in changes):
        return [f"changes = {changes!r}: a tuple of GroupChange(GROUP, STD) is needed."]
    unknown = [change.group for change in changes if change.group not in list(GROUPS)]
    problems = [f"changes: {unknown_name(str(group), GROUPS, 'group')}" for group in unknown]
    stds = {f"changes, {change.group}, std": change.std for change in changes}
    infinite = [key for key, std in stds.items() if isinstance(std, float) and not math.isfinite(std)]
    return [*problems, *_no_numbers(stds), *(f"{key} = {stds[key]!r}: it must be finite." for key in infinite)]


def _state_problems(state: OwnState, model: OwnModel) -> Iterator[str]:
    yield from _bad_unit(state.unit)
    if problems := _no_numbers({"scale": state.scale} | ({} if state.noise is None else {"noise": state.noise})):
        yield from problems
        return
    if not 0.0 < state.scale < math.inf:
        yield f"scale = {state.scale!r} {state.unit}: the size that it reaches is above 0 and finite."
    if state.noise is not None and not 0.0 < state.noise < math.inf:
        yield f"noise = {state.noise!r} {state.unit}: a standard deviation is above 0 and finite."
    if state.start is None:
        return
    if state.start not in model.parameters and state.start not in Parameters.names():
        yield f"start = {state.start!r}: the name of a parameter is needed, or none for 0."
        return
    own = model.parameters.get(state.start)
    unit = own.unit if own else Parameters.row(state.start).unit
    if not [*_bad_unit(unit), *_bad_unit(state.unit)] and dimension_of(unit) != dimension_of(state.unit):
        yield f"start = {state.start!r} has the unit {unit}, the state has {state.unit}."


def _bad_unit(unit: str) -> Iterator[str]:
    try:
        dimension_of(str(unit))
    except ValueError as error:
        yield f"unit {unit!r}: {error}. All values are in SI."


def _equation_problems(model: OwnModel, base: System) -> Iterator[str]:
    """Rates that are missing or belong to no state, and unknown symbols and functions."""
    states = [str(s) for s in base.states if str(s) not in model.without] + list(model.states)
    lacking = [name for name in model.states if name not in model.rates]
    yield from (f"rates: {name}: missing; give the rate of change of every new state." for name in lacking)
    for name in model.rates:
        if name not in states:
            yield f"rates: {unknown_name(name, states, 'state')}"
    left = {str(s) for s in (*base.inputs, *base.parameters)} | {str(s) for s, _ in base.definitions}
    symbols = {*states, *left, *model.parameters, *model.terms, "f_l"}
    for where, value in _equations(model):
        unknown = sorted(s.name for s in value.free_symbols if s.name not in symbols)
        yield from (f"{where}: {_unknown_symbol(name, symbols, model, states)}" for name in unknown)
        try:
            block(lower(sp.Symbol("value"), value))
        except (NotImplementedError, ValueError) as error:
            yield f"{where}: {error} Piecewise, Abs, Min and Max are known too."


def _unknown_symbol(name: str, symbols: set[str], model: OwnModel, states: list[str]) -> str:
    if name in model.without:
        return f"{name} is left out (without)."
    near = difflib.get_close_matches(name, sorted(symbols), n=1, cutoff=0.4)
    hint = f"; did you mean '{near[0]}'?" if near else "."
    return (
        f"'{name}' is not a state, input, parameter or term{hint} States are {', '.join(states)}; own parameters are "
        f"{', '.join(model.parameters) or 'none'}; the others are in docs/equations.md."
    )


def _equations(model: OwnModel) -> Iterator[tuple[str, Expr]]:
    yield from ((f"terms: {name}", canonical(value)) for name, value in model.terms.items())
    yield from ((f"rates: {name}", canonical(value)) for name, value in model.rates.items())


def _use_problems(model: OwnModel, base: System) -> Iterator[str]:
    """Terms in a circle, what is used nowhere, and states that are left out and still used."""
    terms, rates = combined_terms(model, base), combined_rates(model, base)
    try:
        needed = ordered(terms, rates.values())
    except ValueError as error:
        yield f"terms depend on each other: {error}."
        return
    values = {**{name: terms[name] for name in needed}, **{f"rate of {name}": rate for name, rate in rates.items()}}
    symbols = {where: {s.name for s in symbols_in([value])} for where, value in values.items()}
    used = set().union(*symbols.values())
    base_terms = [str(symbol) for symbol, _ in base.definitions]
    if idle := [name for name in model.terms if name not in used]:
        near = difflib.get_close_matches(idle[0], base_terms, n=1, cutoff=0.4)
        hint = f"; did you mean '{near[0]}'?" if near and idle[0] not in base_terms else "."
        yield f"terms: {', '.join(idle)}: no equation uses it{hint} Terms of {model.base} are {', '.join(base_terms)}."
        return
    begins = {row.start for row in model.states.values()}
    for name in model.parameters:
        if name not in used and name not in begins:
            yield f"parameter {name}: stands in no equation that is used; take it out or use it."
    for name in model.without:
        if users := [where for where, inside in symbols.items() if name in inside]:
            yield f"without: {name}: still used by {', '.join(users)}; replace these too."
