"""Write docs/equations.md from the equations and the rows of the Appendix: ``python docs/make_equations.py``."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import fields
from importlib import import_module
from inspect import getdoc, isfunction, signature
from pathlib import Path
from typing import Any
from unittest.mock import patch

import sympy as sp

from clutchid.codegen.latex import expression_latex, latex_source, letters, right_hand_lines
from clutchid.model.compiled import system
from clutchid.model.opening import port_opening, spool_rate
from clutchid.parameters import Parameters, Row

PAGE = Path(__file__).parent / "equations.md"

HEAD = """# The model

Made from the code by `python docs/make_equations.py`; do not edit. The derivations, and every deviation from the print,
are in the docstrings of `clutchid.model` and in [deviations.md](deviations.md). Purposes of the variants:
[models.md](models.md). A whole model, with the parameters of each valve and chamber as it is compiled, is printed by
`latex_source(system("isothermal"))` of `clutchid.codegen.latex` and `clutchid.model.compiled`.

## Equation by equation

The numbers are those of the paper, which has no (22). Each formula is printed from the function that it names, with the
function's own arguments: units, ranges, sources and an example are in its docstring.

"""

STRIBECK = """## What `-stribeck` changes

F_g takes the place of F_C in the rate of the deflection. Conditions inside an expression stand before it: the first of
w_v is w_v^(1).

"""

BALANCE = """## What `energy-balance` changes

p_A, p_B, T_A, T_B and p_S have the rates below; the flows know the temperature of the air before the orifice and the
pressure in the reservoir. What is not listed is as in the paper's model.

"""

PROPORTIONAL = """## What `-proportional` changes

The spool of each valve follows its duty cycle, and takes its place in Eq. (11); there is no carrier.

"""

SWITCHED = """With a carrier (T_pwm above 0) the opening of a valve is the mean over a sample of the switched valve. The
share a of a period that the valve is open is a line as in Eq. (11) but for short pulses, which lift the valve in part
only, and short gaps, after which it has fallen by h only; b is that of the period before, whose pulse may outlast its
period; s is the phase at which the valve opens, c the phase at the start of the sample, d the part of a period that the
sample lasts.

"""


#: The paper's equations, then those that it lacks: number, name, function and left side. Without a left side the
#: formula is that of the docstring, as of a sum over the weights or of a whole system.
EQUATIONS = (
    ("(1)", "Motion of the piston", "motion:acceleration", "v_dot"),
    ("(2)", "LuGre friction", "friction:friction_force", "f_f"),
    ("(3)", "LuGre friction: deflection of the seal", "friction:deflection_rate", "z_dot"),
    ("(4), (5)", "Pressure in a chamber", "chambers:pressure_rate", "p_dot"),
    ("(4)", "Volume of chamber A", "chambers:volume_a", "V_A"),
    ("(5)", "Volume of chamber B", "chambers:volume_b", "V_B"),
    ("(6) to (9)", "Flow function psi as printed", "valves:_printed_psi", "psi_printed"),
    ("(6) to (9)", "Flow function psi, laminar near r = 1", "valves:psi", "psi"),
    ("(10)", "Mass flow through an orifice", "valves:orifice_flow", "g"),
    ("(11)", "Opening of a valve", "opening:opening", "y_vx"),
    ("(12), (13)", "Breathing of chamber B", "valves:breathing_flow", "w_r"),
    ("(14)", "Load of the clutch", "weighted_load:Load", ""),
    ("(15)", "Spline phi_1", "load:phi_1", "phi_1"),
    ("(16)", "Spline phi_2", "load:phi_2", "phi_2"),
    ("(17)", "Spline phi_3", "load:phi_3", "phi_3"),
    ("(18) to (21)", "Coefficients of phi_1", "load:xi_1", "xi_1"),
    ("(18) to (21)", "Coefficients of phi_2", "load:xi_2", "xi_2"),
    ("(18) to (21)", "Coefficients of phi_3", "load:xi_3", "xi_3"),
    ("(23), (24)", "State equations", "isothermal:isothermal", ""),
    ("(25)", "Load at rest", "static:static_load", "f_l"),
    ("(26)", "Pressure at rest", "static:static_pressure", "p_A"),
    ("", "End stop", "motion:stop_force", "f_s"),
    ("", "Friction of pressed seals", "friction:coulomb_force", "F_p"),
    ("", "Stribeck effect", "friction:stribeck_force", "F_g"),
    ("", "Slip of the release bearing", "friction:bearing_force", "g_h"),
    ("", "Flow function by ISO 6358", "valves:iso_psi", "psi"),
    ("", "Mass flow by ISO 6358", "valves:iso_flow", "g"),
    ("", "Temperature before an orifice", "valves:thermal_factor", "T_f"),
    ("", "Leakage", "valves:leak_flow", "w"),
    ("", "Wall of a chamber", "chambers:wall_area", "S"),
    ("", "Heat from the wall", "chambers:heat_flow", "Q"),
    ("", "Pressure by the energy balance", "chambers:heated_pressure_rate", "p_dot"),
    ("", "Temperature in a chamber", "chambers:temperature_rate", "T_dot"),
    ("", "Reservoir of the supply", "supply:reservoir_rate", "p_S_dot"),
    ("", "Governor of the supply", "supply:governor_rate", "p_G_dot"),
)

#: Functions that an equation calls, and how the formula names them.
NAMED = {"psi": "psi", "_printed_psi": "psi_printed", "iso_psi": "psi", "orifice_flow": "g"}

#: Constants of the model that a formula names.
CONSTANTS = {"P_N": "p_N", "T_N": "T_N"}


PARAMETERS = """## Parameters

