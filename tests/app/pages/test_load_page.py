"""The stage "Load": recordings and files are dropped on what they are for, or chosen by keyboard."""

import json
from dataclasses import replace

import pytest

from clutchid.app.records import Result, content

DROP = """(target, name) => {
  const files = new DataTransfer();
  files.items.add(new File([window.dropped], name));
  target.dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
}"""


def test_a_recording_is_dragged_to_verify_and_back_and_the_ticks_follow(page, opened):
    opened("cal.csv")
    opened("worn.csv", 2)
    page.click("nav >> text=Load")
    assert "cal.csv" in page.locator("#fit-calibrate").inner_text()
    row = page.locator(".card[aria-label=Calibrate] .choose tbody tr", has_text="worn.csv").locator("th")
    row.drag_to(page.locator("#verify-calibrate"))
    page.locator("#verify-calibrate li", has_text="worn.csv").wait_for()
    assert page.locator("#verify-calibrate-recording-2").is_checked()
    page.locator("#verify-calibrate li").drag_to(page.locator("#fit-calibrate"))
    page.locator("#fit-calibrate li", has_text="worn.csv").wait_for()
    assert not page.locator("#verify-calibrate-recording-2").is_checked()
    page.locator("#fit-calibrate-recording-2-away").focus()
    page.keyboard.press("Enter")
    assert not page.locator("#fit-calibrate-recording-2").is_checked()
    page.locator("#verify-calibrate-recording-2").focus()
    page.keyboard.press("Space")
    page.locator("#verify-calibrate li", has_text="worn.csv").wait_for()
    assert page.locator("#run-calibrate").is_enabled()


def test_free_parameters_and_bounds_are_chosen_from_a_list_by_keyboard(page, opened, findings):
    opened("cal.csv")
    page.click("nav >> text=Load")
    page.click("#calibrate summary")
    page.locator("#calibrate-choose").focus()
    page.keyboard.press("Enter")
    page.locator("#free-P_S").wait_for()
    assert page.locator("#free-P_S").is_disabled()  # it is free with all others
    page.locator("#free-auto").focus()
    page.keyboard.press("Space")
    page.locator("#free-theta_1").wait_for()
    page.locator("#free-search").focus()
    page.keyboard.type("supply PRESSURE")
    assert page.locator("dialog tbody tr:not([hidden])").count() == 1
    page.locator("#free-P_S").focus()
    page.keyboard.press("Space")
    page.locator("#low-P_S:enabled").wait_for()
    for key in ("Tab", "9e5", "Tab", "8e5", "Tab"):
        page.keyboard.press(key) if key == "Tab" else page.keyboard.type(key)
    page.locator("dialog .notice.bad").wait_for()
    assert page.locator("dialog .notice").inner_text() == "P_S: lower bound 900000 is not below upper bound 800000."
    for width in (1400, 500):
        page.set_viewport_size({"width": width, "height": 950})
        assert page.locator("dialog").evaluate("dialog => dialog.scrollWidth <= dialog.clientWidth")
        assert findings() == [], width
    page.fill("#low-P_S", "7e5")
    page.keyboard.press("Tab")
    page.locator("dialog .notice").wait_for(state="detached")
    page.keyboard.press("Escape")
    assert page.locator("#calibrate-free").input_value() == "load,P_S"
    page.click("#run-calibrate")
    page.locator(".answer h2").wait_for()
    assert page.locator(".board tr").count() == 1
    page.click("footer button:has-text('Cancel')")


def test_a_range_that_is_dragged_is_fitted_in_place_of_its_recording(page, opened):
    opened("cal.csv")
    page.locator(".strips[data-shown]").wait_for()
    for end in (0.8, 0.9):
        assert page.locator("text=Fit this range").is_hidden()
        box = page.locator(".strips .u-over").first.bounding_box()
        page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 40)
        page.mouse.down()
        page.mouse.move(box["x"] + end * box["width"], box["y"] + 60, steps=5)
        page.mouse.up()
        page.click("text=Fit this range")
        page.locator("#fit-calibrate li").wait_for()
        assert page.locator("#fit-calibrate li span").all_inner_texts() == ["cal-cut.parquet"]
        assert page.locator("#fit-estimate li").count() == 0
        page.locator("#run-calibrate:enabled").wait_for()
        page.click("nav >> text=Recording")
        page.click("#item-recording-1")


@pytest.mark.parametrize("name", ["broken.csv", "broken.mf4"])
def test_a_file_that_cannot_be_read_is_said_to_be_one_and_is_offered_nowhere(page, files, name):
    page.set_input_files("#files", str(files / name))
    page.locator("#item-recording-1 .dot.bad").wait_for()
    page.locator(".details .notice.bad").wait_for()
    assert page.locator("#apply, .details .notice.care, [aria-label=Checks]").count() == 0
    assert page.locator("[aria-label=Channels]").count() == (name == "broken.csv")
    page.click("nav >> text=Load")
    assert "Open a recording first" in page.locator("#calibrate").inner_text()
    assert page.locator(".choose").count() == 0
    page.click("nav >> text=On line")
    assert page.locator("#observe-recording option").all_inner_texts() == ["–"]


def test_changes_are_said_in_the_words_of_the_command_line(page):
    change = {
        "recording": "worn",
        "name": "P_S",
        "before": 9e5,
        "after": 8e5,
        "std": 1e3,
        "unit": "Pa",
        "probability": 1,
    }
    note = "worn: supply pressure changed since the calibration (over 99 %): P_S 9e+05 -> 8e+05 Pa."
    shown = {"changes": [change], "notes": [note], "recordings": [], "parameters": {}, "files": [], "trust": "good"}
    result = replace(Result("result-1", "estimate", "estimate worn.csv"), status="done", found=shown)
    event = json.dumps({"kind": "result", "id": result.id, "content": content(result)})
    page.route(
        "**/api/events", lambda route: route.fulfill(content_type="text/event-stream", body=f"data: {event}\n\n")
    )
    page.goto(page.url + "#load")
    page.reload()
    page.click("text=1 note")
    assert note in page.locator(".results").inner_text()
    assert "100 %" not in page.locator(".results").inner_text()


def test_a_file_is_dropped_on_what_it_is_for(page, opened, files):
    opened("cal.csv")
    page.click("nav >> text=Load")
    page.evaluate("text => { window.dropped = text; }", (files / "worn.csv").read_text())
    page.locator("#verify-calibrate").evaluate(DROP, "other.csv")
    page.locator("#verify-calibrate li", has_text="other.csv").wait_for()
    page.locator(".choose", has_text="position only").first.wait_for()
    assert page.locator("#fit-estimate li").count() == 0  # it was said what it is for
    assert page.url.endswith("#load")
