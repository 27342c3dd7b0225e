"""A bound of the instructions of exported C, by its text: loops as often as they can run, of branches the dearer arm.

The text is run without data: what follows from constants, counters and arguments is computed, all else is unknown. Each
operation has a cost in instructions of a Cortex-M4F, `COSTS`, that compilers seldom exceed, as they keep values in
registers; `python benchmarks/export.py --costs` compares the bound with what an emulator counts.
"""

from __future__ import annotations

import operator
import re
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pycparser import CParser, c_ast

#: Instructions of an operation, a comparison with its branch, a value that is read or written, an index that is not a
#: constant, a turn of a loop with its counter, and a call with what it saves. Division and square root are one each.
COSTS = {"operation": 1, "comparison": 3, "read": 1, "index": 1, "write": 1, "turn": 3, "call": 14}

#: Instructions of functions of the library: guesses of what newlib needs at most, not measured.
LIBRARY = {
    "sqrtf": 1, "fabsf": 1, "isfinite": 5, "isnan": 3, "fmaxf": 12, "ceilf": 30, "copysignf": 6, "expf": 140,
    "powf": 420, "memset": 2.0, "memcpy": 2.0,
}  # fmt: skip

_HEADERS = {
    "math.h": "#define NAN 0.0f\n#define HUGE_VALF 0.0f\n#define HUGE_VAL 0.0",
    "stdint.h": "typedef int uint8_t, uint32_t, uint64_t, size_t;\n#define UINT32_MAX 4294967295",
    "stddef.h": "#define NULL 0",
    "string.h": "",
}
_ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.floordiv, "%": operator.mod,
}  # fmt: skip
_COMPARED: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip


class Value(NamedTuple):
    """What an expression costs, and what it is: a whole number, a list, or None where that is unknown."""

    cost: float
    known: Any = None


@dataclass
class Program:
    """Functions and constants of some C; `known` are values of fields by their text, `fixed` costs of calls by name.

    A loop that no counter ends runs as often as `turns` says, by its function.
    """

    functions: dict[str, c_ast.FuncDef]
    constants: dict[str, Any]
    known: Mapping[str, int]
    results: Mapping[str, int]
    fixed: Mapping[str, float]
    turns: Mapping[str, int]
    costs: dict[Any, Value] = field(default_factory=dict)

    def with_values(self, **changes: Any) -> Program:
        """The same functions with other values; costs of calls are computed anew."""
        values = {"known": self.known, "results": self.results, "fixed": self.fixed, "turns": self.turns}
        return Program(self.functions, self.constants, **{n: {**v, **changes.get(n, {})} for n, v in values.items()})

    def call(self, name: str, arguments: tuple[Any, ...] = ()) -> Value:
        """What a call costs at most, and its result."""
        if name in self.fixed:
            return Value(COSTS["call"] + self.fixed[name], self.results.get(name))
        if name in LIBRARY:
            return Value(LIBRARY[name] + (COSTS["call"] if LIBRARY[name] > 10 else 0))
        hashable = tuple(tuple(a) if isinstance(a, list) else a for a in arguments)
        if (name, hashable) not in self.costs:
            definition = self.functions[name]
            parameters = definition.decl.type.args.params if definition.decl.type.args else []
            names = [p.name for p in parameters if p.name]
            run = _Run(self, name, dict(zip(names, arguments, strict=False)))
            cost = COSTS["call"] + run.statement(definition.body)
            self.costs[name, hashable] = Value(cost, self.results.get(name, run.result))
        return self.costs[name, hashable]


