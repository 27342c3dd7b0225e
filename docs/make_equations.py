"""Write docs/equations.md from the equations and the rows of the Appendix: ``python docs/make_equations.py``."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from clutchid.codegen.latex import latex_source
from clutchid.model.isothermal import isothermal
from clutchid.parameters import Parameters

PAGE = Path(__file__).parent / "equations.md"

HEAD = """# The model

Made from the code by `python docs/make_equations.py`; do not edit. The derivations, and every deviation from the print,
stand in the docstrings of `clutchid.model` and in [deviations.md](deviations.md).

## Equations

"""


def page() -> str:
    """The text of the page."""
    rows = ["| name | value | unit | meaning | allowed | source |", "|---|---|---|---|---|---|"]
    for item in fields(Parameters):
        row = item.metadata["row"]
        cells = (f"`{item.name}`", f"{item.default:g}", row.unit, row.meaning, row.allowed, row.source)
        rows.append("| " + " | ".join(cells) + " |")
    return f"{HEAD}```math\n{latex_source(isothermal())}\n```\n\n## Parameters\n\n" + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
