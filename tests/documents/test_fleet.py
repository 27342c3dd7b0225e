"""The page of a fleet: what is on it, in which order, and that foreign names do no harm."""

import json
import re
import subprocess
from base64 import b64encode
from datetime import UTC, datetime
from hashlib import sha256
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.fleet_tables import (
    SHOWN_ALARMS,
    ReasonCount,
    ReplacementRow,
    VehicleRow,
    alarms_table,
    all_table,
    due_table,
    quantiles,
    reasons_table,
    spans_of,
    tag_tables,
)
from clutchid.documents.html import PART, page_of, write_page
from clutchid.documents.results import FleetWear
from clutchid.documents.tables import Link
from clutchid.documents.wear_rows import alarm_words
from clutchid.wear import Alarm
from clutchid.wear.trend import Interval
from fixtures.programs import path_of

NAN, INF = float("nan"), float("inf")
HOSTILE = "</script><script>alert('1')</script>\"><img src=x onerror=alert(2)>"
UNKNOWN = Interval(NAN, NAN, NAN)
NOTHING = {**dict.fromkeys(("shift", "load", "wear", "left"), UNKNOWN), "rate": NAN}


def vehicle(name, shift=0.1e-3, rate=1e-10, left=1e5, **other):
    """A vehicle with a reading; `shift` in m, `rate` a stroke, `left` in strokes."""
    row = VehicleRow(
        name, "A", 10, 9, {"ok": 9, "failed": 1}, datetime(2026, 5, 1, tzinfo=UTC),
        Interval(shift, shift - 3e-5, shift + 3e-5), Interval(0.02, -0.01, 0.05), UNKNOWN, rate,
        Interval(left, 0.5 * left, 2 * left), "strokes", (), f"vehicles/{name}.html",
    )  # fmt: skip
    return row._replace(**other)


def forecast(name, share, km=9e4, days=120.0, **other):
    """A vehicle with a forecast: the same probability within each horizon, and what is left in km and days."""
    bands = (Interval(median, 0.5 * median, 2 * median) for median in (days, km))
    fields = dict(zip(("left_days", "left_km"), bands, strict=True))
    return vehicle(name, **{**fields, "within": (share,) * 6, "by_month": (share,) * 12, **other})


#: Replacements of all vehicles and of two depots.
REPLACEMENTS = [
    ReplacementRow(*tag, month, expected * month, 0.5 * expected * month, 2 * expected * month)
    for tag, expected in ((("", ""), 3.0), (("depot", "north"), 1.0), (("depot", "south"), 2.0))
    for month in range(1, 13)
]


def unread(name, **other):
    """A vehicle whose recordings have no reading."""
    return vehicle(name)._replace(counted=0, statuses={"bad_input": 10}, **{**NOTHING, **other})


class Parsed(HTMLParser):
    """Tables by caption as rows of texts, addresses, elements that could run something, and scripts."""

    def __init__(self, html):
        super().__init__()
        self.tables, self.addresses, self.handlers, self.scripts = {}, [], [], []
        self._rows, self._caption, self._inside = [], "", ""
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.handlers += [name for name, _ in attributes if name.startswith("on")]
        self.addresses += [value for name, value in attributes if name in ("href", "src")]
        if tag == "table":
            self._rows, self._caption = [], ""
        if tag == "tr":
            self._rows.append([])
        if tag in ("td", "th"):
            self._rows[-1].append("")
        if tag == "script":
            self.scripts.append("")
        if tag in ("td", "th", "caption", "script"):
            self._inside = tag

    def handle_endtag(self, tag):
        if tag == self._inside:
            self._inside = ""
        if tag == "table":
            self.tables[self._caption] = self._rows

    def handle_data(self, data):
        if self._inside == "caption":
            self._caption += data
        elif self._inside == "script":
            self.scripts[-1] += data
        elif self._inside:
            self._rows[-1][-1] += data


def parsed(vehicles, reasons=()):
    return Parsed(page_of(document_of(FleetWear(vehicles, reasons), "clutchid fleet")))


def names(table):
    return [cell.text for cell in table.column("vehicle")]


def test_the_page_has_every_section_and_says_how_many_vehicles_and_recordings_by_status(tmp_path):
    rows, reasons = (
        [vehicle("V1"), vehicle("V2"), unread("V3")],
        [ReasonCount("bad_input", "NAME has no position.", 12, "r7")],
    )
    write_page(document_of(FleetWear(rows, reasons), "clutchid fleet <rows>"), tmp_path / "index.html")
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    headings = ["Due first", "Alarms", "Types", "Recordings that do not count", "All vehicles"]
    assert re.findall("<h2>(.*?)</h2>", html)[:-1] == headings
    for words in (
        "3 vehicles, 30 recordings: 18 ok, 10 bad input, 2 failed",
        "2 of 3 vehicles have readings of the clutch. Their shift is 0.100 and 0.100 mm",
        "clutchid fleet &lt;rows&gt;",
    ):
        assert words in html
    assert Parsed(html).tables["12 recordings by reason"][1] == ["bad input", "12", "NAME has no position.", "r7"]


