"""The life of a clutch: trend, alarms, what is left."""

from datetime import UTC, datetime

import numpy as np
import pytest

from clutchid.documents.wear_rows import alarm_words, change_words, left_words, recordings_words, wear_lines
from clutchid.wear.history import Leak, RecordingJob, WearReading
from clutchid.wear.life import LifeLimits, to_estimate, wear_of
from clutchid.wear.trend import FALSE_ALARMS, LEAKING, LEAKS, WearTable
from fixtures.lives import leaking_life, life, reading

#: 1 mm of shift in 1e7 strokes.
RATE = 1e-10


def life_of(shifts, table=None, limit=None, loads=None):
    """Wear from shifts at every 10,000 strokes, with readings of 30 um."""
    loads = np.zeros(len(shifts)) if loads is None else loads
    return life(list(map(reading, shifts, loads)), table=table, limit=limit)


def test_a_steady_clutch_is_forecast():
    wear = life_of(RATE * 1e4 * np.arange(40), limit=0.1e-3)
    assert wear.then["shift"].value[-1] == pytest.approx(RATE * 39e4, abs=2e-6)
    assert wear.left.low < (0.1e-3 / RATE - 39e4) < wear.left.high
    assert wear.left.median == pytest.approx(0.1e-3 / RATE - 39e4, rel=0.1)
    assert wear.alarms == ()


def test_a_replaced_clutch_is_an_alarm_and_a_new_trend():
    shifts = RATE * 1e4 * np.concatenate([np.arange(30) + 10, np.arange(10)])
    loads = np.concatenate([np.linspace(0.02, 0.06, 30), np.linspace(0.0, 0.013, 10)])
    (alarm,) = life_of(shifts, loads=loads).alarms
    assert (alarm.after, alarm.before, alarm.kind) == ("r29", "r30", "replaced")
    (sudden,) = life_of(np.where(np.arange(40) < 30, shifts, shifts + 0.3e-3)).alarms
    assert sudden.kind == "sudden"
    assert sudden.shift > 0.2e-3


@pytest.mark.parametrize("with_table", [False, True])
def test_a_wrong_reading_is_no_new_clutch_and_the_true_one_is_found(with_table):
    wear = leaking_life(with_table=with_table)
    assert [(alarm.kind, alarm.before) for alarm in wear.alarms] == [("replaced", "r12")]
    assert [k for k, outcome in enumerate(wear.outcomes) if outcome == "left out"] == [9]
    last = wear.present["shift"]
    assert last.high - last.low < 0.15e-3
    assert abs(last.value) < 0.06e-3
    assert wear.outcomes[12:] == ("jump", "used")
    if with_table:
        assert 0.0 <= wear.present["wear"].low < 0.15e-3 < wear.present["wear"].high < 0.6e-3, "it has worn by 0.15 mm"


@pytest.mark.parametrize("with_table", [False, True])
def test_what_is_not_sure_is_no_alarm_and_waits(with_table):
    wear = leaking_life(with_table=with_table, count=10)
    assert wear.alarms == ()
    assert wear.outcomes[9] == "left out"
    assert "the next recordings will show" in wear.rows[9].reason


def test_a_change_between_fault_and_new_clutch_is_unknown():
    shifts, loads = 4e-10 * 1e4 * np.arange(40.0), 1.6e-7 * 1e4 * np.arange(40.0)
    shifts[30:] += 0.06e-3 - shifts[30]
    loads[30:] += 0.06 - loads[30]
    wear = life_of(shifts, loads=loads, limit=0.5e-3)
    (alarm,) = wear.alarms
    assert (alarm.kind, alarm.before) == ("unknown", "r30")
    assert alarm.probability >= 0.95
    assert "the recordings so far do not show which" in alarm_words(alarm)
    assert wear.left is None
    assert left_words(wear) == "unknown, because the load changed before r30; find the cause"


def test_a_rate_is_known_from_readings_and_not_after_a_sudden_change():
    shifts = RATE * 1e4 * np.arange(40)
    assert life_of(shifts).present_rate.value == pytest.approx(RATE, rel=0.2)
    assert np.isnan(life_of(shifts[:3]).present_rate.value), "that of the prior"
    assert np.isnan(life_of(np.where(np.arange(40) < 30, shifts, shifts + 0.3e-3)).present_rate.value)


def test_a_wear_of_anything_in_its_table_is_unknown():
    y = np.linspace(0.0, 3.5e-3, 8)
    wear = life([reading(0.0, 0.0)], table=WearTable(y, 1e-3 * y, 0.1 * y))
    assert np.isnan(wear.present["wear"].value)
    assert change_words(wear).startswith("wear of the facing unknown")


