"""Parts of pages that the code prints: ``python docs/printed.py NAME``, or ``options COMMAND``.

A page has such a part as a comment ``<!-- printed NAME -->``. The site puts it in the place of the comment, and the
options of a command on its page, so that no page keeps a copy of what the code says.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from make_equations import own_equations, splines

from clutchid.cli import app
from clutchid.exports.requirements import requirement_table
from clutchid.inference.uncertainty.change_prior import directions
from clutchid.log.states import STATES
from clutchid.observer.flags import FLAGS, LIVE_FLAGS
from clutchid.parameters import GROUPS, Parameters, Row

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "clutchid"
EXAMPLES = Path(__file__).parent / "examples"

#: A printed part in a page.
MARK = re.compile(r"<!-- printed ([\w-]+) -->")


def table(heading: str, rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown under a heading ``one | two``."""
    lines = [heading, " | ".join("---" for _ in heading.split("|"))]
    return "\n".join(f"| {line} |" for line in [*lines, *(" | ".join(row) for row in rows)])


def parameters() -> str:
    """Value, unit, meaning, range and source of every parameter."""
    rows = Parameters.rows().items()
    cells = (
        (f"`{name}`", f"{getattr(Parameters(), name):g}", row.unit, row.meaning, _allowed(row), _source(row))
        for name, row in rows
    )
    return table("name | value | unit | meaning | allowed | source", cells)


def priors() -> str:
    """Prior, drift, changes and use of every parameter."""
    return table(
        "name | prior | drift | changes with a group | freed | adapts",
        (_prior(*row) for row in Parameters.rows().items()),
    )


def changes() -> str:
    """The directions in which the parameters of a group change together."""
    rows = Parameters.rows()
    return table(
        "group | direction",
        (
            (group, ", ".join(f"`{name}` {_std(std, rows[name])}" for name, std in direction.items()))
            for group in GROUPS
            for direction in directions(rows, group)
        ),
    )


def states() -> str:
    """Noise of every state over 0.1 s, and at the start of a recording."""
    return table(
        "state | over 0.1 s | vented start | other start",
        (
            (f"`{name}`, {s.meaning}", *(f"{std:g} {s.unit}" for std in (s.noise, s.start, s.unknown_start)))
            for name, s in STATES.items()
        ),
    )


def flags(meanings: Mapping[str, str]) -> str:
    """The meaning of every flag of an observer."""
    return table("flag | meaning", ((f"`{name}`", meaning) for name, meaning in meanings.items()))


def options(command: str) -> str:
    """The options of a command, as its ``--help`` has them."""
    arguments = app()[command].assemble_argument_collection(parse_docstring=True)
    rows = ((_names(a.names), a.parameter.help or "") for a in arguments if a.parse and not a.children)
    return table("option | meaning", ((names, " ".join(text.split()).replace("|", "\\|")) for names, text in rows))


def packages() -> str:
    """A row for each package, top to bottom, with the first sentence of its docstring."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"][0]
    layers = [[name.removeprefix("clutchid.") for name in layer.split(" | ")] for layer in contract["layers"]]
    return table(
        "package | holds",
        (
            (f"`{name}`" + (f", beside `{layer[0]}`" if name != layer[0] else ""), _sentence(PACKAGE / name))
            for layer in layers
            for name in layer
        ),
    )


#: What can be printed, by name.
PRINTED: dict[str, Callable[[], str]] = {
    "packages": packages,
    "parameters": parameters,
    "priors": priors,
    "changes": changes,
    "states": states,
    "flags": lambda: flags(FLAGS),
    "live-flags": lambda: flags(LIVE_FLAGS),
    "requirements": lambda: requirement_table("NAME"),
    "splines": splines,
    "maxwell-slip": lambda: f"```python\n{(EXAMPLES / 'maxwell_slip.py').read_text('utf-8')}```",
    "stribeck": lambda: own_equations("isothermal-stribeck"),
    "energy-balance": lambda: own_equations("energy-balance"),
}


def with_printed(text: str) -> str:
    """The text of a page with its printed parts."""
    return MARK.sub(lambda mark: PRINTED[mark[1]](), text)


def _sentence(package: Path) -> str:
    """The first sentence of the docstring of a package or module."""
    file = package / "__init__.py" if package.is_dir() else package.with_suffix(".py")
    first = " ".join((ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")[0].split())
    return re.sub(r"`+([\w/]+)`+", r"`\1`", first.partition(". ")[0].removesuffix("."))


def _names(names: Iterable[str]) -> str:
    names = tuple(names)
    negative = {f"--no-{name.removeprefix('--')}" for name in names}
    return ", ".join(f"`{name}`" for name in names if name not in negative)


def _source(row: Row) -> str:
    return row.source.removesuffix(", docs/models.md")


def _allowed(row: Row) -> str:
    """Admissible values: from the least to the greatest."""
    return re.sub(r"^at least (\S+) and at most ", r"\1 to ", row.allowed)


def _prior(name: str, row: Row) -> tuple[str, ...]:
    changed = "; ".join(f"{change.group} {_std(change.std, row)}" for change in row.changes)
    drift = f"{_std(row.drift.std, row)}{', considered' * row.drift.considered}" if row.drift else ""
    freed = f"yes{f', valves {row.valves}' * bool(row.valves)}" if row.freed else ""
    hours = row.adapts and row.adapts.std
    adapts = _std(hours, row) if hours else "yes" * bool(row.adapts)
    return f"`{name}`", _std(row.spread.std, row) if row.spread else "", drift, changed, freed, adapts


def _std(std: float, row: Row) -> str:
    """A standard deviation of a row: a share, or a number in its unit."""
    return f"{100 * std:.4g} %" if row.in_shares else f"{std:g}"


if __name__ == "__main__":
    name, *commands = sys.argv[1:] or ["parameters"]
    print(options(commands[0]) if name == "options" else PRINTED[name]())