def test_the_table_of_all_vehicles_has_every_one_by_name_with_a_link_to_its_page():
    content = parsed([vehicle(f"V{i}") for i in (10, 9, 2)])
    rows = content.tables["All vehicles"][2:]
    assert [row[0] for row in rows] == ["V2", "V9", "V10"]
    assert rows[0][1:] == [
        "A", "100", "50\xa0to\xa0200", "2026-05-01", "10", "9", "0.100", "0.070\xa0to\xa00.130", "2.0", "0.010",
    ]  # fmt: skip
    assert content.addresses.count("vehicles/V2.html") == 2  # here and among what is due
    assert parsed([vehicle("V1", page="")]).tables["All vehicles"][2][0] == "V1"


def test_a_link_is_relative_whatever_the_name_of_the_file():
    assert Link("", "vehicles/a b#?%é.html").address == "vehicles/a%20b%23%3F%25%C3%A9.html"
    assert Link("", "//host/x").address == "./host/x"
    assert ":" not in Link("", "javascript:alert(1)").address
    assert Link("", "v/\udcff.html").address == "v/%FF.html"


def test_hostile_names_are_shown_and_never_run(tmp_path):
    bad = {"type": HOSTILE, "page": f"vehicles/{HOSTILE}.html", "alarms": (HOSTILE,)}
    rows = [alarmed(HOSTILE, 0.99)._replace(**bad), vehicle("W", type="$x_$"), unread("\udcff\u202e")]
    reasons = [ReasonCount(HOSTILE, HOSTILE, 1, HOSTILE)]
    write_page(document_of(FleetWear(rows, reasons), HOSTILE), tmp_path / "x.html")
    html = (tmp_path / "x.html").read_text(encoding="utf-8")
    page = Parsed(html)
    assert page.handlers == []
    assert len(page.scripts) == html.count("<script") == html.count("</script") == 2
    assert "alert" not in page.scripts[0]
    cells, links = json.loads(page.scripts[1])
    assert cells[0] == [HOSTILE, "W", "??"]
    assert all(re.fullmatch(r"vehicles/[\w%./-]+", link) for link in links)
    assert all(re.match(r"vehicles/[\w%./-]+$|#|data:image/", address) for address in page.addresses)
    assert [row[0] for row in page.tables["All vehicles"][2:]] == [HOSTILE, "W", "??"]


def test_the_script_of_the_page_loads_nothing_and_names_no_server():
    script, _ = parsed([vehicle("V")]).scripts
    assert parsed([]).scripts == [], "nor is there one without a long table"
    assert not re.search(r"https?:|fetch|import|innerHTML|eval|XMLHttp", script)


def test_without_probabilities_those_with_the_least_left_are_due_first_then_the_most_worn():
    rows = [
        vehicle("new", shift=0.01e-3, left=INF),
        vehicle("old", shift=-0.30e-3, left=INF),
        vehicle("soon", shift=0.05e-3, left=1e4),
        vehicle("over", left=0.0),
        vehicle("unlimited", shift=0.02e-3, left=NAN),
        unread("dark"),
    ]
    assert names(due_table(rows, spans_of(rows))) == ["over", "soon", "old", "unlimited", "new"]


def test_those_most_probable_to_reach_their_limit_soon_are_due_first_in_km_or_in_days_where_these_are_known():
    rows = [forecast("V1", 0.2), forecast("V2", 0.7, km=1e4), forecast("V3", 0.01, km=INF)]
    table = due_table(rows, spans_of(rows))
    assert names(table) == ["V2", "V1", "V3"]
    assert [column.heading for column in table.columns[2:5]] == ["20,000 km", "90 days", "365 days"]
    assert table.columns[5].group == "left [thousand km]"
    assert table.column("left") == (10.0, 90.0, INF)
    days = [forecast("V4", 0.5, NAN, within=(NAN, NAN, NAN, 0.5, 0.6, 0.9)), forecast("V5", 0.3, left=1e3)]
    table = due_table(days, spans_of(days))
    assert names(table) == ["V4", "V5"]
    assert table.columns[5].group == "left [days]"
    assert table.column("within 20,000 km [1]")[1:] == (0.3,)
    assert names(due_table([*days, vehicle("V6", left=5e5)], spans_of(days))) == ["V4", "V5", "V6"]


