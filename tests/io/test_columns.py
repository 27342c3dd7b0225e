"""The grammar of headings, and what is wrong with them."""

import pytest

from clutchid.io.columns import QUANTITIES, REQUIRED, heading_problems, headings, ignored, shortened
from clutchid.log import COLUMNS


@pytest.mark.parametrize(
    ("text", "name", "unit", "si"),
    [
        ("time [s]", "time", "s", "s"),
        ("  TIME[ms] ", "time", "ms", "s"),
        ("Duty Supply [%]", "duty_supply", "%", "1"),
        ("pressure_a   [ bar (g) ]", "pressure_a", "bar(g)", "Pa"),
        ("pressure_a low [kPa]", "pressure_a low", "kPa", "Pa"),
        ("pressure_a_high [Pa]", "pressure_a high", "Pa", "Pa"),
        ("position [\N{GREEK SMALL LETTER MU}m]", "position", "\N{MICRO SIGN}m", "m"),
        ("position", "position", None, None),
        ("position []", "position", None, None),
        ("position [mm", "position", None, None),
        ("position [bar]", "position", "bar", None),
        ("position [MM]", "position", "MM", None),
        ("oil [degC]", None, "degC", "K"),
        ("", None, None, None),
    ],
)
def test_a_heading_is_a_name_and_a_unit(text, name, unit, si):
    (heading,) = headings([text])
    assert (heading.name, heading.unit, heading.si) == (name, unit, si)


def test_every_column_of_a_log_is_understood_as_it_is_written():
    columns = headings(f"{name} [{si}]" for name, si in QUANTITIES.items())
    assert [column.name for column in columns] == ["time", *COLUMNS]
    assert heading_problems(columns) == []
    assert ignored(columns) == []


def test_duplicates_are_found_whatever_their_spelling_and_unit():
    texts = [f"{name} [{QUANTITIES[name]}]" for name in REQUIRED]
    (problem,) = heading_problems(headings([*texts, "Position [mm]"]))
    assert problem == "columns 2 and 5 ('position [m]', 'Position [mm]') all mean 'position'; keep one of them."


def test_a_missing_column_is_named_with_the_nearest_one_and_what_the_file_has():
    (problem,) = heading_problems(headings(["time [s]", "positon [mm]", "duty_supply [1]", "duty_exhaust [1]"]))
    assert problem.startswith("no column 'position' (write position [m]; is it 'positon [mm]'?)")
    assert problem.endswith("the file has 'time [s]', 'positon [mm]', 'duty_supply [1]', 'duty_exhaust [1]'.")


def test_a_unit_that_is_not_given_is_asked_for():
    problems = heading_problems(headings(["time", "position [m]", "duty_supply [1]", "duty_exhaust [1]"]))
    assert problems == ["column 1 'time' has no unit in brackets; write time [s] (or another of ms, us, µs, min, h)."]


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("position [furlong]", "unit [furlong] is not known here; use one of m, cm, mm, um, µm."),
        ("position [bar]", "unit [bar] is not known here; use one of m, cm, mm, um, µm."),
        ("position [MM]", "unit [MM] is not known here; did you mean [mm]? Known are m, cm, mm, um, µm."),
    ],
)
def test_a_unit_that_is_not_known_lists_the_known_ones(text, end):
    (problem,) = heading_problems(headings(["time [s]", text, "duty_supply [1]", "duty_exhaust [1]"]))
    assert problem == f"column 2 '{text}': {end}"


def test_long_lists_and_texts_are_cut():
    (warning,) = ignored(headings([f"signal {i} [1]" for i in range(100)]))
    assert "and 88 more are not known and left out" in warning
    assert shortened("a\n  b", 40) == "a b"
    assert len(shortened("x" * 100)) == 40


def test_a_name_of_two_hundred_characters_is_kept_and_a_longer_one_is_cut():
    kept, cut = headings(["a" * 200, "b" * 201])
    assert kept.text == "a" * 200
    assert cut.text == "b" * 199 + "…"