def test_a_change_that_was_not_sure_when_it_became_final_is_no_surer_later():
    shifts = 6e-6 * np.random.default_rng(9).standard_normal(24) + np.where(np.arange(24) < 10, 0.0, 3.3e-5)
    waiting, final = life_of(shifts[:12]), life_of(shifts)
    ((possible,), (alarm,)) = waiting.suspects, final.alarms
    assert (waiting.alarms, possible.kind, possible.before) == ((), "unknown", "r10")
    assert alarm_words(possible).endswith("may have changed between r09 and r10; the next recordings will show it")
    assert (alarm.kind, alarm.before, final.suspects) == ("replaced", "r10", ())
    assert 0.5 < possible.probability < 0.95
    assert alarm.probability == pytest.approx(possible.probability, abs=0.2), "readings far from it say nothing of it"


def test_the_size_of_a_change_has_an_interval_in_which_the_errors_of_all_readings_cancel():
    noise = 6e-6 * np.random.default_rng(5).standard_normal(24)
    (alarm,) = life_of(1e-4 + noise + np.where(np.arange(24) < 12, 0.0, 0.3e-3)).alarms
    assert abs(alarm.shift - 0.3e-3) < 2.0 * alarm.shift_std < 3e-5


def test_a_recording_far_from_those_around_it_is_a_wrong_file_and_no_alarm():
    shifts = np.linspace(0.0, 1e-4, 12)
    shifts[6] += 5e-4
    wear = life_of(shifts)
    ((suspect,), foreign) = wear.suspects, WearReading("warning", "of another truck.", departs=True)
    assert (wear.alarms, suspect.kind, suspect.after, suspect.before) == ((), "wrong file", "r05", "r06")
    assert suspect.shift == pytest.approx(5e-4, abs=2e-5)
    assert "probably of another truck, r06: it differs by +0.50" in alarm_words(suspect)
    (suspect,) = life([foreign if k == 6 else reading(0.0) for k in range(12)]).suspects
    assert (suspect.kind, suspect.before) == ("wrong file", "r06")
    assert life([foreign if k == 11 else reading(0.0) for k in range(12)]).suspects == (), "nothing is known after it"


def test_the_interval_of_a_leak_holds_the_trucks_whose_leak_is_read_several_times_too_large():
    (alarm,) = alarmed(leaks=(4, 5), leak=2e-11)
    for factor in (1.0, 1.6, 2.1, 3.3):
        assert alarm.leak_interval.low < 2e-11 / factor < alarm.leak_interval.high
    assert alarm_words(alarm).endswith("2.0e-11 m³/(Pa·s), 0.083 g/s at 5 bar(g); the truck's is 5.4e-12 to 2.6e-11")


def test_a_certain_leak_that_is_no_alarm_is_that_of_seals_that_age():
    old = life([reading(0.0, leak=Leak(7e-12, 1e-12, 0.99))] * 2)
    assert wear_lines(old)[2].split(maxsplit=1)[1] == "7.0e-12 m³/(Pa·s), 0.029 g/s at 5 bar(g), as seals age"
    assert life([reading(0.0, leak=Leak(7e-12, 1e-12, 0.9))] * 2).aged == 0.0


def alarmed(leaks=(), departs=(), missing=(), leak=2e-11):
    """Alarms of 12 recordings: those that read a leak, depart from the calibration, or cannot be read."""
    leak_by_number = {k: Leak(leak, 1e-12, 0.99) for k in leaks}
    shifts = [np.nan if k in missing else 0.0 for k in range(12)]
    return life(
        [reading(s, leak=leak_by_number.get(k), departs=k in departs) for k, s in enumerate(shifts)], stride=0
    ).alarms


def test_a_leak_is_an_alarm_where_two_readings_in_a_row_have_it():
    assert alarmed(leaks=(4,)) == ()
    assert alarmed(leaks=(4, 5), leak=7e-12) == (), "seals age"
    (alarm,) = alarmed(leaks=(4, 5, 6, 8, 9))
    assert (alarm.kind, alarm.after, alarm.before, alarm.leak) == ("leak", "r03", "r04", 2e-11)
    (alarm,) = alarmed(leaks=(4, 6), missing=(5,))
    assert alarm.before == "r04"
    assert [alarm.before for alarm in alarmed(leaks=(1, 2, 8, 9))] == ["r01", "r08"], "a mended one may leak again"
    (alarm,) = alarmed(leaks=(0, 1))
    assert (alarm.after, alarm.before) == ("", "r00")
    assert "began to leak before r00" in alarm_words(alarm)
    (alarm,) = alarmed(leaks=(4, 5), missing=(2, 3))
    assert (alarm.after, alarm.before) == ("r01", "r04"), "r02 and r03 could not be read"


def test_the_false_alarms_of_two_readings_are_as_many_as_chosen():
    assert pytest.approx(FALSE_ALARMS) == (1.0 - LEAKING) ** LEAKS


def test_a_calibration_that_no_longer_holds_is_an_alarm_after_three_readings():
    assert alarmed(departs=(4, 5)) == ()
    (alarm,) = alarmed(departs=(4, 5, 6, 7))
    assert (alarm.kind, alarm.before) == ("departed", "r04")
    both = alarmed(leaks=(4, 5), departs=(7, 8, 9))
    assert [alarm.kind for alarm in both] == ["leak", "departed"]


