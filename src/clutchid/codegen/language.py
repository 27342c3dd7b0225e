"""Printed expressions: one recursive printer, one record a language, and the names that it uses itself.

Divisions are printed as products with reciprocals, so that a compiler shares one division among all uses of a volume
or a pressure; powers are printed as products.
"""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from clutchid.codegen.system import Expr, System, TabulatedFunction

_RELATIONS = {sp.Gt: ">", sp.Ge: ">=", sp.Lt: "<", sp.Le: "<=", sp.Eq: "==", sp.Ne: "!="}


@dataclass(frozen=True, slots=True)
class Language:
    """Spelling of numbers, logic and functions in a programming language; `real` is the type of its numbers.

    If `grouped`, operands with operators stand in parentheses, so that nothing hangs on precedence (MISRA C, 12.1).
    """

    real: str
    number: str
    both: str
    either: str
    negation: str
    true: str
    false: str
    functions: Mapping[str, str]
    grouped: bool = False

    def print(self, value: Expr) -> str:
        """`value` as source text.

        Raises
        ------
        NotImplementedError
            For a function that the language record does not know, or an infinite number.
        """
        return self._visit(sp.sympify(value))

    def _visit(self, value: Expr) -> str:
        if value.is_Symbol:
            return str(value)
        if isinstance(value, sp.logic.boolalg.Boolean):
            return self._logic(value)
        if value.is_number:
            return self._number(value)
        if value.is_Add or value.is_Mul:
            return self._sum(value) if value.is_Add else self._product(value)
        if value.is_Pow:
            return self._power(value.base, value.exp)
        return self._call(value.func.__name__, *value.args)

    def _logic(self, value: Expr) -> str:
        if value is sp.true or value is sp.false:
            return self.true if value is sp.true else self.false
        if type(value) in _RELATIONS:
            return f"{self._operand(value.lhs)} {_RELATIONS[type(value)]} {self._operand(value.rhs)}"
        if isinstance(value, (sp.And, sp.Or)):
            word = self.both if isinstance(value, sp.And) else self.either
            return f" {word} ".join(f"({self._visit(a)})" for a in sorted(value.args, key=str))
        if isinstance(value, sp.Not):
            return f"{self.negation}({self._visit(value.args[0])})"
        if isinstance(value, sp.ITE):
            return self._logic(
                sp.Or(sp.And(value.args[0], value.args[1]), sp.And(sp.Not(value.args[0]), value.args[2]))
            )
        raise NotImplementedError(
            f"no {value.func.__name__} in this language; known are relations, And, Or, Not and ITE."
        )

    def _number(self, value: Expr) -> str:
        if not math.isfinite(float(value)):
            raise NotImplementedError(f"no number {value} in this language; numbers are finite.")
        return self.number.format(repr(float(value)))

    def _call(self, name: str, *arguments: Expr) -> str:
        if name not in self.functions:
            raise NotImplementedError(f"no {name}() in this language; known are {', '.join(self.functions)}.")
        return f"{self.functions[name]}({', '.join(self._visit(a) for a in arguments)})"

    def _operand(self, value: Expr) -> str:
        text = self._visit(value)
        return f"({text})" if self.grouped and (value.is_Add or value.is_Mul or value.is_Pow) else text

    def _sum(self, value: Expr) -> str:
        text = ""
        for term in value.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            part = -term if negative else term
            text += (" - " if negative else " + ") + (f"({self._visit(part)})" if part.is_Add else self._operand(part))
        return text[3:] if text.startswith(" + ") else "-" + text[3:]

    def _product(self, value: Expr) -> str:
        coefficient, rest = value.as_coeff_Mul()
        if coefficient == -1:
            return f"-{self._factor(rest)}" if not rest.is_Mul else f"-{self._visit(rest)}"
        return "*".join(self._factor(a) for a in value.as_ordered_factors())

    def _factor(self, value: Expr) -> str:
        text = self._visit(value)
        return f"({text})" if value.is_Add or (value.is_number and value < 0) else text

    def _power(self, base: Expr, exponent: Expr) -> str:
        if exponent.is_Integer and abs(exponent) <= 6:
            factor = self._factor(base) if base.is_Symbol or base.is_number else f"({self._visit(base)})"
            if exponent < 0:
                factor = f"({self._number(sp.Integer(1))}/{factor})"
            return "*".join([factor] * abs(int(exponent)))
        if abs(exponent) == sp.Rational(1, 2):
            root = self._call("sqrt", base)
            return root if exponent > 0 else f"({self._number(sp.Integer(1))}/{root})"
        return self._call("pow", base, exponent)


