"""A newcomer's way: from a file with German names to the load of a worn clutch, and to the control unit."""

#: Colours of a chart of loads near its upper edge, at positions in mm.
AT_MILLIMETRES = """(chart, positions) => positions.map((x) => {
  const [canvas, over] = [chart.querySelector("canvas"), chart.querySelector(".u-over")];
  const left = over.offsetLeft + over.clientWidth * x / 24.7;
  return canvas.getContext("2d").getImageData(left, over.offsetTop + 3, 1, 1).data.slice(0, 3).join();
})"""


def test_from_a_german_file_to_what_has_changed_and_an_export(page, opened, files, picture):
    opened("Messung.mf4")
    assert "the gauge unit [bar(g)] is guessed" in page.locator(".notice.care").inner_text()
    page.click("#apply")
    page.locator("text=map.toml").wait_for()
    page.locator("#item-recording-1 .dot.good").wait_for()
    page.locator("footer[hidden]").wait_for(state="attached")
    picture(page, "recording")

    opened("worn.csv", 2)
    page.click("text=Load")
    assert page.locator("#run-estimate").is_disabled()
    assert "Choose a calibration" in page.locator(".card", has_text="Estimate").inner_text()
    page.click("#run-calibrate")
    page.locator(".summary dd.good").first.wait_for()
    assert page.locator("#chart-load .uplot").count() == 1
    page.locator("text=Report (page)").wait_for()

    page.click("#run-estimate")
    page.locator("#chart-change .uplot").wait_for()
    page.locator("text=Report (page)").wait_for()
    assert "half-load position" in page.locator(".summary").inner_text()
    for chart in ("load", "change"):  # the answer is on the first screen
        assert page.locator(f"#chart-{chart} .u-over").bounding_box()["y"] < 700.0
    assert page.locator("#chart-load").evaluate(AT_MILLIMETRES, [4.5, 6.5]) == ["0,0,0", "253,243,215"]  # shaded
    legends = page.locator(".strips .u-legend").all_inner_texts()
    assert legends[0].find("simulated") < legends[0].find("measured")  # which is drawn over it
    page.set_viewport_size({"width": 500, "height": 950})
    assert page.locator(".forms").bounding_box()["y"] < page.locator(".results").bounding_box()["y"]
    assert page.locator(".summary .fixed").evaluate("cell => cell.scrollWidth <= cell.clientWidth")
    page.set_viewport_size({"width": 1400, "height": 950})
    assert page.locator("table.board tr").count() == 2
    page.locator("footer[hidden]").wait_for(state="attached")
    picture(page, "load", full_page=True)

    page.click("#open-result-3")
    page.click("#export")
    page.locator("text=the C agrees with Python").wait_for()
    with page.expect_download() as download:
        page.click("text=Export (ZIP)")
    assert download.value.suggested_filename == "calibrate Messung.mf4 (3).zip"
    page.click("text=Repeat it on the command line")
    assert "clutchid calibrate Messung.mf4 --map Messung.mf4.map.toml" in page.locator("pre").first.inner_text()

    page.click("nav >> text=Recording")
    page.click("text=Forget this recording")
    opened("Verschleiss.mf4", 5)
    page.click("text=Use the map of calibrate Messung.mf4 (3)")
    page.locator("text=map.toml").wait_for()


def test_a_calibrated_curve_takes_three_clicks_and_its_report_is_opened_beside_the_page(page, opened):
    opened("cal.csv")  # the choice of a file is one
    page.click("text=Load")
    page.click("#run-calibrate")
    page.reload()  # the page is told of it anew, before the calibration has ended
    page.locator("text=Report (page)").wait_for()
    assert page.locator("#chart-load .uplot").count() == 1
    assert page.locator("#fit-estimate-recording-1").count() == 1
    assert not page.locator("#fit-estimate-recording-1").is_checked()
    page.click("#next")
    assert page.locator("#estimate").evaluate("card => card.getBoundingClientRect().top < innerHeight")
    with page.context.expect_page() as other:
        page.click("text=Report (page)")
    other.value.locator("h1").first.wait_for()
    assert "cal" in other.value.locator("body").inner_text()
