"""New against worn on the page: both loads, their difference, the calibration, and several recordings."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.comparison import change_table, comparison_figure, comparison_sections
from clutchid.documents.document import Document
from clutchid.documents.figures import svg
from clutchid.documents.html import page_of
from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.comparison import comparison
from clutchid.estimation.result import Change
from clutchid.inference.uncertainty.calibration import Origin
from fixtures.baselines import ORIGIN, reaching, with_baseline

HOSTILE = "<script>alert('x')</script>[red]\x1b[31m"


def html_of(fit):
    return page_of(Document("t", sections=lambda: comparison_sections(fit)))


@pytest.mark.slow
def test_the_page_has_date_trust_and_hash_of_the_calibration(blank, fitted):
    html = page_of(document_of(with_baseline(fitted), "clutchid fit"))
    for part in ("CAL.toml (2026-11-22, trust good)", "<dt>SHA-256 of CAL.toml</dt>", ORIGIN.sha256):
        assert part in html


def test_the_section_says_where_both_loads_reach_half_of_their_peaks(fitted):
    html = html_of(with_baseline(fitted, std=2e4))
    assert html.count("half of its peak at") == 1
    nothing = html_of(with_baseline(fitted, share=0.0))
    assert "One of the loads does not reach half of its peak" in nothing
    assert ">nan" not in nothing


def test_the_table_has_both_loads_and_their_difference_at_every_millimetre(fitted):
    compared = comparison(with_baseline(fitted, share=0.8))
    table = change_table(compared)
    positions = np.array(table.column("position"))
    assert positions == pytest.approx(1e-3 * np.arange(1, 1 + int(compared.reach * 1e3)))
    expected = np.subtract(table.column("present"), table.column("calibrated"))
    np.testing.assert_allclose(table.column("change"), expected, atol=1e-6)
    assert table.column("share") == pytest.approx([0.25] * positions.size)
    assert [column.shown(0.25) for column in table.columns if column.name == "share [1]"] == ["25.0"]


@pytest.mark.slow
def test_a_recording_that_stays_below_5_mm_is_shown_up_to_there(fitted):
    low = reaching(with_baseline(fitted), 0.25)
    assert len(change_table(comparison(low)).rows) == 4
    ElementTree.fromstring(svg(comparison_figure(comparison(low))))


@pytest.mark.parametrize("end", [np.inf, np.nan])
def test_an_interval_without_an_end_is_drawn_without_one(fitted, end):
    curve, nowhere = fitted.load_curve, np.full(101, end)
    lost = replace(with_baseline(fitted), load_curve=LoadCurve(curve.position, curve.force, -nowhere, nowhere))
    html = html_of(lost)
    assert "<img " in html
    assert ">nan<" not in html
    assert ">inf<" not in html


def test_both_loads_and_the_change_are_in_the_figure(fitted):
    figure = comparison_figure(comparison(with_baseline(fitted, share=0.8)))
    loads, difference = figure.axes
    drawn = {line.get_label(): line.get_ydata() for line in (*loads.lines, *difference.lines)}
    np.testing.assert_allclose(drawn["at the calibration"], 0.8 * drawn["now"], atol=1e-9)
    np.testing.assert_allclose(drawn["now minus calibration"], 0.2 * drawn["now"], atol=1e-6)


def test_a_load_that_cannot_be_compared_has_a_sentence(fitted):
    older = with_baseline(fitted, theta=(), theta_covariance=np.zeros((0, 0)))
    html = html_of(older)
    assert "there is nothing to compare" in html
    assert "<img " not in html


def test_without_a_calibration_there_is_no_section(fitted):
    assert comparison_sections(fitted) == []


@pytest.mark.slow
def test_foreign_names_do_nothing_on_the_page(blank, fitted, loads_nothing):
    change = Change(HOSTILE, "C_vs", 1.0, 2.0, 0.1, HOSTILE, 0.9, HOSTILE)
    calibrated = replace(with_baseline(fitted, origin=Origin(*[HOSTILE] * 4), converged=False), changes=(change,))
    html = page_of(document_of(replace(calibrated, readings={HOSTILE: calibrated}), "clutchid fit"))
    assert "<script" not in html
    assert "&lt;script&gt;" in html
    assert loads_nothing(html)
    assert "New against worn" in html
