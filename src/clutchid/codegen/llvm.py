"""LLVM's intermediate language of a program: what Numba would make of the printed equations, without its front end.

Numba spends nine tenths of the time of a compilation on typing and rewriting what is only arithmetic of doubles. So the
straight-line part of a kernel is printed as LLVM's own text, which is optimised and assembled in tenths of a second,
and only the loops around it are Python.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from clutchid.codegen.instructions import ArrayElement, Writer, called
from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.program import Statement
from clutchid.codegen.system import Expr


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