def test_recordings_without_a_measurement_are_bridged():
    shifts = RATE * 1e4 * np.arange(30)
    bridged, readings = (3, 10, 11, 29), list(map(reading, shifts))
    for k in bridged:
        readings[k] = WearReading("warning", "of another truck.")
    wear = life(readings, limit=1e-3)
    assert tuple(k for k, outcome in enumerate(wear.outcomes) if outcome == "missing") == bridged
    assert np.isfinite(wear.then["shift"].value).all()
    nothing = life_of(np.full(3, np.nan), limit=1e-3)
    assert (nothing.left, nothing.recordings, len(nothing.rows)) == (None, 3, 3)
    assert np.isnan(nothing.present_rate.value)


#: Files beside the recordings of a clutch, by what became of them, and whether they are recordings of it.
BESIDE = {
    "bad_input": (WearReading("bad_input", "cut.parquet: ends early.", apart=True), False),
    "refused": (WearReading("bad_input", "the duty cycles are swapped.", clock="2026-03-01"), True),
    "failed": (WearReading("failed", "did not converge.", clock="2031-01-01"), True),
    "timed_out": (WearReading("timed_out", "took too long."), True),
    "killed": (WearReading("killed", "its process ended on it."), True),
    "copy": (reading(3e-4, leak=Leak(2e-11, 1e-12, 0.99), departs=True, apart=True), False),
}


@pytest.mark.parametrize("kind", BESIDE)
@pytest.mark.parametrize("axis", ["strokes", "km", "days"])
def test_files_without_a_reading_change_nothing_of_a_life(axis, kind):
    """Whatever their names are, and however many there are."""
    places = {"strokes": "strokes", "km": "odometer", "days": "begin"}
    steps = [datetime(2026, 1, 1 + k, tzinfo=UTC) if axis == "days" else 1e4 * k for k in range(12)]
    jobs = [RecordingJob(f"r{k:02d}", **{places[axis]: step}) for k, step in enumerate(steps)]
    readings = [reading(shift) for shift in 3e-6 * np.arange(12.0)]
    beside, is_recording = BESIDE[kind]
    names = ["cut", *(f"sales_2026-01-{k + 1:02d}" for k in range(24))]
    alone, together = (
        wear_of("V1", [*map(RecordingJob, more), *jobs], [*[beside] * len(more), *readings], LifeLimits(1e-4))
        for more in ((), names)
    )
    assert together.axis == axis
    assert together.left == alone.left
    assert (together.warnings, together.alarms, together.outcomes) == (alone.warnings, (), alone.outcomes)
    for when in ("then", "now", "rate"):
        np.testing.assert_array_equal(getattr(together, when)["shift"], getattr(alone, when)["shift"])
    assert together.recordings == (37 if is_recording else 12)
    assert {row.outcome for row in together.rows[12:]} == {"missing"}
    assert all(row.reason for row in together.rows[12:]) or kind == "copy"
    words = "12 of 37 count, 25 without a measurement" if is_recording else "25 other files, not a recording or a copy"
    assert words in recordings_words(together)


def test_the_wear_of_the_facing_needs_a_table():
    y = np.linspace(0.0, 3.5e-3, 8)
    table = WearTable(y, 0.05 * y, 20.0 * y)
    true = 0.5e-3 + 30e-6 * np.arange(30)
    wear = life_of(0.05 * true, table, loads=20.0 * true)
    assert wear.limit == 3.5e-3
    assert wear.then["wear"].value[-1] == pytest.approx(true[-1], rel=0.05)
    assert wear.then["wear"].low[-1] < true[-1] < wear.then["wear"].high[-1]
    assert wear.left.low < (3.5e-3 - true[-1]) / 30e-6 * 1e4 < wear.left.high
    shorter = life_of(0.05 * true, table, limit=0.1e-3, loads=20.0 * true)
    assert shorter.limit == pytest.approx(2e-3)
    assert "wear" not in life_of(0.05 * true).then


def test_what_the_trend_does_not_expect_or_an_alarm_names_is_estimated_in_the_order_of_the_life():
    shifts = [0.0, 0.004, 0.4, 0.008, 0.012, 0.016, 0.02, -0.2, -0.196, -0.192]
    readings = [reading(1e-3 * shift, by="observe") for shift in shifts]
    readings = [row._replace(measurement=row.measurement._replace(by="observe")) for row in readings]
    wear = life(readings)
    assert wear.outcomes[2] == "left out"
    assert (wear.alarms[0].after, wear.alarms[0].before) == ("r06", "r07")
    assert [job.recording for job in to_estimate(wear)] == ["r02", "r06", "r07"]
    estimated = [row._replace(by="estimate") if k in (2, 7) else row for k, row in enumerate(readings)]
    assert [job.recording for job in to_estimate(life(estimated))] == ["r06"]
    assert to_estimate(life(readings[3:7])) == ()
