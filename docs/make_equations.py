"""Write docs/equations.md from the equations and the rows of the Appendix: ``python docs/make_equations.py``."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields
from inspect import getdoc
from pathlib import Path

from clutchid.codegen.latex import latex_source
from clutchid.model.compiled import system
from clutchid.model.opening import port_opening, spool_rate
from clutchid.parameters import Parameters, Row

PAGE = Path(__file__).parent / "equations.md"

HEAD = """# The model

Made from the code by `python docs/make_equations.py`; do not edit. The derivations, and every deviation from the print,
stand in the docstrings of `clutchid.model` and in [deviations.md](deviations.md). What the variants are for stands in
[models.md](models.md).

## The paper's model: `isothermal`

"""

STRIBECK = """## What `-stribeck` changes

F_g takes the place of F_C in the rate of the deflection.

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


KNOWN = """## What is known of the parameters

Standard deviations, as shares of the value or in the unit of the parameter: of the prior in a new actuator, log-normal
with a share, else normal; of the drift between two recordings where nothing has changed ("considered": it widens the
interval, and is not estimated from position alone); and of a change with the parameters of its group. Then whether a
calibration (`--free auto`) frees it, and whether it adapts in the observer: "yes" by its drift, else by the standard
deviation of its change within hours. A calibration and the observer know y_max to 0.5 mm, a calibration P_0 to 100 Pa.
Reasons: [priors](derivations.md#priors), [changes](derivations.md#changes-since-the-calibration)."""


def page() -> str:
    """The text of the page."""
    parts = [HEAD + _math(latex_source(system("isothermal")))]
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
    return "\n\n".join([*parts, "## Parameters", _rows(), KNOWN, _known()]) + "\n"


def _own(variant: str) -> str:
    """The equations of `variant` that the paper's model does not have; the switched valve is told by its formula."""
    known = set(_lines("isothermal"))
    lines = [line for line in _lines(variant) if line not in known and not re.match(r"[abiy]_\{v[se]\}", line)]
    return _math("\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}")


def _lines(variant: str) -> list[str]:
    return [line.removesuffix(r" \\") for line in latex_source(system(variant)).strip().splitlines()[1:-1]]


def _formula(function: Callable[..., object]) -> str:
    """The formula in the docstring of `function`."""
    found = re.search(r"\.\. math:: (.*?)\n\n", getdoc(function) or "", re.DOTALL)
    assert found, f"{function.__name__} has no formula"
    return found[1]


def _math(text: str) -> str:
    return f"```math\n{text}\n```"


def _rows() -> str:
    rows = ["| name | value | unit | meaning | allowed | source |", "|---|---|---|---|---|---|"]
    for item in fields(Parameters):
        row = item.metadata["row"]
        cells = (f"`{item.name}`", f"{item.default:g}", row.unit, row.meaning, row.allowed, row.source)
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _known() -> str:
    """The table of priors, changes and use."""
    rows = ["| name | prior | drift | changes with a group | freed | adapts |", "|---|---|---|---|---|---|"]
    for name, row in Parameters.rows().items():
        changes = "; ".join(f"{one.group} {_std(one.std, row)}" for one in row.changes)
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
