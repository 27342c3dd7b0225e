"""The page template."""

import base64
import hashlib
import re
from html import escape

import pytest

from clutchid.documents.document import (
    Bullets,
    Chapter,
    Details,
    Document,
    LabelRow,
    Markup,
    NextStep,
    Notice,
    Picture,
    Sortable,
    Text,
)
from clutchid.documents.html import page_of
from clutchid.documents.tables import Column, Link, ReportTable

HOSTILE = '<script src="http://evil.example/x.js">alert("1")</script>'
SECTION = Chapter(
    f"heading {HOSTILE}",
    (
        Text(Markup(f"<b>ours</b> {escape(HOSTILE)}")),
        Text(HOSTILE),
        Bullets((HOSTILE, Markup("<i>second</i>"))),
        Notice(HOSTILE, "none"),
        Notice(HOSTILE, "with care", (HOSTILE,)),
        Details(HOSTILE, (Notice(HOSTILE), Details(HOSTILE, (Text("inner"),)))),
        Picture(b"\x89PNG", HOSTILE, f'quote " {HOSTILE}'),
        ReportTable(HOSTILE, (Column("a", HOSTILE, group=HOSTILE),), ((HOSTILE,),), note=HOSTILE),
    ),
)
PAGE = Document(
    f"title {HOSTILE}", f"subtitle {HOSTILE}", (LabelRow(HOSTILE, HOSTILE), LabelRow("", HOSTILE, "good")),
    (Notice(HOSTILE),), lambda: (SECTION,),
    next=NextStep("keep", HOSTILE, HOSTILE), command=HOSTILE, sources={HOSTILE: HOSTILE},
)  # fmt: skip


def of_blocks(*blocks):
    return page_of(Document("t", "s", sections=lambda: (Chapter("h", blocks),)))


def test_hostile_names_are_shown_and_never_run():
    html = page_of(PAGE)
    assert "<script" not in html
    assert html.count("&lt;script") == 29  # every place of the page that shows a text


@pytest.mark.parametrize(
    "part",
    [
        "<b>ours</b>",
        "<li><i>second</i></li>",
        '<p class="notice none">',
        '<div class="notice with-care"><strong>',
        "data:image/png;base64,iVBORw==",
        *('<html lang="en">', '<meta charset="utf-8">', 'name="viewport"', "@media print"),
    ],
)
def test_our_own_markup_pictures_language_and_width_for_phones_are_on_the_page(part):
    assert part in page_of(PAGE)


def test_what_is_folded_is_on_the_page_and_may_be_folded_again():
    html = page_of(PAGE)
    assert html.count("<details>") == html.count("</details>") == 2
    assert html.index("<summary>") < html.index("<p>inner</p>") < html.rindex("</details>")


def test_a_page_without_provenance_has_no_footer():
    assert "<footer>" not in page_of(Document("t", "s"))


def test_a_page_that_is_a_part_leads_to_the_whole():
    html = page_of(Document("t", "s", home=Link(HOSTILE, f"../{HOSTILE}")))
    assert "<script" not in html
    assert '<a href="../%3Cscript%20src' in html


def test_only_a_page_with_a_sortable_table_has_its_script_and_a_box_to_filter():
    table = ReportTable("t", (Column("a", "a"),), (("x",), ("y",)))
    assert "<script" not in of_blocks(table)
    html = of_blocks(Sortable(table))
    assert html.count("<script>") == html.count('type="search"') == 1
    assert html.index("<script>") < html.index("<th scope=row>x</th>") < html.index("<th scope=row>y</th>")


def test_a_page_runs_its_own_script_and_loads_nothing():
    table = Sortable(ReportTable("all", (Column("a", "text"),), (("x",),)))
    scripted = of_blocks(table)
    assert '[[["x\\u003c/script>"]],[""]]</script>' in of_blocks(
        Sortable(ReportTable("all", (Column("a", "text"),), (("x</script>",),)))
    )
    (script,) = re.findall(r"<script>(.*?)</script>", scripted, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    for html, allowed in ((scripted, f"; script-src 'sha256-{digest}'"), (page_of(PAGE), "")):
        (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="(.*?)">', html)
        assert policy.startswith("default-src 'none'; img-src data:; ")
        assert policy.partition("form-action 'none'")[2] == allowed
        assert html.index("Content-Security-Policy") < html.index("<style>")


def test_letters_that_cannot_be_shown_are_question_marks():
    hidden = "a\x1b[31m\x07\u202egpj.exe\u2066\ud800\x9b\u2028\r"
    html = page_of(Document(hidden, "10\u00a0mm, 1\u2009000 \u00fc\n", notices=(Notice(hidden, items=(hidden,)),)))
    assert html.count("a?[31m??gpj.exe?????") == 4  # title twice, notice and item of its list
    assert "10\u00a0mm, 1\u2009000 \u00fc\n" in html