FUNCTIONS = ("sqrt", "pow", "exp", "log", "sin", "cos", "tan", "tanh", "sinh", "cosh", "asin", "acos", "atan")

PYTHON = Language("float", "{}", "and", "or", "not ", "True", "False", {name: f"math.{name}" for name in FUNCTIONS})
C_DOUBLE = Language("double", "{}", "&&", "||", "!", "1", "0", {name: name for name in FUNCTIONS}, grouped=True)
C_FLOAT = replace(C_DOUBLE, real="float", number="{}F", functions={name: f"{name}f" for name in FUNCTIONS})

#: The languages of C by their type of numbers.
C_LANGUAGES = {language.real: language for language in (C_DOUBLE, C_FLOAT)}


_PYTHON = "math x u p"
_C = """
    x u p c held table memory dx n h half sixth stage reach weight sum at i k a offset argument segment
    lookup rhs step constants hold run out dt substeps table_slope
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    isfinite fabs fabsf INFINITY NAN
"""

#: Names of arguments, locals and modules in the generated Python.
PYTHON_WORDS = frozenset(_PYTHON.split()) | frozenset(keyword.kwlist)

#: Names of arguments, locals and functions in the generated C, and the words of C99 and its mathematics.
C_WORDS = frozenset(_C.split()) | frozenset(name + suffix for name in FUNCTIONS for suffix in ("", "f"))

_GENERATED = re.compile(r"(const|held)_\d+|_.*|.*__.*")


def apart(system: System, words: Collection[str]) -> System:
    """`system` with those symbols renamed that generated code would confuse with `words` or its own variables.

    A parameter ``k`` becomes ``k_``; symbols without a conflict keep their names, so the code stays readable.
    """
    taken = {str(symbol) for symbol in system.symbols}
    renamed: dict[Expr, Expr] = {}
    for symbol in system.symbols:
        name = re.sub("__+", "_", str(symbol)).lstrip("_") or "a"
        others, prefixes = taken - {str(symbol)}, ("d_", "new_") if symbol in system.states else ()
        while (
            name in words
            or name in others
            or _GENERATED.fullmatch(name)
            or any(prefix + name in taken for prefix in prefixes)
        ):
            # two underscores in a row mark derivatives
            name += "a" if name.endswith("_") else "_"
        taken |= {name, *(prefix + name for prefix in prefixes)}
        if name != str(symbol):
            renamed[symbol] = sp.Symbol(name, **symbol.assumptions0)
    return _renamed(system, renamed) if renamed else system


def _renamed(system: System, renamed: dict[Expr, Expr]) -> System:
    def new(value: Expr) -> Expr:
        return sp.sympify(value).xreplace(renamed)

    def mapped(values: Iterable[Expr]) -> tuple[Expr, ...]:
        return tuple(new(value) for value in values)

    return replace(
        system,
        states=mapped(system.states),
        inputs=mapped(system.inputs),
        parameters=mapped(system.parameters),
        definitions=tuple((new(symbol), new(value)) for symbol, value in system.definitions),
        derivatives=mapped(system.derivatives),
        table=TabulatedFunction(new(system.table.value), new(system.table.argument)) if system.table else None,
        measured=mapped(system.measured),
        jumps=tuple(replace(jump, states=mapped(jump.states)) for jump in system.jumps),
    )
