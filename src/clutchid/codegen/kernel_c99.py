"""Kernels that are written by hand, in C99: a rule that runs sample by sample has one text for both.

What can be printed are functions of numbers, of records and of arrays: assignments, conditions, loops over a range or
while a condition holds, arithmetic, minimum and maximum, and calls of each other.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from inspect import getsource
from operator import attrgetter
from types import ModuleType
from typing import Any

from clutchid.codegen.records import fields_of, values_in

#: Operators by their node.
_BINARY: Mapping[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "/", ast.Mod: "%", ast.BitOr: "|",
    ast.BitAnd: "&",
}  # fmt: skip
_COMPARED: Mapping[type, str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


#: Largest number that is an int in C.
_LARGEST_INT = 0x7FFFFFFF

#: Kinds of values by their annotation; any other one is a record.
_KINDS: Mapping[str, str] = {
    "float": "real", "int": "int", "bool": "int", "Count": "count", "FloatArray": "array", "None": "void",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CNames:
    """Names and numbers in C: type of every number with its printer, prefix of functions, and of types."""

    real: str
    number: Callable[[float], str]
    functions: str
    types: str

    def type_of(self, kind: str) -> str:
        """Type in C of a kind of value, of a record by its name."""
        plain = {"real": self.real, "int": "int", "count": "uint32_t", "void": "void"}
        return plain.get(kind) or f"{self.types}_{re.sub('(?<!^)(?=[A-Z])', '_', kind).lower()}_t"


@dataclass(frozen=True, slots=True)
class _Function:
    """A kernel: its module, its tree, its kinds by name of argument, and arguments that it changes."""

    module: ModuleType
    tree: ast.FunctionDef
    types: Mapping[str, str]
    result: str
    changed: frozenset[str]


def kernel_c99(modules: Sequence[ModuleType], entries: Sequence[str], names: CNames) -> str:
    """Some kernels of modules as static functions in C99, and those that they call, in the order of their text.

    Parameters
    ----------
    modules
        In the order in which they call each other.
    entries
        Names of kernels.

    Raises
    ------
    ValueError
        If a kernel has what cannot be printed.
    """
    by_name: dict[str, _Function] = {}
    for module in modules:
        _add_functions(module, by_name)
    wanted = set(entries)
    for name in reversed(by_name):
        if name in wanted:
            wanted |= {node.id for node in ast.walk(by_name[name].tree) if isinstance(node, ast.Name)}
    functions = {name: function for name, function in by_name.items() if name in wanted}
    printers = {module: _Printer(module, functions, names) for module in modules}
    texts = [printers[function.module].function(name) for name, function in functions.items()]
    return "\n".join((*_helpers(names, "".join(texts)), *texts))


def record_c99(record: type, names: CNames) -> str:
    """A record as a structure in C99."""
    lines = [
        f"    {names.type_of(field.kind)} {field.name}{f'[{field.size}]' if field.size else ''};"
        for field in fields_of(record)
    ]
    words = (record.__doc__ or "").splitlines()[0].replace("`", "")
    return "\n".join((f"/* {words} */", "typedef struct {", *lines, f"}} {names.type_of(record.__name__)};\n"))


def values_c99(record: object, names: CNames) -> str:
    """The initialiser of a structure in C99 with the values of a record."""

    def printed(value: Any) -> str:
        if isinstance(value, list):
            return f"{{{', '.join(map(printed, value))}}}"
        if isinstance(value, float):
            return names.number(value)
        return f"{value}u" if value > _LARGEST_INT else f"{value}"

    pairs = (f".{name} = {printed(value)}" for name, value in values_in(record).items())
    return f"{{{', '.join(pairs)}}}"


def _helpers(names: CNames, text: str) -> Iterator[str]:
    """Minimum and maximum, where a text calls them."""
    for name, sign in (("min", "<"), ("max", ">")):
        if f"{names.functions}{name}(" in text:
            head = f"static {names.real} {names.functions}{name}({names.real} a, {names.real} b)"
            yield f"{head}\n{{\n    return (b {sign} a) ? b : a;\n}}\n"


def _add_functions(module: ModuleType, by_name: dict[str, _Function]) -> None:
    """Add the kernels of a module that can be printed: they take no arrays of records or of other numbers."""
    for node in ast.parse(getsource(module)).body:
        if not isinstance(node, ast.FunctionDef) or not node.decorator_list:
            continue
        kinds = {argument.arg: _kind_of(argument.annotation) for argument in node.args.args}
        if not any(kind == "" for kind in kinds.values()):
            changed = frozenset(_changed(node, by_name))
            by_name[node.name] = _Function(module, node, kinds, _kind_of(node.returns), changed)


def _kind_of(annotation: ast.expr | None) -> str:
    """Kind of an annotation; nothing for what C does not have."""
    name = ast.unparse(annotation) if annotation is not None else "None"
    return _KINDS.get(name, name if name.isidentifier() and name != "Records" else "")


def _root(node: ast.expr) -> str:
    """Name of the record or array that an attribute or an entry belongs to."""
    while isinstance(node, (ast.Attribute, ast.Subscript)):
        node = node.value
    return ast.unparse(node)


def _changed(function: ast.FunctionDef, by_name: Mapping[str, _Function]) -> set[str]:
    """Arguments that a function changes, itself or by the functions that it calls."""
    changed = set()
    for node in ast.walk(function):
        if isinstance(node, (ast.Subscript, ast.Attribute)) and isinstance(node.ctx, ast.Store):
            changed.add(_root(node))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in by_name:
            called = by_name[node.func.id]
            pairs = zip(called.types, node.args, strict=True)
            changed |= {_root(argument) for name, argument in pairs if name in called.changed}
    return changed


@dataclass(frozen=True, slots=True)
class _Printer:
    module: ModuleType
    functions: Mapping[str, _Function]
    names: CNames

    @property
    def suffix(self) -> str:
        """Of the functions of C's library."""
        return "f" if self.names.real == "float" else ""

    def function(self, name: str) -> str:
        """A function with its comment."""
        function = self.functions[name]
        arguments = ", ".join(self._argument(function, argument) for argument in function.types)
        words = (ast.get_docstring(function.tree) or "").splitlines()[0].replace("`", "")
        local = self._locals(function)
        lines = [f"    {self.names.type_of(kind)} {word} = {self._zero(kind)};" for word, kind in local.items()]
        lines += self._body(function, {**function.types, **local}, function.tree.body, 1)
        head = f"static {self.names.type_of(function.result)} {self.names.functions}{name}({arguments})"
        return f"/* {words} */\n{head}\n{{\n" + "\n".join(lines) + "\n}\n"

    def _argument(self, function: _Function, name: str) -> str:
        kind = function.types[name]
        const = "" if name in function.changed else "const "
        if kind == "array":
            return f"{const}{self.names.real} {name}[]"
        plain = kind in ("real", "int", "count")
        return f"{self.names.type_of(kind)} {name}" if plain else f"{const}{self.names.type_of(kind)} *{name}"

    def _zero(self, kind: str) -> str:
        return {"real": self.names.number(0.0), "count": "0u"}.get(kind, "0")

    def _locals(self, function: _Function) -> dict[str, str]:
        """Local variables with their types, in the order of their first assignment."""
        local: dict[str, str] = {}
        loops = {node.target.id for node in ast.walk(function.tree)
                 if isinstance(node, ast.For) and isinstance(node.target, ast.Name)}  # fmt: skip
        types = {**function.types, **dict.fromkeys(loops, "int")}
        for node in ast.walk(function.tree):
            pairs: list[tuple[ast.expr, ast.expr]] = []
            if isinstance(node, ast.Assign):
                pairs = _pairs(node.targets[0], node.value)
            elif isinstance(node, ast.AnnAssign) and node.value is not None:
                pairs = [(node.target, node.value)]
            for target, value in pairs:
                if isinstance(target, ast.Name) and target.id not in types:
                    local.setdefault(target.id, self._kind(value, {**types, **local}))
        return local

    def _kind(self, node: ast.expr, types: Mapping[str, str]) -> str:
        """Kind of an expression: int for conditions, verdicts and numbers of entries."""

        def of(*parts: ast.expr) -> str:
            kinds = {self._kind(part, types) for part in parts}
            return next((kind for kind in ("real", "count") if kind in kinds), "int")

        kind = "real"
        match node:
            case ast.Name():
                kind = types.get(node.id) or ("int" if isinstance(self._value(node), int) else "real")
            case ast.Constant():
                kind = "int" if isinstance(node.value, int) else "real"
            case ast.Attribute(value=ast.Name(id=name)) if name not in types:
                kind = "int" if isinstance(self._value(node), int) else "real"
            case ast.Attribute(value=ast.Name(id=name)):
                record = getattr(self.module, types[name])
                kind = next(field.kind for field in fields_of(record) if field.name == node.attr)
            case ast.Call(func=ast.Name(id="bool")) | ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not()):
                kind = "int"
            case ast.Call(func=ast.Attribute(attr="isnan" | "isfinite")):
                kind = "int"
            case ast.Call(func=ast.Name(id=name)) if name in self.functions:
                kind = self.functions[name].result
            case ast.BinOp() if not isinstance(node.op, ast.Div):
                kind = of(node.left, node.right)
            case ast.UnaryOp():
                kind = of(node.operand)
            case ast.IfExp():
                kind = of(node.body, node.orelse)
        return kind

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
            case ast.Return(value=None):
                lines = ["return;"]
            case ast.Return(value=ast.expr() as value):
                lines = [f"return {self._as(value, function.result, types)};"]
            case ast.Assign():
                lines = self._assigned(_pairs(node.targets[0], node.value), types)
            case ast.AnnAssign(value=ast.expr() as value):
                lines = self._assigned([(node.target, value)], types)
            case ast.AugAssign():
                by = self._as(node.value, self._kind(node.target, types), types)
                lines = [f"{of(node.target)} {_BINARY[type(node.op)]}= {by};"]
            case ast.For(target=ast.Name(id=name), iter=ast.Call(args=limits)):
                begin, end = map(of, limits) if len(limits) == 2 else ("0", of(limits[0]))
                within = {**types, name: "int"}
                lines = [f"for (int {name} = {begin}; {name} < {end}; {name}++) {{"]
                lines += [*self._body(function, within, node.body, 1), "}"]
            case ast.While():
                lines = [
                    f"while {self._condition(node.test, types)} {{",
                    *self._body(function, types, node.body, 1),
                    "}",
                ]
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
            if any(isinstance(part, ast.expr) and ast.unparse(part) in targets for part in ast.walk(value)):
                raise ValueError(f"{ast.unparse(value)!r} is assigned together with what it depends on")
            targets.append(ast.unparse(target))
            new = self._as(value, self._kind(target, types), types)
            lines.append(f"{self._expression(target, types)} = {new};")
        return lines

    def _as(self, node: ast.expr, kind: str, types: Mapping[str, str]) -> str:
        """An expression as a kind of value: numbers of entries that are counts have a suffix."""
        text = self._expression(node, types)
        return f"{text}u" if kind == "count" and text.isdigit() else text

    def _expression(self, node: ast.expr, types: Mapping[str, str]) -> str:
        def of(part: ast.expr) -> str:
            return self._expression(part, types)

        match node:
            case ast.Constant(value=int() | float() as value):
                text = f"{int(value)}" if isinstance(value, int) else self.names.number(value)
            case ast.Name() if node.id in types:
                text = node.id
            case ast.Attribute() if _root(node) in types:
                text = f"{of(node.value)}->{node.attr}"
            case ast.Name() | ast.Attribute():
                value = self._value(node)
                text = f"{value}" if isinstance(value, int) else self.names.number(value)
            case ast.Subscript():
                text = f"{of(node.value)}[{of(node.slice)}]"
            case ast.BinOp():
                kind = self._kind(node, types)
                text = (
                    f"({self._as(node.left, kind, types)} {_BINARY[type(node.op)]} {self._as(node.right, kind, types)})"
                )
            case ast.UnaryOp():
                inverted = isinstance(node.op, ast.Not)
                text = f"(!{self._condition(node.operand, types)})" if inverted else f"(-{of(node.operand)})"
            case ast.BoolOp():
                sign = " && " if isinstance(node.op, ast.And) else " || "
                text = "(" + sign.join(self._condition(value, types) for value in node.values) + ")"
            case ast.IfExp():
                kind = self._kind(node, types)
                arms = self._as(node.body, kind, types), self._as(node.orelse, kind, types)
                text = f"({self._condition(node.test, types)} ? {arms[0]} : {arms[1]})"
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
        is_number = isinstance(node, (ast.Name, ast.Attribute)) or (
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
            kinds = {self._kind(left, types), self._kind(right, types)}
            a, b = (self._as(part, "count" if "count" in kinds else "", types) for part in (left, right))
            if type(operator) in _COMPARED:
                parts.append(f"({a} {_COMPARED[type(operator)]} {b})")
            elif "real" not in kinds:
                parts.append(f"({a} {'==' if isinstance(operator, ast.Eq) else '!='} {b})")
            else:
                equal = f"(({a} <= {b}) && ({a} >= {b}))"
                parts.append(equal if isinstance(operator, ast.Eq) else f"(!{equal})")
        return parts[0] if len(parts) == 1 else f"({' && '.join(parts)})"

    def _called(self, node: ast.Call, types: Mapping[str, str]) -> str:
        name, arguments = ast.unparse(node.func), [self._expression(part, types) for part in node.args]
        if name == "bool":
            return arguments[0]
        if name == "float":
            return f"(({self.names.real}){arguments[0]})"
        if name in ("math.isnan", "math.isfinite"):
            return f"({name[5:]}({arguments[0]}) != 0)"
        if name in ("abs", "math.sqrt"):
            return f"{'fabs' if name == 'abs' else 'sqrt'}{self.suffix}({arguments[0]})"
        if name in ("min", "max"):
            return f"{self.names.functions}{name}({', '.join(arguments)})"
        if name in self.functions:
            kinds = self.functions[name].types.values()
            arguments = [self._as(part, kind, types) for part, kind in zip(node.args, kinds, strict=True)]
            return f"{self.names.functions}{name}({', '.join(arguments)})"
        raise ValueError(f"no C for the function {name}")


def _pairs(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return list(zip(target.elts, value.elts, strict=True))
    return [(target, value)]
