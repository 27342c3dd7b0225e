"""The table and the warnings of an inspection."""

import pytest

from clutchid.inspection import Finding, Inspection, inspect


def finding(verdict: str, check: str = "time shift") -> Finding:
    return Finding(check, "+5.0 ms", verdict, f"this one is {verdict}.")


def test_the_table_has_a_line_for_each_check_and_a_sentence_for_each_that_is_not_good():
    seen = Inspection("run", (finding("good"), finding("bad", "sign of position"), finding("not tellable")))
    lines = str(seen).splitlines()
    assert lines[0] == "run: 3 checks, 1 bad, 1 not tellable"
    assert lines[1].split() == ["check", "found", "verdict"]
    assert len({line.index(word) for line, word in zip(lines[2:5], ("good", "bad", "not"), strict=True)}) == 1
    assert lines[5:] == ["", "  - sign of position: this one is bad.", "  - time shift: this one is not tellable."]


def test_a_table_of_good_findings_says_so():
    assert Inspection("run", (finding("good"),)).table().splitlines()[0] == "run: 1 check, all good"


def test_warnings_are_what_is_bad_or_worth_a_look_with_the_name_of_the_recording():
    seen = Inspection("run", tuple(finding(verdict) for verdict in ("good", "look", "not tellable", "bad")))
    assert seen.warnings == ("run: this one is look.", "run: this one is bad.")


def test_the_table_of_a_recording_is_plain_text_in_one_order(recorded):
    seen = inspect(recorded(5))
    assert [f.check for f in seen.findings] == [
        "sample rate", "saturation of position", "saturation of pressure_a", "quantisation of position",
        "quantisation of pressure_a", "stuck position", "stuck pressure_a", "range of position", "sign of position",
        "unit of pressure_a", "time shift", "supply pressure",
    ]  # fmt: skip
    assert seen.table().isascii()
    assert max(map(len, seen.table().splitlines()[:14])) < 100


def test_findings_are_frozen():
    with pytest.raises(AttributeError):
        finding("good").verdict = "bad"
