"""The table of strokes and rests: what the parts of one rest say together."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.strokes import Section, SectionSummary, sections_of, sections_table


def rest(first: int, n: int, label: str = "vented rest", **values: float) -> Section:
    """A part of a rest at 1 kHz, from a sample on."""
    t = np.arange(first, first + n) * 1e-3
    numbers = {"lowest": 0.0, "highest": 0.0, "level": 0.0, "vented_rest": 0.0, "missing": 0.0} | values
    excitation = SectionSummary(reach=0.02, opening_speed=0.0, closing_speed=0.0, supply_pulses=0, exhaust_pulses=0,
                            duty_steps=0, pressure=False, **numbers)  # fmt: skip
    log = Log(t, {"position": np.zeros(n)})
    return Section("rest", label, log, float(t[0]), float(t[-1]), float(t[0]), first, excitation)


def cells(*sections: Section) -> list[list[str]]:
    """The lines of the table below its head, without the words of the label."""
    return [line.replace("vented rest", "vented").split() for line in sections_table(sections).splitlines()[1:]]


def test_the_parts_of_a_rest_are_one_line_with_their_extremes_and_their_mean_share_of_missing_samples():
    low = rest(0, 3000, lowest=-1e-4, highest=1e-4, missing=0.5, vented_rest=2.999)
    high = rest(3000, 1000, lowest=-5e-5, highest=3e-4, missing=0.1, vented_rest=3.999)
    ((number, _, _, start, length, *others),) = cells(low, high)
    assert (number, start, length, others[:2]) == ("1-2", "0.000", "3.999", ["-0.10", "0.30"])
    # 3000 samples with half of them missing, 1000 with a tenth
    assert others[-2:] == ["40.0", "%"]


def test_extremes_count_from_whichever_part_has_them():
    first, other = rest(0, 1000, lowest=-2e-4, highest=5e-4), rest(1000, 1000, lowest=-1e-4, highest=1e-4)
    turned = replace(other, first=0, log=first.log), replace(first, first=1000, log=other.log)
    for parts in ((first, other), turned):
        ((*_, low, high, _, _, _, _, _),) = cells(*parts)
        assert (low, high) == ("-0.20", "0.50")


@pytest.mark.parametrize(("label", "vented", "shown"), [("vented rest", 0.999, "1.999"), ("held", 0.0, "0.00")])
def test_parts_are_vented_as_long_as_they_last_together_but_not_where_they_are_held(label, vented, shown):
    ((*_, seconds, _, _),) = cells(
        rest(0, 1000, label, vented_rest=vented), rest(1000, 1000, label, vented_rest=vented)
    )
    assert float(seconds) == pytest.approx(float(shown), abs=0.005)


def test_rests_that_do_not_touch_or_have_another_label_are_lines_of_their_own():
    first = rest(0, 1000)
    for other in (rest(1001, 1000), rest(1000, 1000, "held")):
        assert [row[0] for row in cells(first, other)] == ["1", "2"]


def test_the_table_says_a_dash_where_nothing_is_known():
    log = Log(np.arange(100) * 1e-3, {"position": np.full(100, np.nan)})
    table = sections_table(sections_of(log)).splitlines()
    assert all(word in table[1] for word in ("no position", "100.0 %", " - "))
    assert all(line == line.rstrip() for line in table)