Sources "energy balance" and "Stribeck friction": [models.md](models.md#parameters)."""

KNOWN = """## Priors, drift and changes of the parameters

Standard deviations, as shares of the value or in the unit of the parameter: of the prior in a new actuator, log-normal
with a share, else normal; of the drift between two recordings where nothing has changed ("considered": it widens the
interval, and is not estimated from position alone); and of a change with the parameters of its group. Then whether a
calibration (`--free auto`) frees it, and whether it adapts in the observer: "yes" by its drift, else by the standard
deviation of its change within hours. A calibration and the observer know y_max to 0.5 mm, a calibration P_0 to 100 Pa.
Reasons: [priors](derivations.md#priors), [changes](derivations.md#changes-since-the-calibration)."""


def page() -> str:
    """The text of the page."""
    parts = [HEAD + "\n\n".join(_equation(*row) for row in EQUATIONS)]
    parts.append(STRIBECK + _own("isothermal-stribeck"))
    parts.append(BALANCE + _own("energy-balance"))
    if len(system("energy-balance").inputs) > 2:
        from clutchid.model.opening import (
            bridged_share,
            continued_share,
            fall,
            passed_pulses,
            pulse_share,
            switched_opening,
        )

        laws = (pulse_share, fall, continued_share, bridged_share, passed_pulses, switched_opening)
        parts.append(SWITCHED + "\n\n".join(_math(_formula(law)) for law in laws))
    parts.append(PROPORTIONAL + "\n\n".join(_math(_formula(law)) for law in (spool_rate, port_opening)))
    return "\n\n".join([*parts, PARAMETERS, _rows(), KNOWN, _known()]) + "\n"


def _equation(numbers: str, name: str, place: str, left: str) -> str:
    """One equation: a heading with its number and name, its function, and its formula."""
    module, _, function = place.partition(":")
    heading = f"### {numbers} {name}" if numbers else f"### {name}"
    equation = getattr(import_module(f"clutchid.model.{module}"), function)
    formula = _printed(equation, left) if isfunction(equation) and left else _formula(equation)
    return f"{heading}\n\n`{function}` in `model/{module}.py`\n\n{_math(formula)}"


def _printed(function: Callable[..., Any], left: str) -> str:
    """``left = ...`` in LaTeX, from a call with the function's own arguments; other functions of its file are named.

    A system of linear equations is printed as such, not solved.
    """
    module = import_module(function.__module__)
    inner = {
        name: (lambda *values, _name=NAMED[name]: sp.Function(_name, real=True)(*values))
        for name, item in vars(module).items()
        if isfunction(item) and item is not function and name in NAMED
    }
    inner |= {name: sp.Symbol(shown, real=True) for name, shown in CONSTANTS.items() if name in vars(module)}
    inner |= {
        name: lambda *_, _which=name[-1]: _xi(_which) for name in ("xi_1", "xi_2", "xi_3") if name in vars(module)
    }
    inner.pop(function.__name__, None)
    solved: list[tuple[Any, Any]] = []
    if "_solved" in vars(module):
        inner["_solved"] = lambda A, B: solved.append((A, B)) or []
    with patch.dict(vars(module), inner):
        value = function(**{name: sp.Symbol(name, real=True) for name in signature(function).parameters})
    if solved:
        xi, number = _xi(left[-1]), 0
        lines = []
        for A, B in solved:
            unknown = sp.Matrix(xi[number : number + B.rows])
            number += B.rows
            lines.append(f"{expression_latex(A)} {expression_latex(unknown)} &= {expression_latex(B)}")
        return _aligned(lines)
    if isinstance(value, list):  # pieces: ends and expressions
        y = sp.Symbol("y", real=True)
        value = sp.Piecewise(*((piece, y < end if end != sp.oo else True) for end, piece in value), evaluate=False)
    return _aligned([f"{before} &= {behind}" for before, behind in right_hand_lines(letters(left), value)])


def _xi(which: str) -> list[Any]:
    """The coefficients of phi_1, phi_2 or phi_3 as symbols."""
    return [sp.Symbol(f"{letter}_{which}", real=True) for letter in "abcdefgh"[: {"1": 3, "2": 4, "3": 8}[which]]]


def _aligned(lines: Sequence[str]) -> str:
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def parameter_tables() -> str:
    """The tables of the rows of `Parameters`, as Markdown."""
    return f"{_rows()}\n\n{KNOWN}\n\n{_known()}"


def _own(variant: str) -> str:
    """The equations of `variant` that the paper's model does not have; the switched valve is told by its formula."""
    of_isothermal = set(_lines("isothermal"))
    lines = [line for line in _lines(variant) if line not in of_isothermal and not re.match(r"[abiy]_\{v[se]\}", line)]
    return _math("\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}")


def _lines(variant: str) -> list[str]:
    return [line.removesuffix(r" \\") for line in latex_source(system(variant)).strip().splitlines()[1:-1]]


def _formula(function: Callable[..., object]) -> str:
    """The formula in the docstring of `function`."""
    match = re.search(r"\.\. math:: (.*?)\n\n", getdoc(function) or "", re.DOTALL)
    assert match, f"{function.__name__} has no formula"
    return match[1]


def _math(text: str) -> str:
    return f"```math\n{text}\n```"


def _rows() -> str:
    rows = ["| name | value | unit | meaning | allowed | source |", "|---|---|---|---|---|---|"]
    for item in fields(Parameters):
        row = item.metadata["row"]
        source = row.source.removesuffix(", docs/models.md")
        cells = (f"`{item.name}`", f"{item.default:g}", row.unit, row.meaning, _allowed(row), source)
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _allowed(row: Row) -> str:
    """Admissible values: from the least to the greatest."""
    return re.sub(r"^at least (\S+) and at most ", r"\1 to ", row.allowed)


def _known() -> str:
    """The table of priors, changes and use."""
    rows = ["| name | prior | drift | changes with a group | freed | adapts |", "|---|---|---|---|---|---|"]
    for name, row in Parameters.rows().items():
        changes = "; ".join(f"{change.group} {_std(change.std, row)}" for change in row.changes)
        drift = f"{_std(row.drift.std, row)}{', considered' * row.drift.considered}" if row.drift else ""
        freed = f"yes{f', valves {row.valves}' * bool(row.valves)}" if row.freed else ""
        hours = row.adapts and row.adapts.std
        adapts = _std(hours, row) if hours else "yes" * bool(row.adapts)
        cells = (f"`{name}`", _std(row.spread.std, row) if row.spread else "", drift, changes, freed, adapts)
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _std(std: float, row: Row) -> str:
    """A standard deviation of a row: a share, or a number in its unit."""
    return f"{100 * std:.4g} %" if row.in_shares else f"{std:g}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
