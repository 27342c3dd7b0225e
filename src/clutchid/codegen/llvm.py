"""LLVM's intermediate language of a program, instruction by instruction, without Numba's front end.

Numba spends nine tenths of the time of a compilation on typing and rewriting what is only arithmetic of doubles. So the
straight-line part of a kernel is printed as LLVM's own text, which is optimised and assembled in tenths of a second,
and only the loops around it are Python.

With several lanes every number is a vector, of one number a simulation. Then all arms of a branch are computed, and of
each lane the right one is selected; an arm that takes long is jumped over where no lane needs it.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from clutchid.codegen import mathematics
from clutchid.codegen.kernels import FAST, LANES
from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.program import Assign, Branch, Lookup, Statement, targets
from clutchid.codegen.system import Expr

_RELATIONS = {sp.Gt: "ogt", sp.Ge: "oge", sp.Lt: "olt", sp.Le: "ole", sp.Eq: "oeq", sp.Ne: "une"}
_INTRINSIC = {"sqrt", "pow", "exp", "log", "sin", "cos"}

#: Functions of vectors that are instructions.
_OF_VECTORS = ("sqrt", "fabs")

#: Effort, in sums and products, of an arm that is jumped over where no lane needs it, and of a quotient or a root.
#: Measured with AVX2 by `python benchmarks/many.py`: efforts of 10 to 45 are within 10 %.
_LONG, _SLOW = 30, 12


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
    lanes: int = 1
    lines: list[str] = field(default_factory=list)
    values: dict[Expr, str] = field(default_factory=dict)
    bases: dict[str, str] = field(default_factory=dict)
    written: list[dict[str, str]] = field(default_factory=lambda: [{}])
    lookup: Callable[[Lookup], None] | None = None
    block: str = "entry"
    mask: str = ""
    count: int = 0

    @property
    def real(self) -> str:
        """Type of a number."""
        return real(self.lanes)

    @property
    def truth(self) -> str:
        """Type of a condition."""
        return "i1" if self.lanes == 1 else f"<{self.lanes} x i1>"

    def constant(self, value: Expr) -> str:
        """A number, the same in all lanes."""
        return constant(value, self.lanes)

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
        return self.new(f"getelementptr {self.real}, ptr {self.bases[place.array]}, i64 {place.index}")

    def load(self, place: ArrayElement) -> str:
        """The number at `place`."""
        return self.new(f"load {self.real}, ptr {self.address(place)}, align 8")

    def store(self, place: ArrayElement, value: str) -> None:
        """Write a number to `place`."""
        self.lines.append(f"  store {self.real} {value}, ptr {self.address(place)}, align 8")

    def spread(self, number: str) -> str:
        """A double in all lanes."""
        if self.lanes == 1:
            return number
        first = self.new(f"insertelement {self.real} poison, double {number}, i64 0")
        return self.new(f"shufflevector {self.real} {first}, {self.real} poison, <{self.lanes} x i32> zeroinitializer")

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
            return self.constant(value)
        if value.is_Add or value.is_Mul:
            return self._sum(value) if value.is_Add else self._product(value)
        if value.is_Pow:
            return self._power(value.base, value.exp)
        return self._call(value.func.__name__, *value.args)

    def _unused(self) -> str:
        self.count += 1
        return f".{self.count}"

    def chain(self, operation: str, values: Sequence[str]) -> str:
        """An operation on the first two numbers, on its result and the third one, and so on."""
        result, *others = values
        for other in others:
            result = self.new(f"{operation} {FAST} {self.real} {result}, {other}")
        return result

    def _sum(self, value: Expr) -> str:
        result = ""
        for term in value.as_ordered_terms():
            negative = term.could_extract_minus_sign()
            part = self.number(-term if negative else term)
            if result:
                result = self.chain("fsub" if negative else "fadd", [result, part])
            else:
                result = self.new(f"fneg {FAST} {self.real} {part}") if negative else part
        return result

    def _product(self, value: Expr) -> str:
        coefficient, rest = value.as_coeff_Mul()
        if coefficient == -1:
            return self.new(f"fneg {FAST} {self.real} {self.number(rest)}")
        return self.chain("fmul", [self.number(factor) for factor in value.as_ordered_factors()])

    def _power(self, base: Expr, exponent: Expr) -> str:
        unit = self.constant(sp.Integer(1))
        if exponent.is_Integer and abs(exponent) <= 6:
            factor = self.number(base)
            if exponent < 0:
                factor = self.chain("fdiv", [unit, factor])
            return self.chain("fmul", [factor] * abs(int(exponent)))
        if abs(exponent) == sp.Rational(1, 2):
            root = self._call("sqrt", base)
            return root if exponent > 0 else self.chain("fdiv", [unit, root])
        return self._general_power(self.number(base), self.number(exponent))

    def _general_power(self, base: str, exponent: str) -> str:
        """A power; ``pow``, as costly as all the rest of a stage, is not called for a base of 1: in choked flow."""
        unit, key = self.constant(sp.Integer(1)), f"pow {base}, {exponent} {self.mask}"
        for names in self.written:
            if key in names:
                return names[key]
        needed = self.any(self.masked(self.mask, self.compared("une", base, unit)))
        self.written[-1][key] = self.where(needed, [unit], lambda: [self._function("pow", base, exponent)])[0]
        return self.written[-1][key]

    def _call(self, name: str, *arguments: Expr) -> str:
        if name not in FUNCTIONS:
            raise NotImplementedError(f"no {name}() in this language; known are {', '.join(FUNCTIONS)}.")
        return self._function(name, *(self.number(argument) for argument in arguments))

    def _function(self, name: str, *values: str) -> str:
        return self.called(name, *values) if self.lanes == 1 else mathematics.function(self, name, *values)

    def called(self, name: str, *values: str) -> str:
        """A function of numbers, in one lane."""
        return self.new(f"call {FAST} double {called(name)[0]}({', '.join(f'double {value}' for value in values)})")

    def _condition(self, value: Expr) -> str:
        if value is sp.true or value is sp.false:
            word = "true" if value is sp.true else "false"
            return word if self.lanes == 1 else f"splat (i1 {word})"
        if type(value) in _RELATIONS:
            return self.compared(_RELATIONS[type(value)], self.number(value.lhs), self.number(value.rhs))
        if isinstance(value, (sp.And, sp.Or)):
            word = "and" if isinstance(value, sp.And) else "or"
            first, *others = (self._condition(argument) for argument in sorted(value.args, key=str))
            for other in others:
                first = self.new(f"{word} {self.truth} {first}, {other}")
            return first
        if isinstance(value, sp.Not):
            return self._not(self._condition(value.args[0]))
        if isinstance(value, sp.ITE):
            condition, yes, no = (self._condition(argument) for argument in value.args)
            return self.new(f"select {self.truth} {condition}, {self.truth} {yes}, {self.truth} {no}")
        raise NotImplementedError(
            f"no {value.func.__name__} in this language; known are relations, And, Or, Not and ITE."
        )

    def compared(self, relation: str, left: str, right: str) -> str:
        """Whether a relation of numbers, an ordered or unordered one, holds."""
        return self.new(f"fcmp {FAST} {relation} {self.real} {left}, {right}")

    def _not(self, condition: str) -> str:
        return self.new(f"xor {self.truth} {condition}, {self._condition(sp.true)}")

    def masked(self, mask: str, condition: str) -> str:
        """The lanes of a mask, all where it is empty, in which a condition holds."""
        return self.new(f"and {self.truth} {mask}, {condition}") if mask else condition

    def any(self, condition: str) -> str:
        """Whether a condition holds in a lane."""
        if self.lanes == 1:
            return condition
        return self.new(f"call i1 @llvm.vector.reduce.or.v{self.lanes}i1({self.truth} {condition})")

    def where(self, needed: str, otherwise: Sequence[str], compute: Callable[[], Sequence[str]]) -> list[str]:
        """Values that `compute` writes, in a block that is jumped over unless it is `needed`, or else the others."""
        before, full, after = self.block, self._unused(), self._unused()
        self.lines.append(f"  br i1 {needed}, label %{full}, label %{after}")
        self._begin(full)
        self.written.append({})
        values = compute()
        self.written.pop()
        last = self.block
        self.lines.append(f"  br label %{after}")
        self._begin(after)
        pairs = zip(values, otherwise, strict=True)
        return [self.new(f"phi {self.real} [ {value}, %{last} ], [ {other}, %{before} ]") for value, other in pairs]

    def _selected(self, branch: Branch) -> None:
        """All arms one after the other, and of each symbol that all of them set the value that a lane takes."""
        outputs, before, mask = targets(branch), dict(self.values), self.mask
        arms: list[tuple[str, list[str]]] = []
        for condition, arm in branch.arms:
            self.values = dict(before)
            tested = "" if condition is sp.true else self._condition(condition)
            rest, self.mask = self.mask, self.masked(self.mask, tested) if tested else self.mask

            def compute(arm: Sequence[Statement] = arm) -> list[str]:
                self.run(arm)
                return [self.values[output] for output in outputs]

            if self.mask and effort(arm) > _LONG:
                values = self.where(self.any(self.mask), [self.constant(sp.Integer(0))] * len(outputs), compute)
            else:
                values = compute()
            arms.append((tested, values))
            self.mask = self.masked(rest, self._not(tested)) if tested else rest
        self.values, self.mask = before, mask
        for number, output in enumerate(outputs):
            value = arms[-1][1][number]
            for tested, values in reversed(arms[:-1]):
                if values[number] != value:
                    value = self.new(f"select {self.truth} {tested}, {self.real} {values[number]}, {self.real} {value}")
            self.values[output] = value

    def _branch(self, branch: Branch) -> None:
        """The arms as blocks of their own; where they meet, each symbol that all of them set has one value again."""
        if self.lanes > 1:
            self._selected(branch)
            return
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


def real(lanes: int) -> str:
    """Type of a number in each of so many lanes."""
    return "double" if lanes == 1 else f"<{lanes} x double>"


def effort(statements: Iterable[Statement]) -> int:
    """Effort of all statements, in sums and products."""
    total = 0
    for statement in statements:
        if isinstance(statement, Assign):
            total += _effort(sp.sympify(statement.value))
        elif isinstance(statement, Branch):
            total += sum(_effort(condition) + effort(arm) for condition, arm in statement.arms)
    return total


def _effort(value: Expr) -> int:
    """Effort of an expression; a quotient, a root or another function counts as `_SLOW` sums."""
    slow = [
        part for part in value.atoms(sp.Pow, sp.Function) if not (part.is_Pow and part.exp.is_Integer and part.exp > 0)
    ]
    return int(sp.count_ops(value)) + _SLOW * len(slow)


def constant(value: Expr, lanes: int = 1) -> str:
    """A number as LLVM reads it: the bits of a double, in each lane.

    Raises
    ------
    NotImplementedError
        If it is not finite.
    """
    number = float(value)
    if number - number != 0.0:
        raise NotImplementedError(f"no number {value} in this language; numbers are finite.")
    bits = f"0x{struct.unpack('<Q', struct.pack('<d', number))[0]:016X}"
    return bits if lanes == 1 else f"splat (double {bits})"


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
    lanes: int = 1,
) -> Function:
    """The function that reads `loads`, runs `statements` and writes `stores`.

    With several lanes elements of arrays are vectors; an argument that is a number is the same in all lanes.

    Raises
    ------
    NotImplementedError
        If an expression uses a function or a relation that is not printed.
    """
    writer = Writer(places=dict(loads), lanes=lanes)
    writer.values |= {symbol: writer.spread(f"%{name}") for name, symbol in interface.numbers}
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
    symbols = [(*called(name), 1) for name in FUNCTIONS]
    symbols += [(f"@llvm.{name}.v{n}f64", 1, n) for name in _OF_VECTORS for n in LANES]
    declared = [
        f"declare {real(lanes)} {symbol}({', '.join([real(lanes)] * count)})\n"
        for symbol, count, lanes in symbols
        if f" {symbol}(" in body
    ]
    reduced = [(f"@llvm.vector.reduce.or.v{n}i1", n) for n in LANES]
    return "".join(declared + [f"declare i1 {symbol}(<{n} x i1>)\n" for symbol, n in reduced if symbol in body])
