"""The page of a fit."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.fit import application_data, compared_columns
from clutchid.documents.fit_json import fit_json
from clutchid.documents.fit_sections import MAX_DRAWN, error_table, parameter_table
from clutchid.documents.html import page_of, write_page
from clutchid.estimation import Estimate, LoadCurve
from clutchid.estimation.assess.evidence import reach
from clutchid.inference.uncertainty.conditions import Assumption
from clutchid.log import Log
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.next_step import document_with_next_step
from fixtures.baselines import reaching, two_states, with_baseline

pytestmark = pytest.mark.slow

COMMAND = "clutchid fit first.csv --verify 'my log.csv' --report page.html"


def flat(html):
    return " ".join(re.sub(r"<[^>]+>", " ", html).split())


@pytest.fixture(scope="module")
def html(fitted):
    return page_of(document_of(fitted, COMMAND))


def test_the_page_loads_nothing_from_anywhere(html, loads_nothing):
    assert loads_nothing(html)


def test_the_page_has_the_load_every_recording_and_the_residuals_of_the_fitted_one_as_figures(html):
    assert html.count("<img ") == 1 + 2 + 1 + 1  # load, recording, residuals, starts


def test_every_shown_number_of_the_tables_is_on_the_page(fitted, html):
    for table in (parameter_table(fitted), error_table(fitted)):
        for row in table.rows:
            for column, cell in zip(table.columns, row, strict=True):
                assert f">{column.shown(cell)}<" in html


def test_the_tables_hold_the_numbers_of_the_fit(fitted):
    assert parameter_table(fitted).column("value") == tuple(e.value for e in fitted.parameters.values())
    table = error_table(fitted)
    assert table.column("recording") == ("first", "checked")
    assert table.column("position_rms")[0] == fitted.errors.position_rms
    assert table.column("pressure_a_rms") == (fitted.errors.pressure_a_rms, None)
    assert table.column("use") == ("fitted", "verified")


def test_several_recordings_get_a_row_for_all_together(fitted):
    recording = fitted.recordings["first"]
    both = replace(fitted, recordings={"a": recording, "b": recording})
    assert error_table(both).column("recording") == ("a", "b", "all fitted", "checked")


def test_the_page_says_where_it_comes_from(html):
    command = "clutchid fit first.csv --verify &#39;my log.csv&#39;"
    assert all(part in html for part in ("abc123", "SHA-256 of first.csv", command, "numba", "Python"))


def test_fixed_parameters_stand_on_the_page_and_free_ones_are_not_called_fixed(html):
    fixed = re.search(r"Fixed: (.*?)</p>", html).group(1)
    assert "C_vs = 1.9·10⁻⁸ m³/(Pa·s)" in fixed
    assert "theta" not in fixed


def test_warnings_and_what_the_data_determine_are_shown_in_words(blank, fitted):
    noted = replace(
        fitted, status="warning", warnings=("mind < this",), notes=("determined by the data: C_vs < C_ve.",)
    )
    html = page_of(document_of(noted, COMMAND))
    assert '<p class="notice with-care">mind &lt; this</p>' in html
    assert "<li>Determined by the data: C_vs &lt; C_ve.</li>" in html


def test_the_peak_is_looked_for_only_where_the_recordings_have_been(blank, fitted):
    curve = fitted.load_curve
    growing = LoadCurve(curve.position, curve.position * 2e5, curve.low, curve.high)
    html = page_of(document_of(replace(fitted, load_curve=growing), COMMAND))
    reach = max(float(np.nanmax(r.measured["position"])) for r in fitted.recordings.values())
    at = curve.position[curve.position <= reach].max() * 1e3
    assert f" N at {at:.1f} mm of the recorded" in flat(html)


def test_an_infinite_band_is_said_not_drawn_and_a_recording_with_missing_samples_is_drawn(blank, fitted):
    curve, recording = fitted.load_curve, fitted.recordings["first"]
    unknown = LoadCurve(curve.position, curve.force, np.full(101, -np.inf), np.full(101, np.inf))
    position = recording.measured["position"].copy()
    position[100:2000] = np.nan
    lacking = replace(recording, measured=recording.measured.with_columns(position=position))
    html = page_of(document_of(replace(fitted, load_curve=unknown, recordings={"first": lacking}), COMMAND))
    assert html.count("not determined") == 1 + 4
    assert html.count("<img ") == 1 + 2 + 1 + 1  # load, recording, residuals, starts


def test_a_failed_fit_has_a_page_that_says_so(fitted, loads_nothing):
    nothing = np.full(101, np.nan)
    failed = replace(
        fitted, status="failed", message="the simulation diverged at 1.200 s in y", recordings={}, verification={},
        load_curve=LoadCurve(fitted.load_curve.position, nothing, nothing, nothing), scales={},
    )  # fmt: skip
    html = page_of(document_of(failed, COMMAND))
    assert "the fit failed, and there is no load to show: the simulation diverged at 1.200 s in y" in html
    assert "<img " not in html
    assert loads_nothing(html)


def test_the_verdict_stands_above_everything_else(blank, fitted, html):
    assert html.index(">trust<") < html.index("converged") < html.index("<img ")
    bad = page_of(document_of(replace(fitted, converged=False), COMMAND))
    assert "<p>the search did not converge; continue from its result, or free fewer parameters.</p>" in bad


def test_by_shooting_a_verified_recording_is_drawn_as_its_sensors_see_it(blank, fitted, monkeypatch):
    module, drawn = sys.modules["clutchid.documents.fit_sections"], {}
    plain = module.recording_figure

    def figure(as_measured, *more):
        drawn[as_measured.measured.name] = as_measured
        return plain(as_measured, *more)

    monkeypatch.setattr(module, "recording_figure", figure)
    document_of(replace(fitted, method="shooting", actuator=fitted.actuator.replace({"e_y": 1e-4}))).sections()
    for name, recording in {**fitted.recordings, **fitted.verification}.items():
        difference = drawn[name].simulated["position"] - recording.simulated["position"]
        assert difference == pytest.approx(np.full(difference.size, 1e-4))


def test_of_many_recordings_the_worst_are_drawn_and_the_page_stays_small(blank, fitted, html):
    recording = fitted.recordings["first"]
    names = [f"log{i}" for i in range(MAX_DRAWN + 3)]
    late = replace(recording, measured=recording.measured.with_columns(position=recording.measured["position"] + 2e-3))
    many = replace(fitted, recordings={name: late if name == "log5" else recording for name in names}, verification={})
    page = page_of(document_of(many, COMMAND))
    assert page.count("<img ") == 1 + 1 + 2 * MAX_DRAWN  # load, starts, recordings
    assert "log5 (fitted)" in page
    assert "3 more (fitted)" in page
    assert len(html) / html.count("<img ") * page.count("<img ") < 3e6


def test_a_long_recording_is_thinned_and_its_worst_half_minute_drawn_closer(fitted):
    recording = fitted.recordings["first"]

    def longer(log):
        return Log(np.arange(160_000) * 1e-3, {n: np.tile(v, 40) for n, v in log.columns.items()}, "first")

    long = replace(recording, measured=longer(recording.measured), simulated=longer(recording.simulated))
    html = page_of(document_of(replace(fitted, recordings={"first": long}, verification={}), COMMAND))
    assert "The 30 s with the largest error of the position." in html
    assert html.count("<img ") == 1 + 2 + 1 + 1  # load, recording, residuals, starts
    assert len(html) < 3e6


def test_a_load_beyond_the_reach_where_the_clutch_engages_is_not_stated(blank, fitted):
    html = page_of(document_of(replace(reaching(fitted, 0.3), verification={}), COMMAND))
    assert html.partition("<table>")[2].partition("</table>")[0].count(">-<") == 4


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("shooting", ("fitted by multiple shooting", "within windows of 0.1 s")),
        ("prediction-error", ("fitted by prediction error", "one-sample prediction errors")),
    ],
)
def test_the_page_says_what_the_errors_of_a_method_are(blank, fitted, method, words):
    html = page_of(document_of(replace(fitted, method=method), COMMAND))
    assert all(text in html for text in (*words, "Limits of the verdict"))


def test_an_error_while_drawing_leaves_the_old_page(fitted, tmp_path):
    page = tmp_path / "page.html"
    page.write_text("old")
    with pytest.raises(AttributeError):
        write_page(document_of(replace(fitted, actuator=None), COMMAND), page)
    assert page.read_text() == "old"


def reading(fitted, **changes):
    """A reading from position alone, whose recordings lack supply pressure and temperature."""
    assumed = (Assumption("P_S", ("first",), 8.9e5, 0.5e5, False), Assumption("T_0", ("first",), 293.15, 13.0, False))
    calibration = with_baseline(fitted)
    own = {f"{name}@first": Estimate(value, unit, std, value - 2 * std, value + 2 * std)
           for name, value, unit, std in (("P_S", 8.91e5, "Pa", 5e3), ("T_0", 293.3, "K", 0.5))}  # fmt: skip
    parameters = {**calibration.parameters, **own}
    covariance = np.diag([e.std**2 for e in parameters.values()])
    return replace(calibration, parameters=parameters, covariance=covariance, assumed=assumed, **changes)


def test_the_interval_of_what_was_not_recorded_is_the_assumed_one(fitted):
    table = parameter_table(reading(fitted))
    rows = dict(zip(table.column("name"), zip(table.column("low"), table.column("high"), strict=True), strict=True))
    assert rows["P_S@first"] == (8.4e5, 9.4e5)
    assert rows["T_0@first"] == pytest.approx((280.15, 306.15))
    assert "these data do not narrow" in table.note
    assert parameter_table(fitted).note == ""


def test_a_search_that_converged_with_warnings_is_not_in_a_box_of_warnings(blank, fitted):
    warned = document_of(replace(fitted, status="warning", warnings=("2 s are missing",)))
    assert [(notice.text, notice.level) for notice in warned.notices] == [("2 s are missing", "with care")]
    assert 'notice with-care">2 s are missing' in page_of(warned)
    assert document_of(fitted).notices == ()


def test_the_page_has_the_next_step_and_what_is_assumed(blank, fitted):
    asked = FitCommand(verb="estimate", logs=(Path("worn.csv"),), start=Path("CAL.toml"), report=Path("worn.html"))
    html = flat(page_of(document_with_next_step(reading(fitted), asked)))
    assert f"next keep the result: clutchid {' '.join(asked.words)} --save worn.toml" in html
    assert "supply pressure not recorded: the calibrated value is assumed, 8.90 ± 0.50 bar" in html


def test_the_application_has_what_is_assumed_and_no_change_where_terminal_and_page_have_none(fitted):
    fit = reading(fitted)
    data = application_data(fit, document_of(fit))
    assert data["reach_m"] == reach(fit)
    assert sum("not recorded" in row["text"] for row in data["summary"]) == 2
    states = two_states(fitted)
    assert fit_json(states)["changes"]
    data = application_data(states, document_of(states))
    assert data["changes"] == []
    assert sum("the actuator itself has not changed" in row["text"] for row in data["summary"]) == 1


def test_residuals_are_those_of_the_fit_seen_through_its_sensors(fitted):
    offset = replace(fitted, method="shooting", actuator=fitted.actuator.replace({"e_y": 1e-4}))
    for name, columns in compared_columns(offset).items():
        recording = {**offset.recordings, **offset.verification}[name]
        expected = recording.measured["position"] - recording.simulated["position"] - 1e-4
        np.testing.assert_allclose(columns["residual position"], expected, atol=1e-12)
    assert "simulated pressure_a" in compared_columns(offset)["checked"]


def test_reasons_are_wrapped_in_a_notebook(fitted):
    html = replace(fitted, converged=False)._repr_html_()
    assert "<p>the search did not converge; continue from its result, or free fewer parameters.</p>" in html
    assert "<pre" not in html
