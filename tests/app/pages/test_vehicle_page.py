"""The stage "Vehicle and fleet": a fleet that is sorted, filtered and opened, and the trend of a vehicle."""

import polars as pl
import pytest

from clutchid.documents.results import WornClutch
from clutchid.verbs.tracking import write_tracked
from fixtures.results import STEADY, UNREAD, tracked, write_fleet, write_track


@pytest.fixture
def results(page, files):
    """The stage, with the results of a fleet and of a track below the folder."""
    if not (files / "run").exists():
        write_fleet(files / "run")
        (files / "track").mkdir()
        write_track(files / "track")
        pl.DataFrame({"time [s]": [0.0, 1e-3]}).write_parquet(files / "samples.parquet")
    page.click("nav >> text=Vehicle and fleet")
    page.click("#tables-by-path")
    return page


@pytest.fixture
def fleet(results):
    """The table of the fleet."""
    results.click("text=run/")
    results.click("button:text-is('vehicles.parquet')")
    results.locator("#filter").wait_for()
    results.click("#tables-by-path")
    results.locator("footer[hidden]").wait_for(state="attached")
    return results


def names(page):
    return page.locator(".fleet tbody th").all_inner_texts()


def test_a_fleet_is_sorted_filtered_and_leads_to_a_vehicle_and_back(fleet, picture):
    page = fleet
    assert names(page) == ["V 10", "V 2", UNREAD]  # by what is due
    assert page.locator("h3", has_text="Replacements in each month").count() == 1
    assert page.locator("main b").count() == 0
    page.click("#sort-left")
    assert page.locator("th[aria-sort=ascending]").inner_text().startswith("life left")
    assert names(page) == ["V 10", "V 2", UNREAD]
    page.click("#sort-left")
    assert names(page) == ["V 2", "V 10", UNREAD]  # unknown is last in either order
    page.fill("#filter", "REPLACED")
    assert names(page) == ["V 10"]
    page.fill("#filter", "nothing")
    assert "no vehicle matches" in page.locator(".tools").inner_text()
    page.fill("#filter", "")
    page.locator(".row", has_text="V 10").locator("td").first.click()
    page.locator("#trends .uplot").nth(1).wait_for()
    assert "was replaced between V 10 13 and V 10 14" in page.locator(".notice.bad").inner_text()
    page.locator("footer[hidden]").wait_for(state="attached")
    picture(page, "vehicle", full_page=True)
    page.click("#to-fleet")
    assert names(page) == ["V 2", "V 10", UNREAD]  # as it was sorted
    page.click("#vehicle-0")
    said = page.locator(".notice.bad")
    said.wait_for()
    assert "none of its recordings gave a load" in said.inner_text()
    assert page.locator(".item.chosen .dot.bad").count() == 1
    assert "No loads of this vehicle lie beside this file" in page.locator("main").inner_text()


def test_a_vehicle_is_reached_by_keyboard_and_its_loads_are_overlaid(fleet):
    page = fleet
    page.locator("#filter").focus()
    page.keyboard.type("good")
    for _ in range(2):
        page.keyboard.press("Tab")
    for _ in range(20):
        if page.evaluate("document.activeElement.id") == "vehicle-1":
            break
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.locator("#chart-loads .uplot").wait_for()
    assert page.locator("h2").inner_text() == STEADY
    assert "210,000 strokes to 0.5 mm of shift 120,000 to 390,000, 90 %" in page.locator("#left").inner_text()
    assert page.locator("#chart-loads .u-series:not(.edge)").count() == 3  # position, the first, the last
    page.check("[aria-label='Plot the load of V 2 10']")
    assert page.locator("#chart-loads .u-series:not(.edge)").count() == 4
    page.uncheck("[aria-label='Plot the load of V 2 10']")
    page.locator("footer[hidden]").wait_for(state="attached")
    page.uncheck("#forecast")
    assert "orange dashed line" not in page.locator("#trends").inner_text()
    page.click("#theme")
    page.locator("#trends .uplot").nth(1).wait_for()


def test_a_plot_has_the_trend_the_band_and_the_forecast(results):
    page = results
    page.click("text=track/")
    page.click("button:text-is('wear.load.parquet')")  # leads to its rows
    page.locator("#trends .uplot").nth(1).wait_for()
    colours = page.evaluate("""() => {
      const canvas = document.querySelector("#trends canvas");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const near = (wanted) => { let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i + 3] && wanted.every((value, k) => Math.abs(data[i + k] - value) < 12)) count += 1;
        return count; };
      return { trend: near([0, 114, 178]), reading: near([26, 26, 26]), limit: near([230, 159, 0]) };
    }""")  # noqa: E501
    assert all(count > 50 for count in colours.values()), colours


def test_files_of_one_run_are_dropped_together(page, files, tmp_path):
    track = write_track(tmp_path)
    page.click("nav >> text=Vehicle and fleet")
    page.set_input_files("#tables-files", [str(track.with_name("wear.load.parquet")), str(track)])
    page.locator("#chart-loads .uplot").wait_for()
    assert page.locator("[role=listitem]").count() == 1
    page.reload()  # the server keeps it
    page.locator("#chart-loads .uplot").wait_for()
    page.click("text=Forget")
    page.locator(".empty").wait_for()


def test_the_trust_of_a_vehicle_is_that_of_its_last_recording_with_a_load(page, tmp_path):
    life = tracked(STEADY, [0.0, 1e-5, 2e-5, float("nan")])
    write_tracked(WornClutch(life), tmp_path / "wear.parquet")
    page.click("nav >> text=Vehicle and fleet")
    page.set_input_files("#tables-files", str(tmp_path / "wear.parquet"))
    page.locator("#trends .uplot").first.wait_for()
    facts = page.locator(".facts").inner_text()
    assert facts.endswith("2025-01-07 to 2025-01-28 · trust good of V 2 02")
    assert "3 of 4 recordings count" in facts


def test_a_file_that_is_no_result_says_what_is_needed(results):
    results.click("button:text-is('samples.parquet')")
    said = results.locator(".details .notice.bad")
    said.wait_for()
    assert "is no result of `clutchid track` (FILE.parquet of --out) or of `clutchid fleet`" in said.inner_text()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_fleet_and_vehicle_can_be_read_by_everybody_at_every_width(fleet, theme, findings):
    page = fleet
    if theme == "dark":
        page.click("#theme")
    for stage in ("fleet", "vehicle"):
        for width in (1400, 900, 500):
            page.set_viewport_size({"width": width, "height": 950})
            page.wait_for_timeout(300)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, (stage, width)
            assert findings() == [], (stage, width)
        if stage == "fleet":
            page.click("#vehicle-2")
            page.locator("#trends .uplot").nth(1).wait_for()
