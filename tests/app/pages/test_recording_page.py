"""The stage "Recording": strips, cursors, channels, checks, and what is refused."""

import pytest


def shown(page):
    """The times between which the strips are shown, in s."""
    begin, end = page.locator(".strips").get_attribute("data-shown").split()
    return float(begin), float(end)


def readout(page, label):
    """The values at A and B, and their difference."""
    cells = page.locator(".readout tr", has_text=label).first.locator("td").all_inner_texts()
    return [float(cell.replace("–", "nan").replace("−", "-")) for cell in cells]


@pytest.fixture
def strips(page, opened):
    opened("Messung.mf4")
    page.locator(".strips[data-shown]").wait_for()
    return page.locator(".strips")


def test_a_drag_zooms_all_strips_and_a_double_click_shows_all(page, strips):
    assert page.locator(".strips .uplot").count() == 3
    area = page.locator(".strips .u-over").first
    box = area.bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60, steps=5)
    page.mouse.up()
    page.locator('.strips:not([data-shown="0 9.999"])').wait_for()
    assert shown(page) == pytest.approx((4.0, 6.0), abs=0.1)
    area.dblclick()
    page.locator('.strips[data-shown="0 9.999"]').wait_for()


def test_the_keyboard_zooms_to_single_samples(page, strips):
    strips.focus()
    for _ in range(10):
        page.keyboard.press("+")
    page.wait_for_timeout(500)
    begin, end = shown(page)
    assert end - begin < 0.02
    page.keyboard.press("0")
    page.locator('.strips[data-shown="0 9.999"]').wait_for()


def test_cursors_have_values_and_a_sign_is_seen_at_once(page, strips):
    box = page.locator(".strips .u-over").first.bounding_box()
    page.mouse.click(box["x"] + 0.06 * box["width"], box["y"] + 40)
    page.keyboard.down("Shift")
    page.mouse.click(box["x"] + 0.01 * box["width"], box["y"] + 40)
    page.keyboard.up("Shift")
    a, b, difference = readout(page, "position")
    assert a > 20.0 > abs(b)
    assert difference == pytest.approx(b - a, abs=0.01)
    page.click("[aria-label^='Sign of Kupplungsweg_Ist']")
    page.keyboard.press("Escape")
    page.locator(".strips[data-shown]").wait_for()
    assert page.locator("#apply").inner_text() == "Apply the map and check"
    page.click("#apply")
    bad = page.locator(".checks tr", has_text="sign of position")
    bad.locator(".badge.bad").wait_for()
    assert "sign" in bad.locator(".sentence").inner_text()


def test_a_channel_of_another_time_grid_is_plotted_beside_the_others(page, strips):
    page.fill("#search", "motor")
    assert page.locator("tbody .channel").count() == 1
    page.check("[aria-label='Plot Motortemperatur']")
    page.locator(".strips .uplot").nth(3).wait_for()
    assert page.locator(".strips .uplot").count() == 4
    page.locator(".strips[data-shown]").focus()
    page.keyboard.press("a")
    assert 50.0 <= readout(page, "Motortemperatur [°C]")[0] <= 90.0


def test_strips_show_the_channels_of_the_map_as_it_is_changed(page, strips):
    page.select_option("[aria-label='Quantity of Druck_Zylinder']", "")
    page.locator(".strips .uplot").nth(2).wait_for(state="detached")
    assert page.locator(".strips .uplot").count() == 2
    page.check("[aria-label='Plot Druck_Zylinder']")  # as it is, without a quantity
    page.locator(".strips .uplot").nth(2).wait_for()
    page.select_option("[aria-label='Quantity of Tastverhältnis_Belüftung']", "")
    drawn = page.locator(".u-legend", has_text="duty_exhaust (Tastverhältnis_Entlüftung)")
    assert "Tastverhältnis_Belüftung" in drawn.inner_text()  # a candidate of what the map lacks


def test_the_map_of_another_recording_is_used_and_what_only_that_one_has_can_be_removed(page, opened, strips):
    page.click("#apply")
    page.locator("text=map.toml").wait_for()
    opened("Verschleiss.mf4", 2)
    page.select_option("#map-of", label="Messung.mf4")
    absent = page.locator("tr.absent")
    absent.wait_for()
    assert "Druck_Zylinder not in this recording" in absent.inner_text()
    page.click("nav >> text=Load")
    row = page.locator(".choose tr", has_text="Verschleiss.mf4").first
    assert "position only" in row.inner_text()
    page.click("nav >> text=Recording")
    page.click("#item-recording-2")
    page.click("[aria-label='Remove pressure_a from the map']")
    page.click("#apply")
    page.locator("#apply", has_text="Keep this map and check").wait_for()
    assert absent.count() == 0


def test_sign_and_factor_are_beside_each_other_on_a_narrow_page(page, strips):
    page.set_viewport_size({"width": 500, "height": 950})
    table = page.locator("[aria-label='Table of channels']")
    assert table.evaluate("table => table.scrollWidth <= table.clientWidth")
    assert page.locator("#sign-1").is_visible()


def test_a_file_that_cannot_be_used_has_the_sentence_of_the_command_line(page, files):
    page.set_input_files("#files", str(files / "broken.csv"))
    said = page.locator(".details .notice.bad")
    said.wait_for()
    text = said.inner_text()
    assert text.startswith("no columns 'duty_supply' (write duty_supply [1])")
    assert "line 3 has 'x'; write a number" in text


def test_a_map_that_is_refused_says_so_at_the_table(page, strips):
    page.fill("[aria-label='Delay of Kupplungsweg_Ist in s']", "3")
    page.keyboard.press("Tab")
    page.click("#apply")
    assert "a delay of at most 0.5 s is needed" in page.locator(".notice.bad").inner_text()


def test_a_file_is_opened_by_its_path_without_an_upload(page):
    page.click("#by-path")
    page.click("text=worn.csv")
    page.locator("#item-recording-1 .dot.good").wait_for()
    assert page.locator(".upload").count() == 0


def test_markup_in_names_is_text(page, opened):
    opened("<b>bold<b>.csv")
    page.locator(".channel", has_text="<img src=x onerror=alert(1)>").wait_for()
    assert page.locator("main img, main b").count() == 0


def test_a_second_tab_shows_the_same_a_reload_loses_nothing_and_what_is_forgotten_is_gone(page, opened):
    opened("worn.csv")
    other = page.context.new_page()
    other.goto(page.url)
    other.locator("#item-recording-1 .dot.good").wait_for()
    page.reload()
    page.locator("#item-recording-1 .dot.good").wait_for()
    page.click("#item-recording-1")
    page.click("text=Forget this recording")
    other.locator("#item-recording-1").wait_for(state="detached")


def test_a_range_of_time_is_cut_out_as_a_recording_of_its_own(page, opened):
    opened("cal.csv")
    page.locator(".strips[data-shown]").wait_for()
    page.click("[aria-label='Zoom in']")
    page.locator('.strips:not([data-shown="0 4.999"])').wait_for()
    page.click("text=Cut out this range")
    page.locator("#item-recording-2 .dot:is(.good, .suspect)").wait_for()
    assert page.locator(".details h2").inner_text() == "cal-cut.parquet"
