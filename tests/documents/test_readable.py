"""Pages that can be read: legends beside the loads, text that is large enough, and one unit of force."""

import re
from itertools import chain

import numpy as np
import pytest
from matplotlib.text import Text

from clutchid.documents import document_of, observation, wear
from clutchid.documents.comparison import comparison_figure
from clutchid.documents.diagnosis import colour_figure
from clutchid.documents.figures import legend, new_figure
from clutchid.documents.fit_figures import load_figure, recording_figure
from clutchid.documents.html import page_of
from clutchid.documents.results import Observation, WornClutch
from clutchid.estimation.assess.evidence import evidence
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.observer import observe_recording, observer
from clutchid.observer.run import loads
from fixtures.baselines import with_baseline
from fixtures.figures import legends_on_the_engaging_range, smallest_text
from fixtures.lives import life, reading

#: Least height in px of text on a page of 500 px.
READABLE = 10.0


@pytest.fixture(scope="module")
def compared(fitted):
    return with_baseline(fitted, std=2e4)


@pytest.fixture(scope="module")
def run(plant, recorded_by):
    return observe_recording(observer(plant), recorded_by(plant, seconds=6.0))


@pytest.fixture(scope="module")
def worn(curves):
    shifts = (0.0, 0.0, 1e-3, 1e-3)
    readings = [reading(shift, curve=curve) for shift, (_, curve) in zip(shifts, curves, strict=False)]
    return life(readings, stride=0, limit=1e-3)


@pytest.fixture(scope="module")
def curves():
    y = np.linspace(0.0, 0.025, 51)
    force = 4000.0 * np.sin(y / 0.012)
    band = (force - 50.0, force + 50.0)
    return [(f"a_recording_with_a_long_name_{k}", LoadCurve(y, force + k, *band)) for k in range(6)]


@pytest.fixture(scope="module")
def of_loads(compared, run, curves):
    """Figures of loads over the position."""
    return {
        "fit": load_figure(compared),
        "comparison": comparison_figure(compared.comparison),
        "observe": observation.loads_figure(loads(run)),
        "track": wear.life_figure(curves),
    }


@pytest.fixture(scope="module")
def others(compared, run, worn):
    """All other figures of pages."""
    diagnosis = evidence(compared).diagnoses["first"]
    return {
        "recording": recording_figure(compared.recordings["first"]),
        "colour": colour_figure(diagnosis),
        "strokes": observation.strokes_figure(run),
        "samples": observation.samples_figure(run),
        "trend": wear.trend_figure(worn),
    }


@pytest.mark.slow
def test_no_legend_covers_the_range_in_which_the_clutch_engages(of_loads):
    assert [name for name, figure in of_loads.items() if legends_on_the_engaging_range(figure)] == []


@pytest.mark.slow
def test_all_text_of_figures_can_be_read_on_a_page_of_500_px(of_loads, others):
    sizes = {name: smallest_text(figure) for name, figure in {**of_loads, **others}.items()}
    assert {name: size for name, size in sizes.items() if size < READABLE} == {}


def test_a_legend_is_no_wider_than_its_figure_however_long_its_words_are():
    figure, (axis,) = new_figure([2.0])
    for k in range(4):
        axis.plot([0, 1], [0, k], label=f"{k} $ {'words ' * 5}")
    legend(axis, 4)
    figure.draw_without_rendering()
    box = axis.get_legend()
    assert box._ncols < 4
    assert box.get_window_extent().width < figure.get_window_extent().width


@pytest.mark.slow
def test_a_force_is_in_newtons_on_every_page(blank, compared, run, worn, of_loads, others):
    pages = [page_of(document_of(result, "c")) for result in (compared, Observation(run, Origin()), WornClutch(worn))]
    written = {name: [text.get_text() for text in figure.findobj(Text)] for name, figure in (of_loads | others).items()}
    assert [name for name in of_loads if not any("load [N]" in text for text in written[name])] == []
    assert [
        text for text in chain(pages, *written.values()) if re.search(r"\bkN\b", re.sub(r"base64,[\w+/=]+", "", text))
    ] == []
