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

#: Headings by their name, their unit, and the unit in SI.
HEADINGS = {
    ("time", "s", "s"): ["time [s]"],
    ("time", "ms", "s"): ["  TIME[ms] ", "time_ms", "Time (ms)", "timeMs", "time_millisec"],
    ("time", "us", "s"): ["time_us"],
    ("position", "mm", "m"): ["position_mm", "POSITION_MM"],
    ("position", "m", "m"): ["position_m"],
    ("position", "\N{MICRO SIGN}m", "m"): ["position [\N{GREEK SMALL LETTER MU}m]"],
    ("position", None, None): ["position", "position []", "position [mm"],
    ("position", "bar", None): ["position [bar]"],
    ("position", "MM", None): ["position [MM]"],
    ("duty_supply", "%", "1"): ["Duty Supply [%]", "duty_supply_pct", "duty_supply percent"],
    ("pressure_a", "bar", "Pa"): ["pressure_a_bar"],
    ("pressure_a", "bar(g)", "Pa"): [
        "pressure_a   [ bar (g) ]",
        "pressure_a (bar(g))",
        "pressure_a_bar_g",
        "pressure_a_barg",
    ],
    ("pressure_a", "kPa", "Pa"): ["pressure_a_kPa"],
    ("pressure_a", "Pa", "Pa"): ["pressure_a_Pa"],
    ("pressure_a low", "kPa", "Pa"): ["pressure_a low [kPa]"],
    ("pressure_a high", "Pa", "Pa"): ["pressure_a_high [Pa]"],
    ("force", "kN", "N"): ["force_kN"],
    (None, "degC", "K"): ["oil [degC]"],
    (None, None, None): ["force_MN", "time_m", "position_s", "duty_supply_1", "position_max", ""],
}


@pytest.mark.parametrize(("text", "expected"), [(text, key) for key, texts in HEADINGS.items() for text in texts])
def test_a_heading_is_a_name_and_a_unit(text, expected):
    (heading,) = headings([text])
    assert (heading.name, heading.unit, heading.si) == expected


def test_a_unit_that_is_not_given_is_asked_for():
    problems = heading_problems(headings(["time", "position [m]", "duty_supply [1]", "duty_exhaust [1]"]))
    assert problems == [
        "column 1 'time' has no unit in brackets; write time [s] (or another of ms, us, µs, ns, 100ns, min, h, d)."
    ]


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
    whole, cut = headings(["a" * 200, "b" * 201])
    assert whole.text == "a" * 200
    assert cut.text == "b" * 199 + "…"


@pytest.mark.parametrize(
    ("unit", "spellings"),
    [
        ("s", "s sec secs Sekunden seconds"),
        ("ms", "ms msec millisec milliseconds Millisekunden"),
        ("us", "us usec \N{MICRO SIGN}sec microsec microseconds"),
        ("min", "min minutes"),
        ("mm", "mm millimeters millimetre"),
        ("%", "% pct percent Prozent percentage"),
        ("bar(g)", "barg bar(g) bar_g"),
        ("kPa", "kPa kPa_abs kilopascal"),
    ],
)
def test_words_for_units_are_known(unit, spellings):
    assert {unit_spelled(word) for word in spellings.split()} == {unit}


@pytest.mark.parametrize(
    ("texts", "si", "unit"),
    [
        (["ClutchPos_mm", "clutch travel (mm)", "Signals.Clutch.Travel.mm"], "m", "mm"),
        (["uSup_pct", "DutyPct"], "1", "%"),
        (["p_cyl_bar_g", "pCylBarG"], "Pa", "bar(g)"),
        (["p_kpa"], "Pa", "kPa"),
        (["PressurekPa", "pAtmBar"], "Pa", None),
        (["pos_V", "mm"], "m", None),
        (["valve_1"], "1", None),
    ],
)
def test_a_unit_at_the_end_of_a_name_is_found(texts, si, unit):
    assert {unit_at_end(text, si) for text in texts} == {unit}
