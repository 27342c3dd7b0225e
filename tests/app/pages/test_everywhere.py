"""All stages in both themes and at three widths, without findings of axe-core; jobs; without JavaScript."""

import pytest


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_stages_can_be_read_by_everybody_at_every_width(page, opened, theme, findings):
    page.emulate_media(color_scheme=theme)
    page.reload()
    opened("cal.csv")
    page.click("text=Load")
    page.click("#run-calibrate")
    page.locator("text=Report (page)").wait_for()
    page.click("text=On line")
    page.click("#run-observe")
    page.locator("#chart-online .uplot").wait_for()
    for stage in ("online", "recording", "load"):
        page.click(f"nav a[href='#{stage}']")
        page.locator(".uplot").first.wait_for()
        for width in (1400, 900, 500):
            page.set_viewport_size({"width": width, "height": 950})
            page.wait_for_timeout(300)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, (stage, width)
        page.set_viewport_size({"width": 1400, "height": 950})
        assert findings() == [], stage


def test_the_theme_is_kept_and_the_first_tab_skips_to_the_content(page):
    page.click("#theme")
    assert page.locator("html").get_attribute("data-theme") == "dark"
    page.reload()
    page.locator("html[data-theme=dark]").wait_for()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"


def test_a_fit_is_cancelled_in_the_bar(page, opened):
    opened("cal.csv")
    page.click("text=Load")
    page.click("#run-calibrate")
    page.locator("footer progress[value]").wait_for()
    assert "calibrate cal.csv" in page.locator("footer").inner_text()
    page.click("footer button:has-text('Cancel')")
    page.locator(".board .badge", has_text="stopped").wait_for()
    page.locator("footer[hidden]").wait_for(state="attached")


def test_an_option_that_is_refused_is_said_at_its_form(page, opened):
    opened("cal.csv")
    page.click("text=Load")
    card = page.locator(".card", has_text="Once, from a recording")
    card.locator("summary").click()
    page.fill("#calibrate-prior", "C_vs")
    page.keyboard.press("Tab")
    page.click("#run-calibrate")
    card.locator(".notice.bad").wait_for()
    assert "--prior C_vs: write NAME=VALUE±STD in SI units" in card.inner_text()


def test_a_browser_without_javascript_is_told(browser, server):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(server)
    assert "needs JavaScript" in page.content()
    context.close()


def test_a_fit_that_fails_shows_its_sentence_in_place_of_the_result(page, opened):
    opened("cal.csv")
    page.click("text=Load")
    page.locator(".card", has_text="Once, from a recording").locator("summary").click()
    page.fill("#calibrate-measure", "position")
    page.keyboard.press("Tab")
    page.click("#run-calibrate")
    said = page.locator(".results .details .notice.bad")
    said.wait_for()
    assert "'auto' needs a recording with pressure" in said.inner_text()
    assert "failed" in page.locator(".board").inner_text()
