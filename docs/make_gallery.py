"""Draw the gallery: ``python docs/make_gallery.py FOLDER`` runs each script in docs/gallery and keeps its picture.

A script says in its docstring what it shows, and leaves a matplotlib figure called `figure`. A picture is kept under
the checksum of its script, of this file and of the version of clutchid, so that a script that has not changed does
not run again. Each script is written as a notebook too, with a cell at each `# %%`.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import runpy
import shutil
import sys
from contextlib import redirect_stdout
from hashlib import sha256
from io import StringIO
from pathlib import Path

import clutchid

SCRIPTS = Path(__file__).parent / "gallery"
KEPT = Path(__file__).resolve().parents[1] / ".gallery"


def scripts() -> list[Path]:
    """The scripts of the gallery by name."""
    return sorted(SCRIPTS.glob("*.py"))


def words(script: Path) -> tuple[str, str]:
    """Title and text of a script."""
    title, _, text = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or "").partition("\n")
    return title.strip(), text.strip()


def code(script: Path) -> str:
    """A script behind its docstring."""
    return script.read_text(encoding="utf-8").split('"""', 2)[2].strip()


def cells(script: Path) -> list[str]:
    """The cells of a script: its parts behind `# %%`, or the whole; the last one ends with the figure."""
    parts = [part.strip() for part in code(script).split("# %%\n") if part.strip()]
    return [*parts[:-1], f"{parts[-1]}\nfigure"]


def notebook(script: Path) -> dict[str, object]:
    """A script as a Jupyter notebook, format 4.5, without results."""
    title, text = words(script)
    first = {"cell_type": "markdown", "id": "title", "metadata": {}, "source": f"# {title}\n\n{text}"}
    blank = {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": []}
    others = [{**blank, "id": f"cell-{n}", "source": source} for n, source in enumerate(cells(script), 1)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": kernel}, "cells": [first, *others]}


def picture(script: Path) -> Path:
    """The picture of a script, drawn where it is not kept."""
    key = sha256(script.read_bytes() + Path(__file__).read_bytes() + clutchid.__version__.encode()).hexdigest()[:16]
    stored = KEPT / f"{script.stem}-{key}.png"
    if not stored.exists():
        os.environ["MPLBACKEND"] = "agg"
        with redirect_stdout(StringIO()):
            figure = runpy.run_path(str(script))["figure"]
        figure.tight_layout()
        KEPT.mkdir(exist_ok=True)
        figure.savefig(unfinished := stored.with_suffix(".part.png"), dpi=110)
        unfinished.replace(stored)
    return stored


def gallery(folder: Path) -> None:
    """Write the page of the gallery, and its pictures, to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [
        "# Gallery",
        "Scripts of docs/gallery with what they draw. Each runs as it is; units in the figures are in their axes.",
    ]
    for script in scripts():
        title, text = words(script)
        shutil.copy(picture(script), folder / f"{script.stem}.png")
        (folder / f"{script.stem}.ipynb").write_text(json.dumps(notebook(script), indent=1), encoding="utf-8")
        parts += [
            f"## {title}",
            text,
            f"![{title}]({script.stem}.png)",
            f"`docs/gallery/{script.name}`, [notebook]({script.stem}.ipynb)",
        ]
        parts += [f"```python\n{code(script)}\n```"]
    (folder / "index.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the page and its pictures are written")
    sys.exit(gallery(parser.parse_args().folder))
