"""Kernels that are written by hand, in C99: a rule that runs sample by sample has one text for both.

What can be printed are functions of numbers and of arrays with numbered entries, without loops: assignments,
conditions, arithmetic, minimum and maximum, and calls of each other.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import getsource
from operator import attrgetter
from types import ModuleType
from typing import Any

#: Operators by their node.
_BINARY: Mapping[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARED: Mapping[type, str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


@dataclass(frozen=True, slots=True)
class _Function:
    """A kernel: its tree, its types by name of argument, and arguments that are arrays it changes."""

    tree: ast.FunctionDef
    types: Mapping[str, str]
    result: str
    changed: frozenset[str]


def kernel_c99(
    module: ModuleType, entries: Sequence[str], real: str, prefix: str, number: Callable[[float], str]
) -> str:
    """Some kernels of a module as static functions in C99, and those that they call, in the order of their text.

    Parameters
    ----------
    entries
        Their names; they have no loops.
    real
        Type of every number.
    prefix
        Before every name.
    number
        Printer of literals of that type.

    Raises
    ------
    ValueError
        If a kernel has what cannot be printed.
    """
    by_name = _functions(ast.parse(getsource(module)))
    wanted = set(entries)
    for name in reversed(by_name):
        if name in wanted:
            wanted |= {node.id for node in ast.walk(by_name[name].tree) if isinstance(node, ast.Name)}
    functions = {name: function for name, function in by_name.items() if name in wanted}
    printer = _Printer(module, functions, real, prefix, number)
    return "\n".join((printer.helpers(), *(printer.function(name) for name in functions)))


def _functions(tree: ast.Module) -> dict[str, _Function]:
    """The kernels without loops, by name."""
    by_name: dict[str, _Function] = {}
    for node in tree.body:
        loops = any(isinstance(part, (ast.For, ast.While)) for part in ast.walk(node))
        if not isinstance(node, ast.FunctionDef) or not node.decorator_list or loops:
            continue
        types = {argument.arg: _type(argument.annotation) for argument in node.args.args}
        by_name[node.name] = _Function(node, types, _type(node.returns), frozenset(_changed(node, by_name)))
    return by_name


def _type(annotation: ast.expr | None) -> str:
    name = ast.unparse(annotation) if annotation is not None else "None"
    return {"float": "real", "int": "int", "bool": "int", "FloatArray": "array", "None": "void"}[name]


def _changed(function: ast.FunctionDef, by_name: Mapping[str, _Function]) -> set[str]:
    """Arguments whose entries a function changes, itself or by the functions that it calls."""
    changed = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            changed.add(ast.unparse(node.value))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in by_name:
            called = by_name[node.func.id]
            pairs = zip(called.types, node.args, strict=True)
            changed |= {ast.unparse(argument) for name, argument in pairs if name in called.changed}
    return changed


@dataclass(frozen=True, slots=True)
class _Printer:
    module: ModuleType
    functions: Mapping[str, _Function]
    real: str
    prefix: str
    number: Callable[[float], str]

    @property
    def suffix(self) -> str:
        """Of the functions of C's library."""
        return "f" if self.real == "float" else ""

    def helpers(self) -> str:
        """Minimum and maximum."""
        return (
            "".join(
                f"static {self.real} {self.prefix}{name}({self.real} a, {self.real} b)\n{{\n"
                f"    return (b {sign} a) ? b : a;\n}}\n\n"
                for name, sign in (("min", "<"), ("max", ">"))
            ).rstrip("\n")
            + "\n"
        )

    def function(self, name: str) -> str:
        """A function with its comment."""
        function = self.functions[name]
        arguments = ", ".join(self._argument(function, argument) for argument in function.types)
        result = self.real if function.result == "real" else function.result
        words = (ast.get_docstring(function.tree) or "").splitlines()[0].replace("`", "")
        local = self._locals(function)
        lines = [
            f"    {self.real if kind == 'real' else kind} {word} = {self._zero(kind)};" for word, kind in local.items()
        ]
        lines += self._body(function, {**function.types, **local}, function.tree.body, 1)
        return f"/* {words} */\nstatic {result} {self.prefix}{name}({arguments})\n{{\n" + "\n".join(lines) + "\n}\n"

    def _argument(self, function: _Function, name: str) -> str:
        kind = function.types[name]
        if kind == "array":
            return f"{'' if name in function.changed else 'const '}{self.real} {name}[]"
        return f"{self.real if kind == 'real' else kind} {name}"

    def _zero(self, kind: str) -> str:
        return self.number(0.0) if kind == "real" else "0"

    def _locals(self, function: _Function) -> dict[str, str]:
        """Local variables with their types, in the order of their first assignment."""
        local: dict[str, str] = {}
        for node in ast.walk(function.tree):
            pairs: list[tuple[ast.expr, ast.expr]] = []
            if isinstance(node, ast.Assign):
                pairs = _pairs(node.targets[0], node.value)
            elif isinstance(node, ast.AnnAssign) and node.value is not None:
                pairs = [(node.target, node.value)]
            for target, value in pairs:
                if isinstance(target, ast.Name) and target.id not in function.types:
                    local.setdefault(target.id, self._kind(value, {**function.types, **local}))
        return local

    def _kind(self, node: ast.expr, types: Mapping[str, str]) -> str:
        """Type of an expression: int for conditions, verdicts and numbers of entries."""
        if isinstance(node, (ast.Name, ast.Attribute)):
            return types.get(ast.unparse(node)) or ("int" if isinstance(self._value(node), int) else "real")
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id == "bool":
                return "int"
            function = self.functions.get(node.func.id)
            return function.result if function else "real"
        return "int" if isinstance(node, (ast.Compare, ast.BoolOp)) else "real"

    def _body(self, function: _Function, types: Mapping[str, str], body: list[ast.stmt], depth: int) -> list[str]:
        lines: list[str] = []
        for node in body:
            lines += [f"{'    ' * depth}{line}" for line in self._statement(function, types, node)]
        return lines

    def _statement(self, function: _Function, types: Mapping[str, str], node: ast.stmt) -> list[str]:
        def of(part: ast.expr) -> str:
            return self._expression(part, types)

        match node:
            case ast.Expr(value=ast.Constant()):
                lines = []
            case ast.Expr():
                lines = [f"{of(node.value)};"]
            case ast.Return(value=ast.expr() as value):
                lines = [f"return {of(value)};"]
            case ast.Assign():
                lines = self._assigned(_pairs(node.targets[0], node.value), types)
            case ast.AnnAssign(value=ast.expr() as value):
                lines = self._assigned([(node.target, value)], types)
            case ast.AugAssign():
                lines = [f"{of(node.target)} {_BINARY[type(node.op)]}= {of(node.value)};"]
            case ast.If():
                lines = [f"if {self._condition(node.test, types)} {{", *self._body(function, types, node.body, 1)]
                lines += ["} else {", *self._body(function, types, node.orelse, 1)] if node.orelse else []
                lines.append("}")
            case _:
                raise ValueError(f"no C for {ast.unparse(node)!r} in {function.tree.name}")
        return lines

    def _assigned(self, pairs: list[tuple[ast.expr, ast.expr]], types: Mapping[str, str]) -> list[str]:
        """Assignments one after the other, where no value depends on a target before it."""
        lines: list[str] = []
        targets: list[str] = []
        for target, value in pairs:
            if any(word in ast.unparse(value) for word in targets):
                raise ValueError(f"{ast.unparse(value)!r} is assigned together with what it depends on")
            targets.append(ast.unparse(target))
            lines.append(f"{self._expression(target, types)} = {self._expression(value, types)};")
        return lines

    def _expression(self, node: ast.expr, types: Mapping[str, str]) -> str:
        def of(part: ast.expr) -> str:
            return self._expression(part, types)

        match node:
            case ast.Constant(value=int() as value):
                text = f"{value}"
            case ast.Constant(value=float() as number):
                text = self.number(number)
            case ast.Name() if node.id in types:
                text = node.id
            case ast.Name() | ast.Attribute():
                value = self._value(node)
                text = f"{value}" if isinstance(value, int) else self.number(value)
            case ast.Subscript():
                text = f"{of(node.value)}[{of(node.slice)}]"
            case ast.BinOp():
                text = f"({of(node.left)} {_BINARY[type(node.op)]} {of(node.right)})"
            case ast.UnaryOp():
                inverted = isinstance(node.op, ast.Not)
                text = f"(!{self._condition(node.operand, types)})" if inverted else f"(-{of(node.operand)})"
            case ast.BoolOp():
                sign = " && " if isinstance(node.op, ast.And) else " || "
                text = "(" + sign.join(self._condition(value, types) for value in node.values) + ")"
            case ast.IfExp():
                text = f"({self._condition(node.test, types)} ? {of(node.body)} : {of(node.orelse)})"
            case ast.Compare():
                text = self._compared(node, types)
            case ast.Call():
                text = self._called(node, types)
            case _:
                raise ValueError(f"no C for {ast.unparse(node)!r}")
        return text

    def _condition(self, node: ast.expr, types: Mapping[str, str]) -> str:
        """An expression that is true or false: numbers that are kept are compared with 0."""
        text = self._expression(node, types)
        is_number = isinstance(node, ast.Name) or (
            isinstance(node, ast.Call) and ast.unparse(node.func) in self.functions
        )
        if is_number:
            return f"({text} != 0)"
        return text if text.startswith("(") else f"({text})"

    def _value(self, node: ast.expr) -> Any:
        """Value of a name in the module, or of a name of a module that it imports."""
        return attrgetter(ast.unparse(node))(self.module)

    def _compared(self, node: ast.Compare, types: Mapping[str, str]) -> str:
        """Comparisons, one after the other; of equal numbers by their order, so that NaN equals nothing."""
        operands, parts = [node.left, *node.comparators], []
        for left, operator, right in zip(operands, node.ops, operands[1:], strict=False):
            if isinstance(operator, ast.In) and isinstance(right, ast.Tuple):
                same = [f"({self._expression(left, types)} == {self._expression(item, types)})" for item in right.elts]
                parts.append("(" + " || ".join(same) + ")")
                continue
            a, b = self._expression(left, types), self._expression(right, types)
            if type(operator) in _COMPARED:
                parts.append(f"({a} {_COMPARED[type(operator)]} {b})")
            elif self._kind(left, types) == "int":
                parts.append(f"({a} {'==' if isinstance(operator, ast.Eq) else '!='} {b})")
            else:
                equal = f"(({a} <= {b}) && ({a} >= {b}))"
                parts.append(equal if isinstance(operator, ast.Eq) else f"(!{equal})")
        return parts[0] if len(parts) == 1 else f"({' && '.join(parts)})"

    def _called(self, node: ast.Call, types: Mapping[str, str]) -> str:
        name, arguments = ast.unparse(node.func), [self._expression(part, types) for part in node.args]
        if name in ("float", "bool"):
            return arguments[0]
        if name == "math.isnan":
            return f"(isnan({arguments[0]}) != 0)"
        if name in ("abs", "math.sqrt"):
            return f"{'fabs' if name == 'abs' else 'sqrt'}{self.suffix}({arguments[0]})"
        if name in ("min", "max"):
            return f"{self.prefix}{name}({', '.join(arguments)})"
        if name in self.functions:
            return f"{self.prefix}{name}({', '.join(arguments)})"
        raise ValueError(f"no C for the function {name}")


def _pairs(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]
