"""`cut` on the virtual truck, which is noisy and vibrates, and on a real cylinder that is five times as long."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.strokes import sections_of
from clutchid.truck import drive, truck

EXPECTED = {
    "strokes": "full stroke",
    "gear-shift": "gear shift",
    "pull-away": "pull-away",
    "creep": "slip control",
    "staircase": "staircase",
    "ramps": "ramp",
}


@pytest.mark.parametrize("manoeuvre", EXPECTED)
@pytest.mark.parametrize("number", [0, 1, 5])
def test_a_drive_has_the_label_of_its_manoeuvre(manoeuvre, number):
    driven = drive(truck(number), manoeuvre=manoeuvre, seconds=20.0, seed=number, dropouts=5)
    moved = driven.log.with_columns(position=driven.log["position"] - 4e-3)
    strokes = [section for section in sections_of(moved) if section.kind == "stroke"]
    complete = strokes[:-1]  # the recording ends anywhere
    assert complete
    assert {section.label for section in complete} == {EXPECTED[manoeuvre]}


@pytest.mark.parametrize("recorder", ["controller", "bus"])
def test_a_stroke_leaves_the_rest_when_the_supply_opens(recorder):
    driven = drive(truck(2), manoeuvre="strokes", seconds=20.0, seed=3, recorder=recorder)
    strokes = [section for section in sections_of(driven.log) if section.kind == "stroke"]
    opens = np.flatnonzero(np.diff((driven.wanted > 0).astype(int), prepend=0) == 1) * 1e-3
    assert len(strokes) == len(opens)
    for section, wanted in zip(strokes, opens, strict=True):
        # a bin, a period of the valves, and on the bus two messages and the drift of its clock
        assert section.departure == pytest.approx(wanted, abs=0.05)


def test_a_cylinder_that_cycles_without_a_rest_is_bang_bang(data):
    time, position, _, pressure, *_ = np.genfromtxt(
        data("wbident_pneumatic_cylinder/cylinder_1kHz.csv"), delimiter=",", skip_header=1, unpack=True
    )
    log = Log(time, {"position": 1e-3 * position, "pressure_a": pressure})
    (section,) = sections_of(log)
    summary = section.summary
    assert section.label == "bang-bang"
    # quantised in steps of 0.204 mm; the README gives 16.7 to 107.8 mm
    assert summary.lowest == pytest.approx(16.7e-3, abs=3e-4)
    assert summary.highest == pytest.approx(107.8e-3, abs=3e-4)
    assert summary.level == pytest.approx(summary.lowest, abs=3e-4)
