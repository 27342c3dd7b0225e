"""LLVM's intermediate language of a program, instruction by instruction, without Numba's front end.

Numba spends nine tenths of the time of a compilation on typing and rewriting what is only arithmetic of doubles. So the
straight-line part of a kernel is printed as LLVM's own text, which is optimised and assembled in tenths of a second,
and only the loops around it are Python.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from clutchid.codegen.kernels import FAST
from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, targets
from clutchid.codegen.system import Expr

_RELATIONS = {sp.Gt: "ogt", sp.Ge: "oge", sp.Lt: "olt", sp.Le: "ole", sp.Eq: "oeq", sp.Ne: "une"}
_INTRINSIC = {"sqrt", "pow", "exp", "log", "sin", "cos"}


@dataclass(frozen=True, slots=True)
class ArrayElement:
    """Element `index` of the array `array`."""

    array: str
    index: int


@dataclass(slots=True)
class Writer:
    """Instructions as they are written, and what holds each symbol's value.

    Symbols in `places` are loaded where they are used first, so that an arm that is not taken loads nothing either.
    `written` has the instructions whose result can be used again: those of this block and of the blocks around it.
    """

    places: dict[Expr, ArrayElement] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    values: dict[Expr, str] = field(default_factory=dict)
    bases: dict[str, str] = field(default_factory=dict)
    written: list[dict[str, str]] = field(default_factory=lambda: [{}])
    lookup: Callable[[Lookup], None] | None = None
    block: str = "entry"
    count: int = 0

    def new(self, instruction: str) -> str:
        """The result of an instruction, written unless it has been before."""
        for names in self.written:
            if instruction in names:
                return names[instruction]
        name = f"%{self._unused()}"
        self.lines.append(f"  {name} = {instruction}")
        self.written[-1][instruction] = name
        return name

    def address(self, place: ArrayElement) -> str:
        """Address of `place`."""
        return self.new(f"getelementptr double, ptr {self.bases[place.array]}, i64 {place.index}")

    def load(self, place: ArrayElement) -> str:
        """The number at `place`."""
        return self.new(f"load double, ptr {self.address(place)}")

    def store(self, place: ArrayElement, value: str) -> None:
        """Write a number to `place`."""
        self.lines.append(f"  store double {value}, ptr {self.address(place)}")

    def run(self, statements: Iterable[Statement]) -> None:
        """Write `statements`; a table is looked up by `lookup`."""
        for statement in statements:
            if isinstance(statement, Assign):
                self.values[statement.target] = self.number(sp.sympify(statement.value))
            elif isinstance(statement, Branch):
                self._branch(statement)
            elif self.lookup is not None:
                self.lookup(statement)

    def number(self, value: Expr) -> str:
        """The value of an expression."""
        if value.is_Symbol:
            return self.values[value] if value in self.values else self.load(self.places[value])
        if value.is_number:
            return constant(value)
        if value.is_Add or value.is_Mul:
            return self._sum(value) if value.is_Add else self._product(value)
        if value.is_Pow:
            return self._power(value.base, value.exp)
        return self._call(value.func.__name__, *value.args)

    def _unused(self) -> str:
        self.count += 1
        return f".{self.count}"

    def _chain(self, operation: str, values: Sequence[str]) -> str:
        result, *others = values
        for other in others:
            result = self.new(f"{operation} {FAST} double {result}, {other}")
        return result

    def _sum(self, value: Expr) -> str:
        result = ""
        for term in value.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            part = self.number(-term if negative else term)
            if result:
                result = self._chain("fsub" if negative else "fadd", [result, part])
            else:
                result = self.new(f"fneg {FAST} double {part}") if negative else part
        return result

    def _product(self, value: Expr) -> str:
        coefficient, rest = value.as_coeff_Mul()
        if coefficient == -1:
            return self.new(f"fneg {FAST} double {self.number(rest)}")
        return self._chain("fmul", [self.number(factor) for factor in value.as_ordered_factors()])

    def _power(self, base: Expr, exponent: Expr) -> str:
        unit = constant(sp.Integer(1))
        if exponent.is_Integer and abs(exponent) <= 6:
            factor = self.number(base)
            if exponent < 0:
                factor = self._chain("fdiv", [unit, factor])
            return self._chain("fmul", [factor] * abs(int(exponent)))
        if abs(exponent) == sp.Rational(1, 2):
            root = self._call("sqrt", base)
            return root if exponent > 0 else self._chain("fdiv", [unit, root])
        return self._general_power(self.number(base), self.number(exponent))

    def _general_power(self, base: str, exponent: str) -> str:
        """A power; ``pow``, as costly as all the rest of a stage, is not called for a base of 1: in choked flow."""
        unit, key = constant(sp.Integer(1)), f"pow {base}, {exponent}"
        for names in self.written:
            if key in names:
                return names[key]
        trivial = self.new(f"fcmp {FAST} oeq double {base}, {unit}")
        before, full, after = self.block, self._unused(), self._unused()
        self.lines.append(f"  br i1 {trivial}, label %{after}, label %{full}")
        self._begin(full)
        name = f"%{self._unused()}"
        self.lines.append(f"  {name} = call {FAST} double @llvm.pow.f64(double {base}, double {exponent})")
        self.lines.append(f"  br label %{after}")
        self._begin(after)
        self.written[-1][key] = self.new(f"phi double [ {unit}, %{before} ], [ {name}, %{full} ]")
        return self.written[-1][key]

    def _call(self, name: str, *arguments: Expr) -> str:
        if name not in FUNCTIONS:
            raise NotImplementedError(f"no {name}() in this language; known are {', '.join(FUNCTIONS)}.")
        printed = ", ".join(f"double {self.number(argument)}" for argument in arguments)
        return self.new(f"call {FAST} double {called(name)[0]}({printed})")

    def _condition(self, value: Expr) -> str:
        if value is sp.true or value is sp.false:
            return "true" if value is sp.true else "false"
        if type(value) in _RELATIONS:
            left, right = self.number(value.lhs), self.number(value.rhs)
            return self.new(f"fcmp {FAST} {_RELATIONS[type(value)]} double {left}, {right}")
        if isinstance(value, (sp.And, sp.Or)):
            word = "and" if isinstance(value, sp.And) else "or"
            first, *others = (self._condition(argument) for argument in sorted(value.args, key=str))
            for other in others:
                first = self.new(f"{word} i1 {first}, {other}")
            return first
        if isinstance(value, sp.Not):
            return self.new(f"xor i1 {self._condition(value.args[0])}, true")
        if isinstance(value, sp.ITE):
            condition, yes, no = (self._condition(argument) for argument in value.args)
            return self.new(f"select i1 {condition}, i1 {yes}, i1 {no}")
        raise NotImplementedError(
            f"no {value.func.__name__} in this language; known are relations, And, Or, Not and ITE."
        )

    def _branch(self, branch: Branch) -> None:
        """The arms as blocks of their own; where they meet, each symbol that all of them set has one value again."""
        outputs, after, before, depth = targets(branch), self._unused(), dict(self.values), len(self.written)
        ends: list[tuple[str, list[str]]] = []
        for condition, arm in branch.arms:
            self.values = dict(before)
            otherwise = ""
            if condition is not sp.true:
                tested, then, otherwise = self._condition(condition), self._unused(), self._unused()
                self.lines.append(f"  br i1 {tested}, label %{then}, label %{otherwise}")
                self._begin(then)
            self.written.append({})
            self.run(arm)
            self.written.pop()
            ends.append((self.block, [self.values[output] for output in outputs]))
            self.lines.append(f"  br label %{after}")
            if otherwise:
                self._begin(otherwise)
                self.written.append({})
        del self.written[depth:]
        self.values = before
        self._begin(after)
        for number, output in enumerate(outputs):
            ways = ", ".join(f"[ {values[number]}, %{block} ]" for block, values in ends)
            same = len({values[number] for _, values in ends}) == 1
            self.values[output] = ends[0][1][number] if same else self.new(f"phi double {ways}")

    def _begin(self, block: str) -> None:
        self.lines.append(f"{block}:")
        self.block = block


def constant(value: Expr) -> str:
    """A number as LLVM reads it: the bits of a double.

    Raises
    ------
    NotImplementedError
        If it is not finite.
    """
    number = float(value)
    if number - number != 0.0:
        raise NotImplementedError(f"no number {value} in this language; numbers are finite.")
    return f"0x{struct.unpack('<Q', struct.pack('<d', number))[0]:016X}"


def called(name: str) -> tuple[str, int]:
    """The symbol of a mathematical function, and how many arguments it has."""
    return f"@llvm.{name}.f64" if name in _INTRINSIC else f"@{name}", 2 if name == "pow" else 1


@dataclass(frozen=True, slots=True)
class Function:
    """A function of the module: its text under a name that no other text has, and the types of its arguments."""

    name: str
    arguments: dict[str, str]
    text: str


@dataclass(frozen=True, slots=True)
class Interface:
    """Arguments of a function: arrays, those of them that are entered at an index, and numbers.

    An array ``u`` in `moving` is followed by an argument ``u_at``, the element that counts as its first. `others` come
    last, with their types. With `inline` the function's code is put into each kernel that calls it.
    """

    arrays: tuple[str, ...]
    moving: tuple[str, ...] = ()
    numbers: tuple[tuple[str, Expr], ...] = ()
    others: tuple[tuple[str, str], ...] = ()
    inline: bool = False

    def arguments(self) -> dict[str, str]:
        """Names of the arguments in their order, with their types."""
        out: dict[str, str] = {}
        for array in self.arrays:
            out[array] = "ptr noalias"
            if array in self.moving:
                out[f"{array}_at"] = "i64"
        return out | {name: "double" for name, _ in self.numbers} | dict(self.others)


def function(
    name: str,
    interface: Interface,
    statements: Sequence[Statement],
    loads: Mapping[Expr, ArrayElement],
    stores: Sequence[tuple[ArrayElement, Expr]],
) -> Function:
    """The function that reads `loads`, runs `statements` and writes `stores`.

    Raises
    ------
    NotImplementedError
        If an expression uses a function or a relation that is not printed.
    """
    writer = Writer(places=dict(loads))
    writer.values |= {symbol: f"%{name}" for name, symbol in interface.numbers}
    for array in interface.arrays:
        moved = f"getelementptr double, ptr %{array}, i64 %{array}_at"
        writer.bases[array] = writer.new(moved) if array in interface.moving else f"%{array}"
    writer.run(statements)
    for place, value in stores:
        writer.store(place, writer.number(sp.sympify(value)))
    return finished(name, interface, writer.lines)


def finished(name: str, interface: Interface, lines: Iterable[str], helpers: str = "") -> Function:
    """The function with these instructions; `helpers` are functions that it calls."""
    arguments = interface.arguments()
    head = ", ".join(f"{kind} %{argument}" for argument, kind in arguments.items())
    body = "\n".join(["entry:", *lines, "  ret void", "}", ""])
    named = f"clutchid_{name}_{hashlib.sha256((head + body + helpers).encode()).hexdigest()[:16]}"
    inline = "alwaysinline " if interface.inline else ""
    text = f"define weak_odr void @{named}({head}) {inline}nounwind {{\n{body}{helpers}{_declarations(body)}"
    return Function(named, {name: kind.split()[0] for name, kind in arguments.items()}, text)


def _declarations(body: str) -> str:
    symbols = [called(name) for name in FUNCTIONS]
    return "".join(
        f"declare double {symbol}({', '.join(['double'] * count)})\n"
        for symbol, count in symbols
        if f"double {symbol}(" in body
    )