def test_the_bands_are_those_of_wear_where_it_is_known():
    worn = [vehicle(f"V{i}", wear=Interval(1e-3, 0.9e-3, 1.1e-3)) for i in range(2)]
    for rows, banded in ((worn, False), ([*worn, vehicle("V3")], True), ([vehicle("V3")], True)):
        for table in (due_table(rows, spans_of(rows)), all_table(rows, spans_of(rows))):
            assert ("shift band" in [column.name for column in table.columns]) == banded
            assert {len(row) for row in table.rows} == {len(table.columns)}


def test_replacements_are_shown_by_month_and_by_depot_for_three_months():
    north, south = "2.0\xa0(1.0\xa0to\xa04.0)", "4.0\xa0(2.0\xa0to\xa08.0)"
    (table,) = tag_tables(REPLACEMENTS)
    assert table.title == "Replacements in the next 3 months by depot, with 95 % bands"
    assert table.column("value") == ("south", "north")
    assert table.column("sum") == (12.0, 6.0)
    assert table.column("month 2") == (south, north)
    assert tag_tables([ReplacementRow("lot", f"{k}", 1, 1.0, 0.0, 2.0) for k in range(40)])[0].note.startswith("10 ")
    rows = [forecast("V1", 0.25), forecast("V2", 0.5)]
    html = page_of(document_of(FleetWear(rows, [], REPLACEMENTS), "c"))
    assert "limit: 0.8 within 20,000 km, 0.8 within 90 days, 0.8 within 365 days from their last" in html
    assert Parsed(html).tables["Replacements in each month"][2][:3] == ["expected", "3.0", "6.0"]


def alarmed(name, *probabilities, month=1):
    """A vehicle with alarms of given probabilities, each a month after the one before."""
    events = tuple(
        Alarm("r1", "r2", datetime(2026, month + k, 1, tzinfo=UTC), "replaced", 1e-3, 0.1, probability=p)
        for k, p in enumerate(probabilities)
    )
    suspect = Alarm("r3", "r4", None, "unknown", 1e-3, 0.1, probability=0.6)
    return vehicle(name, alarms=tuple(map(alarm_words, events)), events=(*events, suspect))


