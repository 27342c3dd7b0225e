"""What was ticked, chosen and written stays so when the page is loaded again, and a further tab chooses nothing."""

import pytest

BOXES = """() => Object.fromEntries([...document.querySelectorAll("section.card :is(input, select)")].map(
  (box) => [box.id, box.type === "checkbox" ? box.checked : box.value]))"""


def ticked(page):
    """Boxes that are ticked under a stage, without those that only show something."""
    return [name for name, value in page.evaluate(BOXES).items() if value is True]


def shown(page, stage, ready):
    """The boxes of a stage, once the recordings and results are there."""
    page.click(f"nav >> text={stage}")
    page.locator(ready).wait_for(state="attached")
    page.locator("footer[hidden]").wait_for(state="attached")
    return page.evaluate(BOXES)


@pytest.fixture
def calibrated(page, opened):
    """Recordings of a clutch, of its wear, and of another vehicle, and a calibration of the first."""
    for number, name in enumerate(("cal.csv", "worn.csv", "cal.csv"), 1):
        opened(name, number)
    page.click("nav >> text=Load")
    page.click("#run-calibrate")
    page.locator("text=Report (page)").wait_for()
    return page


def test_a_reload_leaves_boxes_and_options_as_they_were_and_a_further_tab_chooses_nothing(calibrated, opened):
    page = calibrated
    page.uncheck("#fit-estimate-recording-2")
    page.check("#verify-estimate-recording-3")
    page.click("#estimate summary")
    page.fill("#estimate-prior", "P_S=8.5e5±5e3")
    page.keyboard.press("Tab")
    page.select_option("#estimate-zero", "keep")
    before = shown(page, "Load", "#start option:nth-child(2)")
    assert before["start"] == "result-4"
    page.reload()
    assert shown(page, "Load", "#start option:nth-child(2)") == before
    assert page.locator(
        "#run-estimate"
    ).is_disabled()  # it had the recording of the other vehicle, with the calibration
    assert page.locator("#estimate-prior").is_visible()

    chosen = shown(page, "On line", "#observe-start option:nth-child(2)")
    assert chosen["observe-recording"] == "recording-2"
    page.select_option("#observe-recording", "recording-1")
    page.select_option("#observe-method", "states")
    chosen = page.evaluate(BOXES)
    page.reload()
    assert shown(page, "On line", "#observe-start option:nth-child(2)") == chosen

    further = page.context.new_page()
    further.goto(page.url.partition("#")[0])
    shown(further, "Load", "#start option:nth-child(2)")
    assert ticked(further) == []
    assert shown(further, "On line", "#observe-start option:nth-child(2)")["observe-recording"] == ""
    further.close()

    page.click("nav >> text=Recording")
    opened("worn.csv", 5)
    page.click("nav >> text=Load")
    assert page.locator("#fit-estimate-recording-5").is_checked(), "what is new is offered as before"


def test_a_recording_that_is_forgotten_is_ticked_nowhere_after_a_reload(page, opened):
    opened("worn.csv")
    page.click("nav >> text=Load")
    assert ticked(page) == ["fit-estimate-recording-1"]
    page.click("nav >> text=Recording")
    page.click("text=Forget this recording")
    page.locator("#item-recording-1").wait_for(state="detached")
    page.reload()
    opened("cal.csv", 2)
    page.click("nav >> text=Load")
    assert page.locator("#fit-estimate li").count() == 0
    assert ticked(page) == ["fit-calibrate-recording-2"]


def test_a_map_that_was_edited_and_not_applied_is_there_after_a_reload(page, opened):
    opened("worn.csv")
    page.click("#sign-1")
    page.locator("#apply", has_text="Apply the map and check").wait_for()
    page.reload()
    page.locator("#apply", has_text="Apply the map and check").wait_for()
    assert page.locator("#sign-1").inner_text() == "−"


def test_the_shown_recording_and_its_boxes_are_as_they_were_after_a_reload(page, opened):
    opened("cal.csv")
    opened("worn.csv", 2)
    page.click("#item-recording-1")
    page.uncheck("[aria-label='Plot pressure_a [Pa]']")
    page.reload()
    page.locator("#item-recording-1.chosen").wait_for()
    assert not page.locator("[aria-label='Plot pressure_a [Pa]']").is_checked()
    assert page.locator(".details h2").inner_text() == "cal.csv"
