"""Write the rooms of docs/architecture.md from contract and docstrings: ``python docs/make_architecture.py``."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PACKAGE = ROOT / "src" / "clutchid"

#: The part of the page that is made: from one comment to the other.
PLACE = re.compile(r"(?<=<!-- rooms -->\n).*?(?=<!-- end of rooms -->)", re.DOTALL)


def rooms() -> str:
    """A row a room, top to bottom, with the first sentence of its docstring, and the other contracts below."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    layers = [[name.removeprefix("clutchid.") for name in layer.split(" | ")] for layer in contracts[0]["layers"]]
    lines = ["| room | holds |", "|---|---|"]
    for layer in layers:
        beside = f", beside `{layer[0]}`" if len(layer) > 1 else ""
        for room in layer:
            lines += [f"| `{room}`{beside if room != layer[0] else ''} | {sentence(PACKAGE / room)} |"]
    names = [f"- {contract['name'][0].upper()}{contract['name'][1:]}." for contract in contracts]
    return "\n".join([*lines, "", *names]) + "\n"


def sentence(room: Path) -> str:
    """The first sentence of the docstring of a package or module."""
    file = room / "__init__.py" if room.is_dir() else room.with_suffix(".py")
    first = " ".join((ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")[0].split())
    return re.sub(r"`+([\w/]+)`+", r"`\1`", first.partition(". ")[0].removesuffix("."))


if __name__ == "__main__":
    PAGE.write_text(PLACE.sub(lambda _: rooms(), PAGE.read_text("utf-8")), encoding="utf-8")