def test_alarms_stand_by_their_probability_and_those_as_probable_with_the_newest_first():
    rows = [alarmed("V1", 0.97), alarmed("V2", 0.99, 0.96), alarmed("V3", 0.99, month=6), vehicle("V4")]
    rows.append(alarmed("V5", float("nan")))
    table = alarms_table(rows)
    assert [cell.text for cell in table.column("vehicle")] == ["V5", "V3", "V2", "V1", "V2"]
    assert table.column("probability")[1:] == (0.99, 0.99, 0.97, 0.96)
    assert "2026-06-01" in table.column("alarm")[1]
    assert table.title == "5 alarms of 4 vehicles"
    html = page_of(document_of(FleetWear(rows, []), "c"))
    assert "<p>5 alarms of 4 vehicles</p>" in html


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (1, "Its shift is 0.100 mm.<"),
        (2, "Their shift is −0.100 and 0.000 mm.<"),
        (3, "The median shift is 0.000 mm; all are between −0.100 and 0.100 mm."),
        (21, "The median shift is 0.000 mm; nine of ten are between −0.900 and 0.900 mm."),
    ],
)
def test_the_spread_of_few_vehicles_is_that_of_all_and_agrees_with_the_table_of_types(count, words):
    shifts = 1e-4 * (np.arange(count) - count // 2) if count > 1 else [1e-4]
    assert words in page_of(document_of(FleetWear([vehicle(f"V{i}", shift=s) for i, s in enumerate(shifts)], []), "c"))


def test_what_is_left_is_compared_in_lives_where_vehicles_have_different_axes():
    rows = [vehicle("far", left=4e5), vehicle("near", left=8e4, axis="km")]  # 40 % and 20 % of a life
    table = due_table(rows, spans_of(rows))
    assert names(table) == ["near", "far"]
    assert table.column("left") == (pytest.approx(20.0), pytest.approx(40.0))
    assert table.columns[2].group == "left [% of a life]"
    assert "A life is 1,000,000 strokes, 400,000 km" in table.note


def test_without_a_limit_the_page_shows_the_most_worn_and_no_column_of_what_is_left():
    html = page_of(document_of(FleetWear([vehicle("V1", left=NAN), vehicle("V2", left=NAN)], []), "c"))
    assert "<h2>Most worn</h2>" in html
    assert "90 % band" not in html


def test_infinite_and_unknown_values_are_a_sign_and_a_dash():
    rows = parsed([vehicle("V1", left=INF), unread("V2")]).tables["All vehicles"]
    assert rows[2][2:4] == ["∞", "∞\xa0to\xa0∞"]
    assert rows[3][2:4] + rows[3][7:] == ["–"] * 6


def test_a_fleet_without_a_reading_has_no_figure_but_its_vehicles_and_reasons():
    html = page_of(document_of(FleetWear([unread("V1"), unread("V2")], [ReasonCount("bad_input", "s", 20, "e")]), "c"))
    assert "No recording determines the wear of a vehicle." in html
    assert "data:image" not in html
    assert len(Parsed(html).tables["All vehicles"]) == 4
    assert "<h2>Most worn</h2>" not in html


def test_an_empty_fleet_and_one_vehicle_have_a_page():
    assert "0 vehicles, 0 recordings" in page_of(document_of(FleetWear([], []), "c"))
    text = page_of(document_of(FleetWear([vehicle("V1")], []), "c"))
    assert "1 vehicle, 10 recordings" in text
    assert "Every recording counts." in text


def test_long_lists_are_cut_and_say_what_is_left_out():
    alarms = alarms_table([alarmed(f"V{i}", 0.99, 0.98) for i in range(SHOWN_ALARMS)])
    assert (len(alarms.rows), alarms.note[:3]) == (SHOWN_ALARMS, f"{SHOWN_ALARMS} ")
    table = reasons_table([ReasonCount("failed", f"reason {i}", 1000 - i, "e") for i in range(45)])
    assert table.column("recordings") == tuple(range(1000, 960, -1))
    assert table.note.startswith("5 rarer reasons, of 4,790 recordings")


def test_a_page_of_two_thousand_vehicles_is_small_and_has_the_first_rows():
    rows = [vehicle(f"V{i}", shift=1e-8 * i) for i in range(2_000)]
    html = page_of(document_of(FleetWear(rows, []), "c"))
    assert len(html.encode()) < 5e5
    assert len(Parsed(html).tables["All vehicles"]) == PART + 2
    assert "The first 100 of 2,000 rows" in html


#: A script that puts the vehicles that are shown after each address into the title of the page.
SHOWN = """addEventListener("load", async () => {
const found = [];
for (const address of %s) {
  const changed = new Promise((next) => addEventListener("hashchange", next, { once: true }));
  location.hash = address;
  if (address) await changed;
  found.push(Array.from(document.querySelectorAll(".sortable tbody tr"), (row) => row.cells[0].textContent.trim()));
}
document.title = JSON.stringify(found);
})"""


@pytest.mark.slow
@pytest.mark.needs("chromium")
def test_a_browser_sorts_and_filters_by_the_address_with_unknown_values_last(tmp_path):
    shifts = [0.2e-3, -0.1e-3, NAN, 0.05e-3]
    rows = [vehicle(f"V{i}", shift=shift) for i, shift in enumerate(shifts)] + [vehicle("other", type="B")]
    expected = {
        "": ["V0", "V1", "V2", "V3", "other"],
        "sort=8&filter=v": ["V1", "V3", "V0", "V2"],
        "sort=-8&filter=V": ["V0", "V3", "V1", "V2"],
        "sort=9&filter=v": ["V1", "V3", "V0", "V2"],  # by the lower end of the band
        "filter=b&sort=99&part=7": ["other"],
        "sort=-2": ["other", "V0", "V1", "V2", "V3"],
    }
    script = SHOWN % json.dumps([*expected])
    digest = b64encode(sha256(script.encode()).digest()).decode()
    html = page_of(document_of(FleetWear(rows, []), "c")).replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    (tmp_path / "x.html").write_text(html.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8")
    options = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}")
    command = [*options, "--virtual-time-budget=20000", "--dump-dom", (tmp_path / "x.html").as_uri()]
    run = subprocess.run([path_of("chromium"), *command], capture_output=True, text=True, timeout=120, check=True)
    content = json.loads(unescape(re.search("<title>(.*?)</title>", run.stdout, re.DOTALL)[1]))
    assert dict(zip(expected, content, strict=True)) == expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [((1.0, 2.0), 1.5), ((1.0, 2.0, 4.0), 2.0), ((1.0, np.inf), np.inf), ((np.inf, np.inf), np.inf), ((np.nan,), None)],
)
def test_the_median_of_an_even_number_is_half_way_between_the_two_in_the_middle(values, expected):
    assert quantiles(values, (0.5,)) == [expected]
