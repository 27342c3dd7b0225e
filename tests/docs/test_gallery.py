"""The gallery: each script runs, says what it shows, and draws a figure whose axes have units."""

import ast
import re
import runpy
import sys
from pathlib import Path

import matplotlib as mpl
import pytest

from fixtures.once import fits_once

DOCS = Path(__file__).resolve().parents[2] / "docs"
SCRIPTS = sorted((DOCS / "gallery").glob("*.py"))

#: A script of several cells: it runs as its notebook.
CELLS = "own_tools.py"


@pytest.fixture(scope="module")
def made():
    """The module that draws the gallery."""
    sys.path.insert(0, str(DOCS))
    try:
        import make_gallery

        yield make_gallery
    finally:
        sys.path.remove(str(DOCS))


@pytest.mark.slow
@fits_once()
@pytest.mark.parametrize("script", [s for s in SCRIPTS if s.name != CELLS], ids=lambda path: path.stem)
def test_a_script_draws_a_figure_whose_axes_have_units(script, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure = runpy.run_path(str(script))["figure"]
    check_units(figure)
    plt.close("all")


def check_units(figure):
    labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())]
    assert labels
    assert [label for label in labels if not re.search(r"\[.+\]$", label)] == []


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_a_title_and_says_what_it_shows(script, made):
    title, words = made.words(script)
    assert 0 < len(title) < 60
    assert not title.endswith(".")
    assert words.endswith(".")
    assert '"""' not in made.code(script)
    assert ast.parse(made.code(script)).body


@pytest.mark.slow
def test_a_notebook_runs_cell_by_cell_and_shows_its_fit(made, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    notebook = made.notebook(made.SCRIPTS / CELLS)
    assert (notebook["nbformat"], notebook["cells"][0]["cell_type"]) == (4, "markdown")
    names, shown = {}, []
    for cell in notebook["cells"][1:]:
        *body, last = ast.parse(cell["source"]).body
        exec(compile(ast.Module(body, []), "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
        else:
            exec(compile(ast.Module([last], []), "cell", "exec"), names)
    assert "<" in shown[0]._repr_html_(), "the fit, as a notebook shows it"
    assert shown[-1] is names["figure"]
    check_units(shown[-1])
    assert len(shown) >= 6


def test_a_picture_is_drawn_once_and_anew_when_its_script_has_changed(made, tmp_path, monkeypatch):
    monkeypatch.setattr(made, "KEPT", tmp_path / "kept")
    script = tmp_path / "one.py"
    lines = [
        "from pathlib import Path",
        "from matplotlib.figure import Figure",
        f"log = Path({str(tmp_path / 'log')!r})",
    ]
    lines += ["log.write_text((log.read_text() if log.exists() else '') + 'x')", "figure = Figure()", ""]
    script.write_text('"""One\n\nText."""\n' + "\n".join(lines))
    first = made.picture(script)
    assert made.picture(script) == first
    assert (tmp_path / "log").read_text() == "x"
    script.write_text(script.read_text() + "figure.set_size_inches(2, 2)\n")
    assert made.picture(script) != first
    assert (tmp_path / "log").read_text() == "xx"
