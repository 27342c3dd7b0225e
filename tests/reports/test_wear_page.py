"""The page of one vehicle's wear, as a page of a fleet."""

import numpy as np
import pytest

from clutchid.estimation.assess.comparison import Measurement
from clutchid.reports.html import render
from clutchid.reports.wear_page import page_of, recordings_table, wear_page
from clutchid.reports.wear_text import wear_json, wear_lines
from clutchid.wear.history import Listed, WearReading, arranged
from clutchid.wear.life import wear_of


def life_of(shifts, name="r"):
    names = [f"{name}{k}" for k in range(len(shifts))]
    listed = {name: Listed(name, strokes=1e4 * k) for k, name in enumerate(names)}
    readings = [
        WearReading("failed", "the load is not determined.", "", None)
        if np.isnan(shift)
        else WearReading("ok", "", "good", Measurement(shift, 3e-5, 0.0, 0.01, np.nan))
        for shift in shifts
    ]
    return wear_of("V 1", arranged(names, [""] * len(names), listed), readings, None, 1e-3)


@pytest.mark.parametrize("shifts", [[0.0, 1e-5, 2e-5], [np.nan, np.nan], [np.nan]])
def test_the_page_of_a_vehicle_leads_back_to_the_fleet_whatever_was_read(shifts, tmp_path):
    wear_page(life_of(shifts), [], "c", tmp_path / "V1.html", home="../the fleet/index.html")
    html = (tmp_path / "V1.html").read_text(encoding="utf-8")
    assert '<a href="../the%20fleet/index.html">Back to the fleet</a>' in html
    assert ("No recording determines the wear." in html) == bool(np.isnan(shifts[0]))
    assert html.count("the load is not determined.") == np.isnan(shifts).sum()


def test_a_page_of_its_own_leads_nowhere(loads_nothing):
    assert loads_nothing(render(page_of(life_of([0.0, 1e-5]), [], "c")))


def test_page_and_object_say_how_often_an_alarm_is_false():
    life = life_of([0.0, 1e-5])
    assert "set to one false alarm in 1,000 recordings" in render(page_of(life, [], "c"))
    assert wear_json(life)["wear"]["false_alarms"] == 1e-3


def test_only_a_life_with_an_alarm_says_what_its_red_line_means_and_notices_begin_with_a_capital():
    calm, replaced = (
        render(page_of(life_of(shifts), [], "c"))
        for shifts in ([0.0, 1e-5], [*np.linspace(0.0, 5e-4, 12), *np.linspace(0.0, 1e-4, 6)])
    )
    assert "Red and dashed" not in calm
    assert "Red and dashed" in replaced
    assert "The clutch, or its sensor, was replaced between r11 and r12" in replaced
    assert "No recording has a time" in calm


def test_a_recording_has_a_message_only_where_something_was_wrong_with_it():
    measurement = Measurement(0.0, 3e-5, 0.0, 0.01, np.nan)
    fine, failed = WearReading("ok", "it ok", "good", measurement), WearReading("failed", "it failed", "none", None)
    life = wear_of("V", arranged(["a", "b"], ["", ""], {}), [fine, failed], None, 1e-3)
    assert recordings_table(life).column("message") == ("", "it failed")


def test_what_is_left_names_the_options_that_are_missing_for_it():
    listed = {name: Listed(name, strokes=1e4 * k) for k, name in enumerate("ab")}
    readings = [WearReading("ok", "", "good", Measurement(0.0, 3e-5, 0.0, 0.01, np.nan))] * 2
    last = wear_lines(wear_of("V", arranged(["a", "b"], ["", ""], listed), readings, None, None))[-1]
    assert last == "left        not known without a limit: --limit, or a table of wear"


def test_a_name_that_is_not_utf_8_is_written_with_question_marks(tmp_path):
    wear_page(life_of([0.0, 1e-5], "r\udcff"), [], "c", tmp_path / "x.html")
    assert "r?0" in (tmp_path / "x.html").read_text(encoding="utf-8")


def test_a_recording_that_does_not_count_has_its_reason_on_the_page_and_in_the_object():
    life = life_of([0.0, 1e-5, 5e-4, 2e-5, np.nan, 3e-5, 4e-4])
    assert life.outcomes == ("used", "used", "left out", "used", "missing", "used", "left out")
    left_out, last = "the next recording fits the trend without it", "the next recording will say"
    expected = ("", "", left_out, "", "not determined", "", last)
    found = recordings_table(life).column("message")
    of_object = [log["reason"] for log in wear_json(life)["logs"].values()]
    for words, shown, reason in zip(expected, found, of_object, strict=True):
        assert words in shown
        assert bool(words) == bool(shown)
        assert shown == reason
