"""Docstrings: every public name has one, the model has all sections, and every equation has its function."""

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest

import clutchid
from fixtures.trees import source_trees

SECTIONS = ("Parameters", "Returns", "Examples")

#: Files and packages of the model that put equations together and hold none of their own.
GLUE = {"assembly.py", "compiled.py", "variants.py", "own"}

#: Public functions of the model with a docstring of one line. This list only shrinks.
ONE_LINE = {
    "load.py:phi_1",
    "load.py:phi_2",
    "load.py:phi_3",
    "load.py:paper_basis",
    "load.py:table_expressions",
}


def documented(tree: ast.Module) -> Iterator[tuple[str, str | None]]:
    """Public classes, functions and methods of a module, and their docstrings."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, ast.get_docstring(node)
            for item in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(item, ast.FunctionDef) and not item.name.startswith("_"):
                    yield f"{node.name}.{item.name}", ast.get_docstring(item)


@cache
def docstrings(room: str = "") -> dict[str, str | None]:
    """Docstrings of all modules and public names of the package, or of a room, by ``file:name``."""
    texts = {}
    for path, tree in source_trees().items():
        if path.startswith(room):
            file = path.removeprefix(room)
            texts[file] = ast.get_docstring(tree)
            texts |= {f"{file}:{name}": text for name, text in documented(tree)}
    return texts


def equations_in(text: str) -> set[int]:
    """Numbers of the equations that a docstring names: 'Eq. (10)', 'Eqs. (6)-(9)', 'Eqs. (4) and (5)'."""
    names: set[int] = set()
    for start in re.finditer(r"Eqs?\.\s+((?:\(\d+\)(?:\s*(?:-|,|and)\s*)*)+)", text):
        names |= {int(number) for number in re.findall(r"\((\d+)\)", start[1])}
        for first, last in re.findall(r"\((\d+)\)\s*-\s*\((\d+)\)", start[1]):
            names |= set(range(int(first), int(last) + 1))
    return names


@pytest.mark.slow
def test_every_module_and_every_public_name_is_documented():
    assert [name for name, text in docstrings().items() if not text] == []


def test_a_docstring_begins_with_one_line_that_ends_with_a_full_stop():
    first = {name: (text or ".").strip().splitlines()[0] for name, text in docstrings().items()}
    assert {name: line for name, line in first.items() if not line.rstrip().endswith((".", ":", "?", "!", ";"))} == {}


def test_public_functions_of_the_model_have_parameters_returns_and_examples():
    lacking = {}
    for path, tree in source_trees().items():
        name = path.removeprefix("model/")
        for node in tree.body if name != path else ():
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                key, text = f"{name}:{node.name}", ast.get_docstring(node) or ""
                lacking[key] = [section for section in SECTIONS if f"\n{section}\n---" not in text]
    glue = {key for key in lacking if key.split(":")[0].split("/")[0] in GLUE}
    poor = {key: sections for key, sections in lacking.items() if sections and key not in ONE_LINE | glue}
    assert poor == {}
    assert sorted(key for key in ONE_LINE if not lacking.get(key)) == [], "take them from the list"


def test_no_docstring_says_that_nothing_is_raised():
    said = [name for name, text in docstrings().items() if re.search(r"Raises\n-+\n\s*Nothing", text or "")]
    assert said == []


def test_every_equation_of_the_paper_is_named_where_it_stands():
    named = set().union(*(equations_in(text or "") for text in docstrings("model/").values()))
    # the paper has no Eq. (22): (21) is followed by (23)
    assert sorted(named) == [number for number in range(1, 27) if number != 22]


def test_single_equations_lead_to_their_functions():
    texts = docstrings("model/")
    expected = {
        1: "motion.py:acceleration", 2: "friction.py:friction_force", 3: "friction.py:deflection_rate",
        4: "chambers.py:pressure_rate", 5: "chambers.py:pressure_rate", 6: "valves.py:psi", 9: "valves.py:psi",
        10: "valves.py:orifice_flow", 11: "opening.py:opening", 12: "valves.py:breathing_flow",
        13: "valves.py:breathing_flow", 14: "weighted_load.py:Load", 15: "load.py:phi_1", 16: "load.py:phi_2",
        17: "load.py:phi_3", 18: "load.py:xi_1", 23: "isothermal.py:isothermal", 25: "static.py:static_load",
        26: "static.py:static_pressure",
    }  # fmt: skip
    assert {n: place for n, place in expected.items() if n not in equations_in(texts[place] or "")} == {}


def test_the_nouns_and_verbs_of_the_design_are_offered():
    wanted = {"Parameters", "Log", "Actuator", "Load", "Fit", "read", "write", "look", "simulate", "fit", "Partition"}
    wanted |= {"calibrate", "estimate"}
    errors = {"ClutchidError", "ParameterError", "DataError", "SolveError", "ExportError", "MissingExtra"}
    assert wanted | errors <= set(clutchid.__all__)
