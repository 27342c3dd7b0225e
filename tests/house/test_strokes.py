"""What a stroke is stands in one module; what moves otherwise is an excursion, a pass, or a section of motion."""

import re
from pathlib import Path

import clutchid

HOUSE = Path(clutchid.__file__).parent

#: Names that say where a stroke begins or ends, how short it may be, or that count strokes.
NUMBER = r"BEGINS|ENDS|QUICKEST|STROKE_?(?:BEGINS|ENDS|TIME|SHORTEST)|(?:SHORTEST|FULL|MIN)_STROKES?"
DEFINITION = re.compile(
    rf"^(?:def (?:count_strokes|stroke_(?:begins|ends))\(|(?:\w+, )*(?:{NUMBER})(?:, \w+)* = )", re.M
)


def texts(folder, suffix):
    return {path: path.read_text(encoding="utf-8") for path in folder.rglob(f"*.{suffix}")}


def test_numbers_and_count_of_a_stroke_stand_once():
    assert [path.name for path, text in texts(HOUSE, "py").items() if DEFINITION.search(text)] == ["stroke.py"]


def test_the_c_counts_strokes_in_one_place_by_these_numbers():
    c = "".join(texts(HOUSE / "exports" / "templates", "j2").values())
    counts = (r"stroke\.BEGINS", r"stroke\.ENDS", r"self->strokes\+\+")
    assert [len(re.findall(text, c)) for text in counts] == [1, 0, 1], "a stretch may begin within a stroke, too"
