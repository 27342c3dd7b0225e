"""Tables as CSV and HTML."""

import csv
from io import StringIO

import pytest

from clutchid.documents.tables import Column, Link, ReportTable, scientific, to_csv, to_html

COLUMNS = (
    Column("method", "method"),
    Column("position_rms [m]", "rms\n[mm]", 1e-3, 3, group="position"),
    Column("position_sse [m2]", "Σe²\n[m²]", significant=3, group="position"),
    Column("pressure_a_rms [Pa]", "rms [bar]", 1e5, 2, group="pressure"),
)
TABLE = ReportTable(
    "Errors <of> two",
    COLUMNS,
    (("ballistic", 1 / 3000, 0.00123456, 25000.0), ("parts & co", 2e-3, float("nan"), None)),
    (1,),
    "a < b",
)


def test_a_csv_file_has_si_units_and_every_digit():
    rows = list(csv.reader(StringIO(to_csv(TABLE))))
    assert rows[0] == ["method", "position_rms [m]", "position_sse [m2]", "pressure_a_rms [Pa]"]
    assert float(rows[1][1]) == 1 / 3000
    assert float(rows[1][3]) == 25000.0


def test_what_is_missing_is_an_empty_cell_in_csv_and_a_dash_for_people():
    assert to_csv(TABLE).splitlines()[-1] == "parts & co,0.002,,"
    assert to_html(TABLE).count("–") == 2


@pytest.mark.parametrize(
    "part",
    [
        *("0.333", ">0.25<", "1.23·10⁻³"),  # scaled
        *("Errors &lt;of&gt; two", "parts &amp; co", "a &lt; b"),  # escaped
        '<th colspan="2" class="group first" scope=colgroup>position</th>',
        *('<td class="n first">0.333</td>', "<th scope=row>ballistic</th>"),  # numbers to the right, words not
    ],
)
def test_people_see_scaled_numbers_to_the_right_escaped_texts_and_groups_over_their_columns(part):
    assert part in to_html(TABLE)


def test_a_column_is_found_with_and_without_its_unit():
    assert TABLE.column("position_rms [m]") == TABLE.column("position_rms") == (1 / 3000, 2e-3)
    with pytest.raises(ValueError, match="nothing"):
        TABLE.column("nothing")


def test_a_number_that_rounds_to_zero_has_no_sign_and_infinity_is_a_sign():
    assert Column("x", "x", decimals=2).shown(-0.001) == "0.00"
    assert Column("x", "x").shown(float("-inf")) == "−∞"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (9.385e5, 4, "9.385·10⁵"),
        (-0.0161, 2, "−0.016"),
        (0.0016, 2, "1.6·10⁻³"),
        (12345.0, 3, "12345"),
        (1.69, 0, "1.69"),
    ],
)
def test_powers_of_ten_begin_where_plain_numbers_become_hard_to_read(value, digits, text):
    assert scientific(value, digits) == text


def test_a_link_leads_somewhere_on_a_page_and_is_its_text_elsewhere():
    table = ReportTable(
        "t", (Column("a", "a"), Column("b [1]", "b")), ((Link("x & y", "v/x y.html"), 1.0), (Link("z"), 2.0))
    )
    assert '<th scope=row><a href="v/x%20y.html">x &amp; y</a></th>' in to_html(table)
    assert "<th scope=row>z</th>" in to_html(table)
    assert to_csv(table).splitlines()[1:] == ["x & y,1.0", "z,2.0"]


def test_only_a_date_stays_on_one_line_on_a_page():
    table = ReportTable("t", (Column("a", "a"), Column("b", "b", date=True)), (("2026-05-01", "2026-05-02"),))
    assert '<th scope=row>2026-05-01</th><td class="date">2026-05-02</td>' in to_html(table)