def program(sources: Mapping[str, str], values: Mapping[str, int], copied: Mapping[str, str]) -> Program:
    """The functions of some files in C by their names; `copied` are structs that are assigned as a whole, by type."""
    functions: dict[str, c_ast.FuncDef] = {}
    constants: dict[str, Any] = {}
    types: dict[str, c_ast.Node] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, text in {**_HEADERS, **sources}.items():
            (folder / name).write_text(text, encoding="utf-8")
        for name in sources:
            if not name.endswith(".c"):
                continue
            command = [
                "gcc",
                "-E",
                "-P",
                "-nostdinc",
                "-I",
                place,
                "-D__asm__(...)=",
                "-D__volatile__=",
                str(folder / name),
            ]
            text = subprocess.run(command, stdout=subprocess.PIPE, encoding="utf-8", check=True).stdout
            text = re.sub(r"\b(restrict|inline|volatile)\b|__asm__ *volatile *\([^;]*\)", "", text)
            for part in CParser().parse(text, name).ext:
                if isinstance(part, c_ast.FuncDef):
                    functions[part.decl.name] = part
                if isinstance(part, c_ast.Typedef):
                    types[part.name] = part.type
                for enum in _enumerations(part):
                    _enumerate(enum, constants)
    copies = {f"copy {to}": 3.0 * _words(types[kind], types, constants) for to, kind in copied.items()}
    return Program(functions, constants, values, {}, copies, {})


def _words(kind: c_ast.Node, types: Mapping[str, c_ast.Node], constants: dict[str, Any]) -> int:
    """The size of a type in words."""
    match kind:
        case c_ast.ArrayDecl():
            run = _Run(Program({}, constants, {}, {}, {}, {}), "size", {})
            return int(run.value(kind.dim).known) * _words(kind.type, types, constants)
        case c_ast.TypeDecl() if isinstance(kind.type, c_ast.Struct):
            return sum(_words(part.type, types, constants) for part in kind.type.decls)
        case c_ast.TypeDecl() if isinstance(kind.type, c_ast.IdentifierType) and kind.type.names[0] in types:
            return _words(types[kind.type.names[0]], types, constants)
        case _:
            return 1


def _enumerations(part: c_ast.Node) -> list[c_ast.Enum]:
    inner = getattr(part, "type", None)
    return [inner] if isinstance(inner, c_ast.Enum) else []


def _enumerate(enum: c_ast.Enum, constants: dict[str, Any]) -> None:
    following = 0
    run = _Run(Program({}, constants, {}, {}, {}, {}), "enum", {})
    for entry in enum.values.enumerators if enum.values else ():
        following = run.value(entry.value).known if entry.value is not None else following
        constants[entry.name] = following
        following = following + 1 if following is not None else 0


