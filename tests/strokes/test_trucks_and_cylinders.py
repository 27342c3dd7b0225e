"""`cut` on the virtual truck, which is noisy and vibrates, and on a real cylinder that is five times as long."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.strokes import sections_of
from clutchid.truck import drive, truck


@pytest.mark.parametrize("recorder", ["controller", "bus"])
def test_a_stroke_leaves_the_rest_when_the_supply_opens(recorder):
    driven = drive(truck(2), manoeuvre="strokes", seconds=20.0, seed=3, recorder=recorder)
    strokes = [section for section in sections_of(driven.log) if section.kind == "stroke"]
    opens = np.flatnonzero(np.diff((driven.wanted > 0).astype(int), prepend=0) == 1) * 1e-3
    assert len(strokes) == len(opens)
    for section, wanted in zip(strokes, opens, strict=True):
        # a bin, a period of the valves, and on the bus two messages and the drift of its clock
        assert section.departure == pytest.approx(wanted, abs=0.05)


def test_a_cylinder_that_cycles_without_a_rest_is_one_stroke(data):
    time, position, _, pressure, *_ = np.genfromtxt(
        data("wbident_pneumatic_cylinder/cylinder_1kHz.csv"), delimiter=",", skip_header=1, unpack=True
    )
    log = Log(time, {"position": 1e-3 * position, "pressure_a": pressure})
    (section,) = sections_of(log)
    summary = section.summary
    assert section.kind == "stroke"
    # quantised in steps of 0.204 mm; the README gives 16.7 to 107.8 mm
    assert summary.lowest == pytest.approx(16.7e-3, abs=3e-4)
    assert summary.highest == pytest.approx(107.8e-3, abs=3e-4)
    assert summary.level == pytest.approx(summary.lowest, abs=3e-4)
