"""Write docs/equations.md from the equations: ``python docs/make_equations.py``."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from importlib import import_module
from inspect import getdoc, isfunction, signature
from pathlib import Path
from typing import Any
from unittest.mock import patch

import sympy as sp
from latex import expression_latex, latex_source, letters, right_hand_lines

from clutchid.model import opening
from clutchid.model.compiled import system
from clutchid.model.opening import port_opening, spool_rate

PAGE = Path(__file__).parent / "equations.md"

HEAD = """# The model

Printed from the code by `python docs/make_equations.py`; do not edit. Deviations from the paper:
[deviations.md](deviations.md); variants: [models.md](models.md).

## Equation by equation

Numbers are those of the paper, which has no (22). Each formula is printed from the function named above it, with that
function's arguments; units, ranges, sources and an example are in its docstring.

"""

STRIBECK = """## What `-stribeck` changes

F_g takes the place of F_C in the rate of the deflection, Eq. (3). `python docs/printed.py stribeck` prints the changed
equations; the site has them here.

<!-- printed stribeck -->"""

BALANCE = """## What `energy-balance` changes

p_A, p_B, T_A, T_B and p_S have rates of their own; the flows depend on the temperature of the air before the orifice
and on the pressure in the reservoir. The rest is as in the paper's model. `python docs/printed.py energy-balance`
prints the whole; a condition inside an expression stands before it, so the first condition of w_v is w_v^(1).

<!-- printed energy-balance -->"""

PROPORTIONAL = """## What `-proportional` changes

The spool of each valve follows its duty cycle, and takes its place in Eq. (11); there is no carrier.

"""

SWITCHED = """## The switched valve

With a carrier (T_pwm above 0) the opening of a valve is the mean over a sample of the switched valve:

- a: share of a period for which the valve is open, linear as in Eq. (11). A short pulse lifts the valve in part only,
  and after a short gap it has fallen by h only.
- b: that share in the period before, whose pulse may outlast its period.
- s, c, d: phase at which the valve opens, phase at the start of the sample, length of the sample in periods.

"""


#: Functions whose formulas make the mean opening of a switched valve.
SWITCHED_LAWS = (
    "pulse_share", "fall", "continued_share", "bridged_share", "passed_pulses", "switched_opening",
)  # fmt: skip

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
    ("(15) to (21)", "Splines of the load and their coefficients", "", ""),
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

#: The paper's splines of the load, which the page leaves to the site.
SPLINES = (
    ("(15)", "Spline phi_1", "load:phi_1", "phi_1"),
    ("(16)", "Spline phi_2", "load:phi_2", "phi_2"),
    ("(17)", "Spline phi_3", "load:phi_3", "phi_3"),
    ("(18) to (21)", "Coefficients of phi_1", "load:xi_1", "xi_1"),
    ("(18) to (21)", "Coefficients of phi_2", "load:xi_2", "xi_2"),
    ("(18) to (21)", "Coefficients of phi_3", "load:xi_3", "xi_3"),
)

#: Functions that an equation calls, and how the formula names them.
NAMED = {"psi": "psi", "_printed_psi": "psi_printed", "iso_psi": "psi", "orifice_flow": "g"}

#: Constants of the model that a formula names.
CONSTANTS = {"P_N": "p_N", "T_N": "T_N"}


LEFT_TO_SITE = """`python docs/printed.py splines` prints them from `model/load.py`; the site has them here.

<!-- printed splines -->"""

PARAMETERS = """## Parameters

`python docs/printed.py parameters` prints the rows of `Parameters`; the site has them here. Sources "energy balance"
and "Stribeck friction": [models.md](models.md#parameters).

<!-- printed parameters -->

## Priors, drift and changes of the parameters

`python docs/printed.py priors`. Standard deviations, as shares of the value or in the unit of the parameter:

- **prior** in a new actuator, log-normal with a share, else normal;
- **drift** between two recordings without a change; "considered" drift widens the interval and is not estimated from
  position alone;
- **changes** with the parameters of a group ([which](derivations.md#changes-since-the-calibration));
- **freed** by `--free auto`; **adapts** in the observer, "yes" by its drift, else by the change within hours.

A calibration and the observer know y_max to 0.5 mm, a calibration P_0 to 100 Pa.

<!-- printed priors -->
"""


def page() -> str:
    """The text of the page."""
    parts = [HEAD + "\n\n".join(_equation(*row) for row in EQUATIONS), STRIBECK, BALANCE]
    parts.append(SWITCHED + "\n\n".join(_math(_formula(getattr(opening, law))) for law in SWITCHED_LAWS))
    parts.append(PROPORTIONAL + "\n\n".join(_math(_formula(law)) for law in (spool_rate, port_opening)))
    return "\n\n".join([*parts, PARAMETERS])


def _equation(numbers: str, name: str, place: str, left: str) -> str:
    """One equation: a heading with its number and name, its function, and its formula."""
    module, _, function = place.partition(":")
    heading = f"### {numbers} {name}" if numbers else f"### {name}"
    if not place:
        return f"{heading}\n\n{LEFT_TO_SITE}"
    equation = getattr(import_module(f"clutchid.model.{module}"), function)
    formula = _printed(equation, left) if isfunction(equation) and left else _formula(equation)
    return f"{heading}\n\n`{function}` in `model/{module}.py`\n\n{_math(formula)}"


def splines() -> str:
    """The equations of `SPLINES`."""
    return "\n\n".join(_equation(*row) for row in SPLINES)


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
    if len(lines) == 1:
        return lines[0].replace("&= ", "= ", 1)
    return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def own_equations(variant: str) -> str:
    """The equations of `variant` that the paper's model does not have; the switched valve has its formula."""
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


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