class _Run:
    """A function while it runs: what is known of its variables, and of its result."""

    def __init__(self, of: Program, name: str, variables: dict[str, Any]) -> None:
        self.of, self.name, self.variables, self.result = of, name, variables, None
        self.arrays: set[str] = set()

    def statement(self, node: c_ast.Node | None) -> float:  # noqa: PLR0911
        """What a statement costs at most."""
        match node:
            case None | c_ast.EmptyStatement() | c_ast.Break() | c_ast.Pragma():
                return 0.0
            case c_ast.Compound():
                return sum(self.statement(part) for part in node.block_items or ())
            case c_ast.Decl():
                return self.declared(node)
            case c_ast.DeclList():
                return sum(self.statement(part) for part in node.decls)
            case c_ast.If():
                test = self.value(node.cond)
                if test.known is not None:
                    return test.cost + self.statement(node.iftrue if test.known else node.iffalse)
                return test.cost + self.either([node.iftrue, node.iffalse])
            case c_ast.Switch():
                test = self.value(node.cond)
                arms = [case for case in node.stmt.block_items if isinstance(case, c_ast.Case)]
                chosen = [a for a in arms if test.known is None or self.value(a.expr).known == test.known]
                return test.cost + 6 + self.either([c_ast.Compound(arm.stmts) for arm in chosen])
            case c_ast.For() | c_ast.While() | c_ast.DoWhile():
                return self.loop(node)
            case c_ast.Return():
                of_result = self.value(node.expr) if node.expr is not None else Value(0.0)
                self.result = of_result.known
                return of_result.cost
            case _:
                return self.value(node).cost

    def either(self, arms: list[c_ast.Node | None]) -> float:
        """The dearer of arms of which nobody knows which one runs; what they change is unknown unless all agree."""
        before, costs, after = dict(self.variables), [0.0], []
        for arm in arms:
            self.variables = dict(before)
            costs.append(self.statement(arm))
            after.append(self.variables)
        names = {name for variables in after for name in variables}
        alike = [n for n in names if all(v.get(n) == after[0].get(n) for v in after)]
        self.variables = {name: after[0].get(name) for name in alike} | {n: None for n in names if n not in alike}
        return max(costs)

    def loop(self, node: c_ast.Node) -> float:
        """A loop, turn by turn, until its counter ends it."""
        cost = 0.0
        if isinstance(node, c_ast.For):
            cost += self.statement(node.init)
        most = self.of.turns.get(self.name)
        for turn in range(100_000):
            if not (isinstance(node, c_ast.DoWhile) and turn == 0):
                test = self.value(node.cond)
                cost += test.cost if test.known is None else 0.0
                if test.known is not None and not test.known:
                    return cost
                if test.known is None and not self.counts(node.cond) and turn >= (most if most is not None else -1):
                    if most is None:
                        raise ValueError(f"{self.name}: nothing bounds the loop at {node.coord}")
                    return cost
            cost += COSTS["turn"] + self.statement(node.stmt)
            if isinstance(node, c_ast.For) and node.next is not None:
                self.value(node.next)
        raise ValueError(f"{self.name}: the loop at {node.coord} does not end")

    def counts(self, node: c_ast.Node) -> bool:
        """Whether a part of a condition is known, so that it will end the loop."""
        if isinstance(node, c_ast.BinaryOp) and node.op == "&&":
            return self.counts(node.left) or self.counts(node.right)
        return self.value(node).known is not None

    def declared(self, node: c_ast.Decl) -> float:
        made = self.value(node.init) if node.init is not None else Value(0.0)
        constant = "static" in node.storage
        if node.name:
            self.variables[node.name] = made.known
            if isinstance(node.type, c_ast.ArrayDecl):
                self.arrays.add(node.name)
        return 0.0 if constant else made.cost

    def value(self, node: c_ast.Node) -> Value:  # noqa: PLR0911, PLR0912
        """An expression."""
        match node:
            case c_ast.Constant():
                whole = re.fullmatch(r"(0x[0-9a-fA-F]+|\d+)[uU]?[lL]*", node.value)
                return Value(0.0, int(whole[1], 0)) if whole else Value(COSTS["read"])
            case c_ast.ID():
                number = self.variables.get(node.name, self.of.constants.get(node.name))
                return Value(0.0, number)
            case c_ast.InitList():
                parts = [self.value(part) for part in node.exprs]
                return Value(sum(p.cost + COSTS["write"] for p in parts), [p.known for p in parts])
            case c_ast.ArrayRef():
                base, at = self.value(node.name), self.value(node.subscript)
                listed = isinstance(base.known, (list, tuple)) and isinstance(at.known, int)
                number = base.known[at.known] if listed else self.of.known.get(_text(node))
                index = 0 if isinstance(node.subscript, c_ast.Constant) else at.cost + COSTS["index"]
                return Value(max(base.cost, 0 if self.is_local(node) else COSTS["read"]) + index, number)
            case c_ast.StructRef():
                return Value(max(self.value(node.name).cost, COSTS["read"]), self.of.known.get(_text(node)))
            case c_ast.Cast():
                inner = self.value(node.expr)
                return Value(inner.cost + COSTS["operation"], inner.known)
            case c_ast.UnaryOp():
                return self.unary(node)
            case c_ast.BinaryOp():
                return self.binary(node)
            case c_ast.TernaryOp():
                test = self.value(node.cond)
                arms = [self.value(node.iftrue), self.value(node.iffalse)]
                if test.known is not None:
                    chosen = arms[0] if test.known else arms[1]
                    return Value(test.cost + chosen.cost + 1, chosen.known)
                number = arms[0].known if arms[0].known == arms[1].known else None
                return Value(test.cost + max(arm.cost for arm in arms) + 2, number)
            case c_ast.Assignment():
                return self.assigned(node)
            case c_ast.FuncCall():
                return self.called(node)
            case _:
                return Value(COSTS["read"])

    def unary(self, node: c_ast.UnaryOp) -> Value:
        if node.op == "sizeof":
            return Value(0.0)
        inner = self.value(node.expr)
        if node.op in ("p++", "++", "p--", "--"):
            step = 1 if "+" in node.op else -1
            self.write(node.expr, inner.known + step if isinstance(inner.known, int) else None)
            return Value(inner.cost + 2, inner.known)
        changes: dict[str, Callable[[Any], Any]] = {"-": operator.neg, "!": operator.not_}
        number = changes[node.op](inner.known) if node.op in changes and isinstance(inner.known, int) else None
        return Value(inner.cost + COSTS["operation"], number)

    def binary(self, node: c_ast.BinaryOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        both = isinstance(left.known, int) and isinstance(right.known, int)
        cost = left.cost + right.cost
        if node.op in ("&&", "||"):
            ends = 0 if node.op == "&&" else 1
            sides = [bool(side.known) for side in (left, right) if side.known is not None]
            number = ends if bool(ends) in sides else (1 - ends if len(sides) == 2 else None)
            return Value(cost + 1, number)
        if node.op in _COMPARED:
            return Value(cost + COSTS["comparison"], int(_COMPARED[node.op](left.known, right.known)) if both else None)
        if node.op in "+-" and any(
            isinstance(part, c_ast.BinaryOp) and part.op == "*" for part in (node.left, node.right)
        ):
            cost -= COSTS["operation"]  # a product is added in one instruction
        computed = both and node.op in _ARITHMETIC and not (node.op in "/%" and right.known == 0)
        return Value(cost + COSTS["operation"], _ARITHMETIC[node.op](left.known, right.known) if computed else None)

    def assigned(self, node: c_ast.Assignment) -> Value:
        made, to = self.value(node.rvalue), self.value(node.lvalue)
        number = made.known
        if node.op == "=":
            to = Value(max(0.0, to.cost - COSTS["read"]))
        else:
            both = isinstance(made.known, int) and isinstance(to.known, int) and node.op[0] in _ARITHMETIC
            number = _ARITHMETIC[node.op[0]](to.known, made.known) if both else None
        self.write(node.lvalue, number)
        copied = self.of.fixed.get(f"copy {_text(node.lvalue)}", 0.0)
        local = isinstance(node.lvalue, c_ast.ID) or self.is_local(node.lvalue)
        fused = isinstance(node.rvalue, c_ast.BinaryOp) and node.rvalue.op == "*"
        operation = COSTS["operation"] * (node.op != "=" and not fused)
        return Value(made.cost + to.cost + COSTS["write"] * (not local) + operation + copied, number)

    def is_local(self, node: c_ast.Node) -> bool:
        """Whether it is an entry of an array of the function with a constant index: it may lie in a register."""
        by_name = isinstance(node, c_ast.ArrayRef) and isinstance(node.name, c_ast.ID) and node.name.name in self.arrays
        return by_name and isinstance(node.subscript, c_ast.Constant)

    def write(self, node: c_ast.Node, number: Any) -> None:
        if isinstance(node, c_ast.ID):
            self.variables[node.name] = number

    def called(self, node: c_ast.FuncCall) -> Value:
        name = _text(node.name)
        parts = [self.value(part) for part in (node.args.exprs if node.args else ())]
        made = self.of.call(name, tuple(part.known for part in parts))
        return Value(sum(part.cost for part in parts) + made.cost, made.known)


def _text(node: c_ast.Node) -> str:
    """An expression without its indices' values, as it is written."""
    match node:
        case c_ast.ID():
            return str(node.name)
        case c_ast.StructRef():
            return f"{_text(node.name)}{node.type}{node.field.name}"
        case c_ast.ArrayRef():
            index = node.subscript.value if isinstance(node.subscript, c_ast.Constant) else ""
            return f"{_text(node.name)}[{index}]"
        case c_ast.UnaryOp():
            return f"{node.op}{_text(node.expr)}"
        case _:
            return ""
