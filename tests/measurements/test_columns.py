"""The grammar of headings, and what is wrong with them."""

import pytest

from clutchid.measurements.columns import (
    heading_problems,
    headings,
    ignored,
    unit_at_end,
    unit_spelled,
)
from clutchid.messages import shortened
from fixtures.cases import case_tables

CASES = case_tables(__file__, "columns")


@pytest.mark.parametrize(("texts", "expected"), [(texts, row) for *row, texts in CASES["headings"]])
def test_a_heading_is_a_name_and_a_unit(texts, expected):
    for heading in headings(texts):
        assert [heading.name or "-", heading.unit or "-", heading.si or "-"] == expected


def test_a_unit_that_is_not_given_is_asked_for():
    problems = heading_problems(headings(["time", "position [m]", "duty_supply [1]", "duty_exhaust [1]"]))
    assert problems == [
        "column 1 'time' has no unit in brackets; write time [s] (or another of ms, us, µs, ns, 100ns, min, h, d)."
    ]


@pytest.mark.parametrize(("text", "end"), CASES["unknown"])
def test_a_unit_that_is_not_known_lists_the_known_ones(text, end):
    (problem,) = heading_problems(headings(["time [s]", text, "duty_supply [1]", "duty_exhaust [1]"]))
    assert problem == f"column 2 '{text}': {end}"


def test_long_lists_and_texts_are_cut():
    (warning,) = ignored(headings([f"signal {i} [1]" for i in range(100)]))
    assert "and 88 more are unknown and left out" in warning
    assert shortened("a\n  b", 40) == "a b"
    assert len(shortened("x" * 100)) == 40


def test_a_name_of_two_hundred_characters_is_kept_and_a_longer_one_is_cut():
    whole, cut = headings(["a" * 200, "b" * 201])
    assert whole.text == "a" * 200
    assert cut.text == "b" * 199 + "…"


@pytest.mark.parametrize(("unit", "spellings"), CASES["words"])
def test_words_for_units_are_known(unit, spellings):
    assert {unit_spelled(word) for word in spellings.split()} == {unit}


@pytest.mark.parametrize(("texts", "si", "unit"), CASES["ends"])
def test_a_unit_at_the_end_of_a_name_is_found(texts, si, unit):
    assert {unit_at_end(text, si) for text in texts} == {None if unit == "-" else unit}
