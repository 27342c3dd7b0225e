"""Write the packages of docs/architecture.md from contract and docstrings: ``python docs/make_architecture.py``."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PACKAGE = ROOT / "src" / "clutchid"

#: The part of the page that is made: from one comment to the other.
PLACE = re.compile(r"(?<=<!-- packages -->\n).*?(?=<!-- end of packages -->)", re.DOTALL)


def packages() -> str:
    """A row a package, top to bottom, with the first sentence of its docstring."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"][0]
    layers = [[name.removeprefix("clutchid.") for name in layer.split(" | ")] for layer in contract["layers"]]
    lines = ["| package | holds |", "|---|---|"]
    for layer in layers:
        for name in layer:
            beside = f", beside `{layer[0]}`" if name != layer[0] else ""
            lines += [f"| `{name}`{beside} | {sentence(PACKAGE / name)} |"]
    return "\n".join(lines) + "\n"


def sentence(package: Path) -> str:
    """The first sentence of the docstring of a package or module."""
    file = package / "__init__.py" if package.is_dir() else package.with_suffix(".py")
    first = " ".join((ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").partition("\n\n")[0].split())
    return re.sub(r"`+([\w/]+)`+", r"`\1`", first.partition(". ")[0].removesuffix("."))


if __name__ == "__main__":
    PAGE.write_text(PLACE.sub(lambda _: packages(), PAGE.read_text("utf-8")), encoding="utf-8")
