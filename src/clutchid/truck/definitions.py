"""Named expressions of a plant in the order of their definition."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


class Definitions:
    """Named expressions in order of definition; ``definitions.p_A = value`` adds one."""

    def __init__(self, known: dict[str, Expr]) -> None:
        self.__dict__.update(known)
        self.__dict__["rows"] = []

    def __setattr__(self, name: str, value: Expr) -> None:
        symbol = sp.Symbol(name, real=True)
        self.rows.append((symbol, value))
        self.__dict__[name] = symbol

    def __getattr__(self, name: str) -> Expr:
        raise AttributeError(f"{name} is used before it is defined.")
