"""What a stroke is stands in one module; what moves otherwise is an excursion, a pass, or a section of motion."""

import ast
import re
from pathlib import Path

import clutchid

HOUSE = Path(clutchid.__file__).parent
DEFINITION = "strokes/stroke.py"

#: Names of numbers and of functions that say where a stroke begins or ends, and how short it may be.
NUMBERS = re.compile(r"BEGINS|ENDS|QUICKEST|STROKE_?(BEGINS|ENDS|TIME|SHORTEST)|(SHORTEST|FULL|MIN)_STROKES?")
FUNCTIONS = re.compile(r"count_strokes|strokes?_(begins?|ends?)|in_stroke")


def definitions(path):
    """Names of the constants and functions that a module defines."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else ()
        names = [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        yield from (name for name in names if NUMBERS.fullmatch(name))
        if isinstance(node, ast.FunctionDef) and FUNCTIONS.fullmatch(node.name):
            yield node.name


def test_numbers_and_count_of_a_stroke_stand_once():
    modules = {str(path.relative_to(HOUSE)): set(definitions(path)) for path in HOUSE.rglob("*.py")}
    assert modules.pop(DEFINITION) == {"BEGINS", "ENDS", "QUICKEST", "count_strokes"}
    assert {name: found for name, found in modules.items() if found} == {}


def test_the_c_counts_strokes_in_one_place_by_these_numbers():
    texts = "".join(path.read_text(encoding="utf-8") for path in (HOUSE / "exports" / "templates").glob("*.j2"))
    for number in ("begins", "ends"):
        assert len(re.findall(rf"stroke\.{number}\b", texts)) == 1
    assert len(re.findall(r"self->strokes\+\+", texts)) == 1
