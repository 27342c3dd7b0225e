"""The vented rest over a life: wear lets it fall slowly, a sensor moves it at once, a new clutch lifts it again."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.wear_rows import alarm_words, left_words, wear_lines
from clutchid.estimation.assess.comparison import Measurement
from clutchid.strokes.vented_rest import RestShift
from clutchid.wear.alarms import rest_moves
from clutchid.wear.trend import WearTable
from fixtures.lives import life, reading

#: Strokes of a life, and from a recording to the next; fall of the rest in m from one to the next.
LIFE, WEEK, FALL = 1e6, 7e3, 7.4e-6


def rest(value: float) -> RestShift | None:
    return None if np.isnan(value) else RestShift(value, value - 1.7e-5, value + 1.7e-5)


def causes(values, *, apart=WEEK, replaced=(), measurements=None) -> list[str]:
    s = apart * np.arange(len(values))
    moves = rest_moves(s, LIFE, [rest(v) for v in values], measurements or [None] * len(values), replaced)
    return [("!" if move.sudden else "") + move.cause for move in moves]


def test_a_learned_zero_never_moves():
    assert causes(np.zeros(30)) == [""] * 30


def test_a_kept_zero_falls_with_wear():
    reasons = causes(-FALL * np.arange(60))
    assert reasons[0] == ""
    assert reasons[-1] == "wear"
    assert not any("!" in reason for reason in reasons)


@pytest.mark.parametrize("step", [3e-4, -3e-4])
@pytest.mark.parametrize("pace", [0.0, FALL])
def test_a_sensor_moves_at_once_upwards_or_faster_than_wear(step, pace):
    values = -pace * np.arange(40) + step * (np.arange(40) >= 20)
    reasons = causes(values)
    assert reasons[20] == "!sensor"
    assert sum("!" in reason for reason in reasons) == 1


def test_a_step_is_found_across_recordings_without_a_rest():
    values = np.where(np.arange(12) < 6, 0.0, 3e-4)
    values[5:7] = np.nan
    assert causes(values)[7] == "!sensor"


def test_a_fall_that_a_long_time_explains_is_wear():
    assert "!" not in "".join(causes([0.0, -3e-4], apart=1e5))
    assert causes([0.0, -3e-4], apart=1e3)[1] == "!sensor"


def test_a_new_clutch_lifts_a_rest_that_had_fallen():
    values = np.concatenate([-FALL * np.arange(60), -FALL * np.arange(5)])
    new = Measurement(0.0, 2e-5, 0.0, 0.01, np.nan)
    worn = Measurement(2e-4, 2e-5, 0.08, 0.01, np.nan)
    assert causes(values, measurements=[worn] * 60 + [new] * 5)[60] == "new clutch"
    assert causes(values, measurements=[worn] * 65)[60] == "!sensor", "the load is not as new"
    assert causes(values, replaced={60})[60] == "new clutch"


def life_of(shifts, rests, *, loads=None, table=None, limit=1e-3):
    loads = 20.0 * np.asarray(shifts) if loads is None else loads
    readings = [reading(s, load, rest=rest(r)) for s, load, r in zip(shifts, loads, rests, strict=True)]
    return life(readings, stride=WEEK, table=table, limit=limit)


def test_a_sensor_that_moves_is_an_alarm_of_its_own_and_no_wear():
    life = life_of(1e-6 * np.arange(30), np.where(np.arange(30) < 15, 0.0, 3e-4))
    (alarm,) = life.alarms
    assert (alarm.kind, alarm.after, alarm.before) == ("sensor moved", "r14", "r15")
    assert alarm.rest == pytest.approx(3e-4)
    assert "vented rest moved by +0.30 mm; this is not counted as wear" in alarm_words(alarm)
    assert life.left is not None
    assert [rest.cause for rest in life.rests].count("sensor") == 1


def test_what_is_left_is_unknown_after_a_sudden_change():
    shifts = 1e-6 * np.arange(40) + 3e-4 * (np.arange(40) >= 20)
    life = life_of(shifts, np.zeros(40))
    assert [alarm.kind for alarm in life.alarms] == ["sudden"]
    assert life.left is None
    assert left_words(life) == "unknown, because the load changed suddenly before r20; find the cause"
    assert any("unknown, because" in line for line in wear_lines(life))


def test_a_life_without_an_end_in_sight_is_said_without_a_number_of_strokes():
    life = life_of(1e-6 * np.arange(30), np.zeros(30))
    endless = replace(life, left=(4.3e5, np.inf, np.inf), axis="strokes", limit=3.5e-3)
    assert left_words(endless) == "no end in sight to 3.50 mm of shift (430,000 strokes to no end in sight, 90 %)"
    limited = replace(endless, left=(2.2e5, 4.6e5, np.inf))
    assert left_words(limited) == "460,000 strokes to 3.50 mm of shift (220,000 to no end in sight, 90 %)"


def test_no_wear_is_given_beyond_the_end_of_its_table():
    wear = np.linspace(0.0, 3.5e-3, 8)
    table = WearTable(wear, 0.05 * wear, 20.0 * wear)
    true = 1e-4 * np.arange(60)
    life = life_of(0.05 * true, np.zeros(60), loads=20.0 * true, table=table, limit=None)
    for band in (life.then["wear"], life.now["wear"]):
        assert max(side.max() for side in band) == 3.5e-3
    (line,) = [line for line in wear_lines(life) if line.startswith("now")]
    assert "facing worn beyond the end of its table, 3.50 mm" in line
    assert life.left.median == 0.0
