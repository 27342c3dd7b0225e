"""The page of a recording that was observed."""

import numpy as np
import pytest

from clutchid.documents import document_of
from clutchid.documents.figures import BINS, thinned, with_gaps
from clutchid.documents.html import page_of, write_page
from clutchid.documents.observation import (
    adapted_table,
    loads_figure,
    samples_figure,
    strokes_figure,
)
from clutchid.documents.observation_rows import load_sentence, observe_json, observe_sentence
from clutchid.documents.results import Observation
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.log import Log
from clutchid.observer import estimates_of, observe_recording, observer
from clutchid.observer.run import loads

ORIGIN = Origin("CAL.toml", "2026-11-22T10:00:00+00:00", "abc", "good")


@pytest.fixture(scope="module")
def log(plant, recorded_by):
    return recorded_by(plant.replace({name: 1.1 * plant.value(name) for name in plant.load.names}), seconds=6.0)


@pytest.fixture(scope="module")
def run(plant, log):
    return observe_recording(observer(plant), log)


@pytest.mark.slow
def test_the_page_has_loads_strokes_samples_parameters_and_health(run, loads_nothing, tmp_path):
    write_page(document_of(Observation(run, ORIGIN), "clutchid observe <worn>.parquet"), tmp_path / "page.html")
    html = (tmp_path / "page.html").read_text(encoding="utf-8")
    for heading in ("Load by stroke", "Samples", "Innovations", "Parameters"):
        assert f"<h2>{heading}</h2>" in html
    assert "started from CAL.toml" in html
    assert "clutchid observe &lt;worn&gt;.parquet" in html
    assert "No fault was found." in html
    assert html.count("the supply pressure was not recorded: a supply pressure 5 % below") == 1
    assert html.count("data:image/") == 4
    assert loads_nothing(html)


def test_without_strokes_pressure_and_adaptation_the_page_says_so(blank, plant, log):
    short = observe_recording(observer(plant, "states"), log.slice(0, 40).without("pressure_a"))
    html = page_of(document_of(Observation(short, Origin()), "c"))
    assert "No stroke ended in the recording." in html
    assert "The observer does not adapt: load and parameters keep their calibrated values." in html
    assert "started from a calibration that is not from a file" in html


def test_the_load_is_drawn_before_and_after_with_bands_and_the_change_below(run):
    figure = loads_figure(loads(run))
    upper, lower = figure.axes
    before, after = (line.get_ydata() for line in upper.lines[:2])
    assert len(upper.collections) == 2
    assert lower.lines[0].get_ydata() == pytest.approx(after - before)
    assert upper.get_ylim()[1] < 1.5 * max(before.max(), after.max())


def test_a_stroke_is_a_point_and_the_load_before_the_recording_the_first(run):
    axes = strokes_figure(run).axes
    assert [axis.get_ylabel() for axis in axes] == ["at 3 mm [N]", "at 6 mm [N]", "at 12 mm [N]"]
    for axis in axes:
        assert axis.lines[0].get_xdata().tolist() == list(range(len(run.strokes) + 1))
    at_6_mm = [row.curve.force[12] for row in run.strokes]
    assert axes[1].lines[0].get_ydata()[1:].tolist() == at_6_mm


def test_a_measured_pressure_is_compared_with_the_estimate(run, plant, log):
    assert len(samples_figure(run).axes) == 5
    without = observe_recording(observer(plant), log.slice(0, 500).without("pressure_a"))
    assert len(samples_figure(without).axes) == 4


def test_a_hole_in_time_is_a_gap_also_in_a_decimated_curve():
    time = np.r_[0:50_000, 60_000:100_000] * 1e-3
    t, (y,) = with_gaps(time, [np.ones(time.size)])
    assert np.all(np.diff(t) > 0)
    assert t.size < time.size + 2 * time.size / BINS + 3
    x, drawn = thinned(t, y)
    gap = x[np.isnan(drawn)]
    assert gap.size
    assert 50.0 <= gap.min() <= gap.max() <= 60.0


@pytest.mark.slow
def test_faults_are_on_the_page_in_words_with_their_seconds(blank, plant, log):
    position = log["position"].copy()
    position[1000:1200] = np.nan
    torn = observe_recording(observer(plant), log.with_columns(position=position))
    assert "the position is missing: 0.2 s" in page_of(document_of(Observation(torn, ORIGIN), "c"))
    assert observe_sentence(torn).endswith("flags: position_missing 0.2 s; supply pressure assumed")
    assert observe_json(torn, ORIGIN)["status"] == "warning"


def test_the_sentence_has_the_load_at_half_stroke_and_its_change_in_shares_of_the_peak(run):
    before, after = (float(load.force[50]) for load in loads(run)[1:])
    share = 100 * (after - before) / loads(run).before.force.max()
    expected = f"load at 12.5 mm {before:.0f} → {after:.0f} N ({share:+.1f} % of the peak), {len(run.strokes)} strokes"
    assert load_sentence(run) == expected


def test_after_a_resumed_run_the_calibrated_load_is_still_that_of_the_calibration(run, plant, log):
    first = observe_recording(run.observer, log.slice(0, 3000))
    rest = observe_recording(run.observer, log.slice(3000, len(log)), first.after)
    whole, other = (observe_json(part, ORIGIN) for part in (run, rest))
    assert whole["calibrated_load_curve"] == other["calibrated_load_curve"]
    assert whole["load_curve"] == other["load_curve"]
    assert loads(rest).before.force.tolist() == loads(first).after.force.tolist()


def test_the_table_of_parameters_has_their_values_before_and_after(run, plant):
    table = adapted_table(run, "t", ["F_C"])
    assert table.column("before") == (plant.value("F_C"),)
    assert table.column("after") == (estimates_of(run.observer, run.after)["F_C"].value,)
    assert table.column("meaning") == ("Coulomb friction",)
    weights = adapted_table(run, "t", list(plant.load.names))
    assert "meaning" not in [column.name for column in weights.columns]


def test_a_name_from_a_file_is_escaped(blank, plant, log):
    hostile = Log(log.time[:100], {name: values[:100] for name, values in log.columns.items()}, "<script>x</script>")
    html = page_of(document_of(Observation(observe_recording(observer(plant), hostile), ORIGIN), "c"))
    assert "<script>x" not in html
