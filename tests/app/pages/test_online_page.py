"""The stage "On line": a recording played through an observer."""


def test_a_recording_is_played_paused_and_stepped_by_strokes(page, opened, picture):
    opened("cal.csv")
    opened("worn.csv", 2)
    page.click("text=Load")
    page.click("#run-calibrate")
    page.locator("text=Report (page)").wait_for()
    page.click("text=On line")
    assert page.locator("#observe-recording").input_value() == "recording-2"
    page.click("#run-observe")
    page.locator("#chart-online .uplot").wait_for()
    page.locator(".strips[data-shown]").wait_for()
    assert page.locator(".strips .uplot").count() == 4
    assert "After stroke" in page.locator("#stroke").inner_text()

    page.click("#theme")
    dark = page.evaluate("getComputedStyle(document.body).color")  # of the load before the first sample, as the texts
    marks = page.locator("#chart-online .u-series:not(.edge) .u-marker")
    assert marks.nth(1).evaluate("mark => getComputedStyle(mark).borderTopColor") == dark
    page.click("#theme")

    page.locator("#time").fill("0")
    assert page.locator("#stroke").inner_text() == "Before the end of the first stroke."
    page.click("#step")
    assert page.locator("#stroke").inner_text().startswith("After stroke 1,")
    page.locator("footer[hidden]").wait_for(state="attached")
    picture(page, "online")

    page.locator("#time").fill("0")
    page.click("#play")
    page.locator("#play", has_text="Pause").wait_for()
    page.click("#play")
    page.locator("#play", has_text="Play").wait_for()
    paused = page.locator(".time").inner_text()
    page.wait_for_timeout(300)
    assert page.locator(".time").inner_text() == paused
    assert 0.0 < float(paused.split()[0]) < 10.0
    page.select_option("#speed", "inf")
    page.click("#play")
    assert page.locator(".time").inner_text().startswith("10.00") or page.locator(".time").inner_text().startswith(
        "9.99"
    )
    page.click("#next")
    page.locator("#export").wait_for()
    assert page.locator(".answer h2").inner_text() == "calibrate cal.csv (3)"
