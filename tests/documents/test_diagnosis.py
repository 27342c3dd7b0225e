"""Blocks and figures of a diagnosis."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clutchid.documents.diagnosis import (
    colour_figure,
    diagnosis_table,
    information_blocks,
    limit_blocks,
    residual_blocks,
    worst_first,
)
from clutchid.documents.document import Bullets, Details, Text
from clutchid.estimation.assess.evidence import diagnosed, evidence
from clutchid.estimation.assess.verdict import Verdict
from fixtures.baselines import reaching

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def diagnosis(fitted):
    return diagnosed(fitted, "first")


def test_what_a_verdict_cannot_see_is_folded_and_names_stay_as_they_are():
    (folded,) = limit_blocks(Verdict("good", (), ("not this.", "worn: that.", "theta_3 too.")), ["worn"])
    assert isinstance(folded, Details)
    assert folded.blocks == (Text("Not this."), Text("worn: that."), Text("theta_3 too."))


def test_a_row_of_panels_for_each_measured_column(diagnosis):
    axes = colour_figure(diagnosis).axes
    assert len(axes) == 3 * 2
    assert [axis.get_title(loc="left") for axis in axes[:2]] == [
        "position: autocorrelation", "position: with the supply valve"
    ]  # fmt: skip
    assert axes[3].get_title(loc="left") == "pressure A: autocorrelation"
    assert [axis.get_xlabel() for axis in axes] == [*[""] * 5, "lag [ms]"]


def test_correlations_are_drawn_as_they_are_with_lags_in_milliseconds(diagnosis):
    fast = diagnosis.columns["position"].fast
    _bounds, stems = colour_figure(diagnosis).axes[0].collections
    ends = np.array([path.vertices[-1] for path in stems.get_paths()])
    np.testing.assert_allclose(ends[:, 0], fast.lag[1:] * 1e3)
    np.testing.assert_allclose(ends[:, 1], fast.autocorrelation[1:])


def test_an_input_that_does_not_move_is_said_not_drawn(fitted):
    recording = fitted.recordings["first"]
    still = recording.measured.with_columns(duty_exhaust=np.zeros(len(recording.measured)))
    diagnosis = diagnosed(replace(fitted, recordings={"first": replace(recording, measured=still)}), "first")
    assert [text.get_text() for text in colour_figure(diagnosis).axes[2].texts] == ["constant"]


def test_the_table_has_a_row_a_column_with_its_unit(fitted):
    table = diagnosis_table(evidence(fitted))
    assert table.column("column") == ("position", "pressure A")
    assert [cell.split()[-1] for cell in table.column("rms")] == ["mm", "kPa"]
    assert table.column("predicted_percent")[1] is None


@pytest.mark.slow
def test_residuals_that_look_like_noise_need_no_words(diagnosis, fitted):
    calm = replace(diagnosis, columns={"position": diagnosis.columns["position"]})
    assert len(residual_blocks(fitted, calm)) in (1, 2)
    assert "of pressure" not in residual_blocks(fitted, calm)[0].caption


def test_what_is_missing_comes_with_the_page_of_its_manoeuvre(fitted):
    low = reaching(fitted, 0.5)
    blocks = information_blocks(low, evidence(low))
    assert isinstance(blocks[0], Bullets)
    assert any("reach" in item for item in blocks[0].items)
    page, heading = re.fullmatch(r'What to drive: (\S+), "(.+)"\.', blocks[1].text).groups()
    assert f"\n## {heading}\n" in (ROOT / page).read_text(encoding="utf-8")


def test_nothing_missing_is_said_and_no_page_is_named(fitted):
    basis = replace(evidence(fitted), missing=())
    said = "The excitation is sufficient: reach, directions and vented rests."
    assert information_blocks(fitted, basis) == [Text(said)]


def test_the_poorest_recordings_come_first(fitted):
    basis = replace(evidence(fitted), predictions={"a": 95.0, "b": 60.0, "c": 80.0})
    assert worst_first(basis, ["a", "b", "c", "d"]) == ["b", "c", "a", "d"]


@pytest.mark.slow
def test_a_recording_too_short_for_a_colour_is_drawn_all_the_same(fitted):
    recording = fitted.recordings["first"]
    short = replace(recording, measured=recording.measured.slice(0, 40), simulated=recording.simulated.slice(0, 40))
    diagnosis = diagnosed(replace(fitted, recordings={"first": short}), "first")
    assert len(residual_blocks(fitted, diagnosis)) >= 1
