"""LaTeX of a system in the letters of the paper."""

from __future__ import annotations

import re

import sympy as sp
from sympy.printing.latex import LatexPrinter

from clutchid.codegen.system import Expr, System

_LETTERS = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi omega
    Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega
"""
_GREEK = frozenset(_LETTERS.split())


def latex_source(system: System) -> str:
    r"""Definitions and derivatives of `system` as one ``aligned`` block, for a math environment of amsmath.

    Piecewise expressions become ``cases``; those inside another expression are written before it as auxiliaries, the
    first one of w_v as ``w_v^{(1)}``. The table's function is given as the sum of its weighted basis functions.
    """
    lines: list[tuple[str, str]] = []
    for symbol, value in system.definitions:
        lines += right_hand_lines(letters(str(symbol)), value)
    if system.table is not None:
        argument = expression_latex(system.table.argument)
        lines.append((letters(str(system.table.value)), rf"\sum_i \theta_i \, \phi_i({argument})"))
    for state, value in zip(system.states, system.derivatives, strict=True):
        lines += right_hand_lines(letters(f"{state}_dot"), value)
    text = " \\\\\n".join(f"{left} &= {right}" for left, right in lines if left != right)
    return f"\\begin{{aligned}}\n{text}\n\\end{{aligned}}\n"


def expression_latex(value: Expr) -> str:
    r"""One expression in the letters of the paper.

    Examples
    --------
    >>> from sympy import symbols
    >>> D_zdot, z_dot = symbols("D_zdot z_dot")
    >>> expression_latex(D_zdot * z_dot)
    'D_{\\dot{z}} \\dot{z}'
    """
    text: str = _Printer().doprint(sp.sympify(value))
    return text


def letters(name: str) -> str:
    r"""A symbol's name as the paper writes it.

    Examples
    --------
    >>> [letters(name) for name in ("p_A", "V_0A", "theta", "z_dot", "p_A_dot", "D_zdot", "y_max", "p_A_measured")]
    ['p_A', 'V_{0A}', '\\theta', '\\dot{z}', '\\dot{p}_A', 'D_{\\dot{z}}', 'y_{max}', 'p_{A,measured}']
    """
    base, *below = [part for part in name.split("_") if part] or [name]
    dotted = bool(below) and below[-1] == "dot"
    numbered = re.fullmatch(r"([A-Za-z]+?)(\d+)", base)
    if numbered:
        base, below = numbered[1], [numbered[2], *below]
    index = ",".join(_subscript(part) for part in (below[:-1] if dotted else below))
    base = rf"\dot{{{_base(base)}}}" if dotted else _base(base)
    return base + (f"_{{{index}}}" if len(index) > 1 else f"_{index}" if index else "")


def _base(text: str) -> str:
    if text in _GREEK:
        return f"\\{text}"
    return text if len(text) == 1 else rf"\mathrm{{{text}}}"


def _subscript(text: str) -> str:
    if text in _GREEK:
        return f"\\{text}"
    return rf"\dot{{{text[:-3]}}}" if text.endswith("dot") and len(text) > 3 else text


def right_hand_lines(left: str, value: Expr) -> list[tuple[str, str]]:
    """The equation ``left = value`` as pairs (left, right) in LaTeX, after those of its inner piecewise parts."""
    auxiliaries: dict[Expr, Expr] = {}
    lines: list[tuple[str, str]] = []

    def inner(node: Expr) -> Expr:
        if not node.has(sp.Piecewise):
            return node
        short = node.func(*(inner(argument) for argument in node.args))
        if not isinstance(node, sp.Piecewise):
            return short
        if node not in auxiliaries:
            name = f"{left}^{{({len(auxiliaries) + 1})}}"
            auxiliaries[node] = sp.Dummy(name, real=True)
            lines.append((name, expression_latex(short)))
        return auxiliaries[node]

    value = sp.sympify(value)
    whole = value.func(*(inner(argument) for argument in value.args)) if value.args else value
    return [*lines, (left, expression_latex(whole))]


class _Printer(LatexPrinter):  # type: ignore[misc]
    """SymPy's printer with the paper's symbols, positive terms first, and plain cases."""

    def _print_Symbol(self, expr: Expr, style: str = "plain") -> str:  # noqa: ARG002
        return letters(str(expr))

    def _print_Dummy(self, expr: Expr) -> str:
        return str(expr.name)

    def _as_ordered_terms(self, expr: Expr, order: str | None = None) -> list[Expr]:
        return sorted(super()._as_ordered_terms(expr, order), key=lambda term: bool(term.could_extract_minus_sign()))

    def _print_Piecewise(self, expr: Expr) -> str:
        arms = [f"{self._print(value)}, & {self._condition(condition)}" for value, condition in expr.args]
        return r"\begin{cases} " + r" \\ ".join(arms) + r" \end{cases}"

    def _condition(self, condition: Expr) -> str:
        return r"\text{otherwise}" if condition is sp.true else str(self._print(condition))
