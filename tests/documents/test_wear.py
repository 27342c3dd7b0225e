"""The page of one vehicle's wear, as a page of a fleet."""

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.html import page_of, write_page
from clutchid.documents.results import WornClutch
from clutchid.documents.wear import recordings_table
from clutchid.documents.wear_rows import wear_json, wear_lines
from clutchid.wear.history import WearReading
from fixtures.lives import life, measured, reading


def life_of(shifts, name="r"):
    return life([reading(shift) for shift in shifts], name=name, vehicle="V 1", limit=1e-3)


@pytest.mark.parametrize("shifts", [[0.0, 1e-5, 2e-5], [np.nan, np.nan], [np.nan]])
def test_the_page_of_a_vehicle_leads_back_to_the_fleet_whatever_was_read(shifts, tmp_path):
    clutch = WornClutch(life_of(shifts), home="../the fleet/index.html")
    write_page(document_of(clutch, "c"), tmp_path / "V1.html")
    html = (tmp_path / "V1.html").read_text(encoding="utf-8")
    assert '<a href="../the%20fleet/index.html">Back to the fleet</a>' in html
    assert ("No recording determines the wear." in html) == bool(np.isnan(shifts[0]))
    assert html.count("the load is not determined.") == np.isnan(shifts).sum()


def test_only_the_page_of_a_vehicle_of_a_fleet_says_that_the_forecast_of_the_fleet_is_another():
    life = life_of(1e-5 * np.arange(30))
    alone, of_fleet = (page_of(document_of(WornClutch(life, home=home), "c")) for home in ("", "../index.html"))
    assert "the tables of the fleet also use" in of_fleet
    assert "the tables of the fleet" not in alone


def test_a_page_of_its_own_leads_nowhere(loads_nothing):
    assert loads_nothing(page_of(document_of(WornClutch(life_of([0.0, 1e-5])), "c")))


def test_page_and_object_say_how_often_an_alarm_is_false():
    steady = life_of([0.0, 1e-5])
    assert "gives one false alarm in about 1,000 recordings" in page_of(document_of(WornClutch(steady), "c"))
    assert wear_json(steady)["wear"]["false_alarms"] == 1e-3


def test_only_a_life_with_an_alarm_says_what_its_red_line_means_and_notices_begin_with_a_capital():
    calm, replaced = (
        page_of(document_of(WornClutch(life_of(shifts)), "c"))
        for shifts in ([0.0, 1e-5], [*np.linspace(0.0, 5e-4, 12), *np.linspace(0.0, 1e-4, 6)])
    )
    assert "Red and dashed" not in calm
    assert "Red and dashed" in replaced
    assert "the clutch or its sensor was replaced between r11 and r12" in replaced
    assert "No recording has a time" in calm


def test_a_recording_has_a_message_only_where_something_was_wrong_with_it():
    fine, failed = WearReading("ok", "it ok", "good", measured(0.0)), WearReading("failed", "it failed", "none", None)
    assert recordings_table(life([fine, failed], stride=0)).column("message") == ("", "it failed")


def test_what_is_left_names_the_options_that_are_missing_for_it():
    last = wear_lines(life([reading(0.0)] * 2))[-1]
    assert last == "left        unknown without a limit; give --limit or a table of wear"


def test_a_name_that_is_not_utf_8_is_written_with_question_marks(tmp_path):
    write_page(document_of(WornClutch(life_of([0.0, 1e-5], "r\udcff")), "c"), tmp_path / "x.html")
    assert "r?00" in (tmp_path / "x.html").read_text(encoding="utf-8")


def test_a_recording_that_does_not_count_has_its_reason_on_the_page_and_in_the_object():
    life = life_of([0.0, 1e-5, 5e-4, 2e-5, np.nan, 3e-5, 4e-4])
    assert life.outcomes == ("used", "used", "left out", "used", "used", "left out")
    left_out, last = "the next recordings fit the trend without it", "the next recordings will show"
    expected = ("", "", left_out, "", "", last, "not determined")
    values = recordings_table(life).column("message")
    assert list(values) == [log["reason"] for log in wear_json(life)["logs"].values()]
    for words, shown in zip(expected, values, strict=True):
        assert words in shown
        assert bool(words) == bool(shown)
