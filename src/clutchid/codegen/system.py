"""A `System`: what codegen takes. States, inputs, parameters and expressions; it knows no clutch."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

#: A SymPy expression, a number, or (for plain arithmetic) an array.
Expr: TypeAlias = Any


def symbols_in(values: Iterable[Expr]) -> set[Expr]:
    """All symbols of expressions; plain numbers have none."""
    return {symbol for value in values for symbol in getattr(value, "free_symbols", ())}


@dataclass(frozen=True, slots=True)
class TabulatedFunction:
    r"""A function known only when the kernel runs: ``value = sum_i theta_i phi_i(argument)``.

    The phi_i are piecewise cubics, held as breakpoints and coefficients. In the equations `value` stands for the
    function; its derivative to `argument` and to every weight is exact.
    """

    value: Expr
    argument: Expr


@dataclass(frozen=True, slots=True)
class Jump:
    """New states at a sample, as expressions in the states before, the measured values and the parameters."""

    name: str
    states: tuple[Expr, ...]


@dataclass(frozen=True, slots=True)
class System:
    """Ordinary differential equations with held inputs, from which kernels, C and LaTeX are made.

    `definitions` are named intermediate expressions in the order in which they are computed; they may use states,
    inputs, parameters, the table's value and definitions before them. `derivatives` are the right-hand sides. Jumps
    may use states, parameters and measured values. Where derivatives to no other parameters than the `frequent` ones
    are asked for, a step computes no others.

    Raises
    ------
    ValueError
        If a derivative or a jump's state is missing, a name stands twice, or a symbol is used before it is defined.
    """

    name: str
    states: tuple[Expr, ...]
    inputs: tuple[Expr, ...]
    parameters: tuple[Expr, ...]
    definitions: tuple[tuple[Expr, Expr], ...]
    derivatives: tuple[Expr, ...]
    table: TabulatedFunction | None = None
    measured: tuple[Expr, ...] = ()
    jumps: tuple[Jump, ...] = ()
    frequent: tuple[Expr, ...] = ()

    def __post_init__(self) -> None:
        if len(self.states) != len(self.derivatives):
            raise ValueError(f"{self.name}: {len(self.states)} states but {len(self.derivatives)} derivatives.")
        names = [str(s) for s in self.symbols]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{self.name}: {', '.join(twice)} named twice.")
        symbols = {*self.states, *self.inputs, *self.parameters, *self.tabulated}
        for symbol, expression in (*self.definitions, *zip(self.states, self.derivatives, strict=True)):
            unknown = sorted(str(s) for s in symbols_in([expression]) - symbols)
            if unknown:
                raise ValueError(f"{self.name}: {symbol} uses {', '.join(unknown)} before it is defined.")
            symbols.add(symbol)
        self._check_jumps()

    def _check_jumps(self) -> None:
        symbols = {*self.states, *self.parameters, *self.measured}
        for jump in self.jumps:
            if len(jump.states) != len(self.states):
                raise ValueError(f"{self.name}, jump {jump.name}: {len(jump.states)} of {len(self.states)} states.")
            unknown = sorted(str(s) for s in symbols_in(jump.states) - symbols)
            if unknown:
                raise ValueError(
                    f"{self.name}, jump {jump.name} uses {', '.join(unknown)}; jumps know states, parameters, measured."
                )

    @property
    def tabulated(self) -> tuple[Expr, ...]:
        """The value of the table, if there is one."""
        return (self.table.value,) if self.table else ()

    @property
    def symbols(self) -> tuple[Expr, ...]:
        """All symbols: states, inputs, parameters and definitions."""
        defined = (symbol for symbol, _ in self.definitions)
        return (*self.states, *self.inputs, *self.parameters, *self.measured, *defined, *self.tabulated)

    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the kernels' parameter array."""
        return tuple(str(symbol) for symbol in self.parameters)
