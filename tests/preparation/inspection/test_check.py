"""The table and the warnings of an inspection."""

from clutchid.preparation.inspection import Check, Inspection, inspect


def result(grade: str, name: str = "time shift") -> Check:
    return Check(name, "+5.0 ms", grade, f"this one is {grade}.")


def test_the_table_has_a_line_for_each_check_and_a_sentence_for_each_that_is_not_good():
    seen = Inspection("run", (result("good"), result("bad", "sign of position"), result("undetermined")))
    lines = str(seen).splitlines()
    assert lines[0] == "run: 3 checks, 1 bad, 1 undetermined"
    assert lines[1].split() == ["check", "result", "grade"]
    assert len({line.index(word) for line, word in zip(lines[2:5], ("good", "bad", "undetermined"), strict=True)}) == 1
    assert lines[5:] == ["", "  - sign of position: this one is bad.", "  - time shift: this one is undetermined."]


def test_a_table_of_good_checks_says_so():
    assert Inspection("run", (result("good"),)).table().splitlines()[0] == "run: 1 check, all good"


def test_warnings_are_what_is_bad_or_suspect_with_the_name_of_the_recording():
    seen = Inspection("run", tuple(result(grade) for grade in ("good", "suspect", "undetermined", "bad")))
    assert seen.warnings == ("run: this one is suspect.", "run: this one is bad.")


def test_the_table_of_a_recording_is_plain_text_in_one_order(recorded):
    seen = inspect(recorded(5))
    assert [f.name for f in seen.checks] == [
        "sample rate", "saturation of position", "saturation of pressure_a", "quantisation of position",
        "quantisation of pressure_a", "stuck position", "stuck pressure_a", "motion", "range of position",
        "sign of position", "unit of pressure_a", "vented pressure", "time shift", "supply pressure",
    ]  # fmt: skip
    assert seen.table().isascii()
    assert max(map(len, seen.table().splitlines()[:14])) < 100
