"""`cut` finds strokes and rests in any recording."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.strokes import sections_of
from clutchid.strokes.borders import LEAD, LONGEST_SECTION
from clutchid.strokes.stroke import BEGINS

REACH = 0.022


def kind_of(section):
    """The kind of a section, and of a rest whether the chamber is vented in it."""
    return "vented rest" if section.kind == "rest" and section.summary.vented_rest > 0 else section.kind


def kinds_of(log):
    return [kind_of(section) for section in sections_of(log)]


def test_strokes_and_rests_alternate_and_their_borders_are_found(made, full_strokes):
    log = made(full_strokes([2.0, 6.0], 10.0))
    sections = list(sections_of(log))
    assert [kind_of(section) for section in sections] == ["vented rest", "stroke"] * 2 + ["vented rest"]
    for section, leaves in zip(sections[1::2], (2.0, 6.0), strict=True):
        # a border is one of a bin of 10 ms; on the way back, at 73 mm/s, noise (0.1 mm) hides the last 1.4 ms
        assert section.departure == pytest.approx(leaves, abs=0.02)
        assert section.start == pytest.approx(leaves - LEAD, abs=0.02)
        assert section.end == pytest.approx(leaves + 1.2, abs=0.02)


def test_the_summary_of_a_stroke(made, full_strokes):
    log = made(full_strokes([2.0], 6.0), zero=-3e-3, pressure=True)
    _, stroke, _ = sections_of(log)
    summary = stroke.summary
    # a bin's median of ten samples with 20 um of noise and 12 um of quantisation is off by less than 50 um
    assert summary.level == pytest.approx(-3e-3, abs=5e-5)
    assert summary.lowest == pytest.approx(-3e-3, abs=5e-5)
    assert summary.highest == pytest.approx(REACH - 3e-3, abs=5e-5)
    assert summary.reach == pytest.approx(REACH, abs=1e-4)
    # and a speed over 40 ms by less than 2 * 50 um / 40 ms
    assert summary.vented_rest == pytest.approx(2.0, abs=0.03)
    assert summary.missing == 0.0


@pytest.mark.parametrize(
    ("scale", "recorded"),
    [
        (1.0, {"noise": 5e-5, "quantum": 1e-5, "zero": 1e-2}),
        (5.0, {"noise": 2e-5, "quantum": 2e-4, "zero": 1e-2}),
        (0.2, {"noise": 1e-6, "quantum": 0.0, "zero": 1e-2}),
        *((1.0, {"rate": rate}) for rate in (100.0, 250.0, 5000.0)),
    ],
)
def test_size_noise_quantum_and_sample_rate_do_not_matter(made, full_strokes, scale, recorded):
    log = made(full_strokes([2.0, 5.0], 9.0, REACH * scale), **recorded)
    assert kinds_of(log) == ["vented rest", "stroke", "vented rest", "stroke", "vented rest"]


def test_the_position_alone_is_enough(made, full_strokes):
    sections = list(sections_of(made(full_strokes([2.0], 6.0), inputs=False)))
    assert [kind_of(section) for section in sections] == ["vented rest", "stroke", "vented rest"]


def test_a_zero_that_drifts_by_millimetres_is_followed(made, full_strokes):
    starts = np.arange(5.0, 1190.0, 10.0).tolist()
    log = made(full_strokes(starts, 1200.0))
    drifting = log.with_columns(position=log["position"] + 3e-3 * log.time / 1200)
    strokes = [section for section in sections_of(drifting) if section.kind == "stroke"]
    # a bin of 10 ms, and another where its median is off by the noise
    assert [section.departure for section in strokes] == pytest.approx(starts, abs=0.04)
    levels = np.array([section.summary.level for section in strokes])
    # the level of a block of 65 s is the middle one: off by half of what drifts in it
    assert np.abs(levels - 3e-3 * np.array(starts) / 1200).max() < 3e-3 / 1200 * 65.536 / 2 + 5e-5


def test_a_recording_that_never_moves_is_a_vented_rest(made):
    for seconds, kind in ((0.002, "rest"), (3.0, "vented rest"), (200.0, "vented rest")):
        assert kinds_of(made([(0.0, 0.0), (seconds, 0.0)], zero=2e-3)) == [kind]


def test_a_rest_under_pressure_is_held(made):
    log = made([(0.0, 5e-3), (3.0, 5e-3)], pressure=True)
    assert kinds_of(log) == ["rest"]


def test_a_rest_under_pressure_is_no_vented_one_before_the_stroke_that_follows(made, full_strokes):
    log = made(full_strokes([2.0, 6.0], 10.0), pressure=True)
    pressed = log.with_columns(pressure_a=log["pressure_a"] + 3e5)
    sections = list(sections_of(pressed))
    assert [kind_of(section) for section in sections] == ["rest", "stroke", "rest", "stroke", "rest"]
    assert [section.summary.vented_rest for section in sections] == [0.0] * 5
    # without pressure nobody can tell
    bare = Log(log.time, {name: values for name, values in log.columns.items() if name != "pressure_a"})
    assert next(sections_of(bare)).summary.vented_rest == pytest.approx(2.0, abs=0.03)


def test_a_recording_may_begin_and_end_in_the_middle_of_a_stroke(made):
    log = made([(0.0, REACH), (0.6, REACH), (0.9, 0.0), (4.0, 0.0), (4.15, REACH), (5.0, REACH)])
    first, rest, last = sections_of(log)
    assert (first.kind, kind_of(rest), last.kind) == ("stroke", "vented rest", "stroke")
    assert first.summary.vented_rest == 0.0
    assert first.departure == first.start == 0.0
    assert last.end == log.time[-1]
    assert last.departure == pytest.approx(4.0, abs=0.02)


def test_a_hole_in_time_and_a_missing_input_end_a_section(made, full_strokes):
    log = made(full_strokes([2.0, 6.0], 10.0))
    duty = log["duty_supply"].copy()
    duty[7100:7103] = np.nan
    broken = log.with_columns(duty_supply=duty)
    sections = list(sections_of([broken.slice(0, 2500), broken.slice(2520, len(log))]))
    starts = [section.start for section in sections]
    assert {2.52, 7.103} <= set(starts)
    assert {2.499, 7.099} <= {section.end for section in sections}
    assert sum(map(len, sections)) == len(log) - 20 - 3
    after = sections[starts.index(2.52)]
    assert (after.kind, after.summary.vented_rest) == ("stroke", 0.0)


def test_missing_positions_are_no_border(made, full_strokes):
    log = made(full_strokes([2.0], 6.0))
    position = log["position"].copy()
    position[2050:2110] = position[3000:3040] = np.nan
    _, stroke, _ = sections_of(log.with_columns(position=position))
    assert stroke.summary.missing == pytest.approx(100 / len(stroke))


def test_where_no_position_is_known_nothing_is_said_of_it(made):
    log = made([(0.0, 0.0), (20.0, 0.0)])
    (section,) = sections_of(log.with_columns(position=np.full(len(log), np.nan)))
    assert section.summary.missing == 1.0


def test_a_supply_pulse_that_moves_nothing_belongs_to_the_rest_but_the_vented_rest_begins_after_it(made, full_strokes):
    log = made(full_strokes([5.0], 8.0))
    duty = log["duty_supply"].copy()
    duty[3000:3020] = 0.3
    rest, stroke, _ = sections_of(log.with_columns(duty_supply=duty))
    assert kind_of(rest) == "vented rest"
    assert stroke.summary.vented_rest == pytest.approx(5.0 - 3.02, abs=0.03)


def test_a_supply_pulse_shortly_before_the_motion_belongs_to_the_stroke(made, full_strokes):
    log = made(full_strokes([5.0], 8.0))
    duty = log["duty_supply"].copy()
    duty[4700:4720] = duty[4300:4320] = 0.3
    _, stroke, _ = sections_of(log.with_columns(duty_supply=duty))
    assert stroke.departure == pytest.approx(4.3, abs=0.02)


def test_where_the_pressure_is_measured_a_rest_is_vented_when_the_air_is_out(made, full_strokes):
    log = made(full_strokes([1.0, 4.0], 8.0), pressure=True)
    slow = 4e5 * np.exp(-(log.time - 2.2) / 0.2) * (log.time >= 2.2) * (log.time < 4.0)
    *_, stroke, _ = sections_of(log.with_columns(pressure_a=log["pressure_a"] + slow))
    # at 1.1 times the lowest pressure, about 1e5 Pa, 0.1e5 Pa are left: 0.2 s * log(40) after the end of the stroke
    assert stroke.summary.vented_rest == pytest.approx(4.0 - 2.2 - 0.2 * np.log(40), abs=0.1)


@pytest.mark.parametrize("rate", [0.5, 1.0, 1.5, 2.0])
def test_a_recording_whose_samples_are_as_far_apart_as_the_rest_before_a_stroke(made, rate):
    log = made([(0.0, 0.0), (10.0, 0.0), (14.0, REACH), (24.0, 0.0), (40.0, 0.0)], rate=rate)
    before, stroke, after = sections_of(log)
    assert (before.kind, stroke.kind, after.kind) == ("rest", "stroke", "rest")
    assert stroke.start == pytest.approx(10.0, abs=1.0 / rate)
    assert stroke.end == pytest.approx(24.0, abs=1.0 / rate)


def test_a_long_hold_is_a_section_of_its_own(made):
    log = made([(0.0, 0.0), (1.0, 0.0), (1.15, REACH), (40.0, REACH), (40.3, 0.0), (45.0, 0.0)])
    sections = list(sections_of(log))
    assert [kind_of(section) for section in sections][2] == "rest"
    assert [section.kind for section in sections] == ["rest", "stroke", "rest", "stroke", "rest"]
    assert [section.divided for section in sections] == [False, False, True, False, False]
    # of the 38.85 s at the top half a second goes with either stroke, and what is still is so over 0.15 s and a bin
    assert sections[2].seconds == pytest.approx(38.85 - 2 * LEAD, abs=0.15 + 0.02)


def test_a_stroke_that_is_too_long_is_divided_and_a_hole_or_a_rest_divides_none(made):
    times = np.arange(0.0, 400.0, 2.0)
    log = made([(0.0, 0.0), *zip(1.0 + times, np.where(times % 4.0, 5e-3, REACH), strict=True), (405.0, 0.0)])
    strokes = [section for section in sections_of(log) if section.kind == "stroke"]
    first, *others = [section.divided for section in strokes]
    assert not first
    assert others
    assert all(others)
    assert not any(section.divided for section in sections_of(log.slice(0, 100_000)))
    with_hole = Log(log.time + (log.time > 50.0), log.columns)
    assert [section.divided for section in sections_of(with_hole.slice(0, 100_000))].count(True) == 0


def test_slow_motion_is_a_stroke_and_only_the_hold_within_it_is_held(made):
    log = made([(0.0, 0.0), (2.0, 0.0), (27.0, REACH), (67.0, REACH), (92.0, 0.0), (95.0, 0.0)])
    sections = list(sections_of(log))
    assert [section.kind for section in sections] == ["rest", "stroke", "rest", "stroke", "rest"]
    # the last of the way to a hold, up to where a stroke begins, belongs to it: some seconds at 0.9 mm/s
    slow = BEGINS / (REACH / 25.0)
    assert (sections[2].start, sections[2].end) == pytest.approx((27.0, 67.0), abs=slow)
    assert kinds_of(made([(0.0, 5e-3), (25.0, REACH)])) == ["stroke"]
    leaking = made([(0.0, 0.0), (2.0, 0.0), (2.2, REACH), (42.0, REACH - 3e-3), (42.3, 0.0), (45.0, 0.0)])
    assert [section.kind for section in sections_of(leaking)] == ["rest", "stroke", "rest", "stroke", "rest"]


def test_a_rest_of_hours_comes_in_parts_and_the_stroke_after_it_knows_how_long_it_was(made, full_strokes):
    log = made(full_strokes([1100.0], 1105.0))
    sections = list(sections_of(log))
    assert max(map(len, sections)) <= LONGEST_SECTION + 2**16
    assert [section.kind for section in sections].count("stroke") == 1
    stroke = sections[-2]
    assert stroke.summary.vented_rest == pytest.approx(1100.0, abs=0.05)
    assert stroke.start == pytest.approx(1100.0 - LEAD, abs=0.02)


def test_a_supply_pulse_late_in_a_long_rest_ends_what_was_vented_before(made, full_strokes):
    log = made(full_strokes([600.0], 605.0))
    pulsed = np.where((log.time > 590.0) & (log.time < 590.2), 0.3, log["duty_supply"])
    *_, stroke, _ = sections_of(log.with_columns(duty_supply=pulsed))
    # a pulse is known to a bin
    assert stroke.summary.vented_rest == pytest.approx(600.0 - 590.2, abs=0.03)


def test_one_bin_off_the_level_is_no_border_of_a_rest(made):
    log = made([(0.0, 0.0), (8.0, 0.0)])
    for samples, kinds in ((10, ["rest"]), (30, ["rest", "stroke", "rest"])):
        position = log["position"].copy()
        position[4000 : 4000 + samples] += 5e-3
        assert [section.kind for section in sections_of(log.with_columns(position=position))] == kinds


@pytest.mark.parametrize(("rest", "kinds"), [(0.6, ["stroke", "stroke"]), (0.9, ["stroke", "rest", "stroke"])])
def test_what_is_left_of_a_short_rest_goes_with_the_stroke_after_it(made, full_strokes, rest, kinds):
    log = made(full_strokes([2.0, 3.2 + rest], 8.0 + rest))
    sections = list(sections_of(log))[1:-1]
    assert [section.kind for section in sections] == kinds
    # half a second goes with the stroke, and less than 0.15 s is no rest of its own
    lead = sections[-1].departure - sections[-1].start
    assert lead == pytest.approx(LEAD if rest > LEAD + 0.15 else rest, abs=0.03)


def test_a_recording_that_begins_with_an_open_valve_begins_with_a_pulse(made):
    log = made([(0.0, 0.0), (0.15, REACH), (0.9, REACH), (1.2, 0.0), (4.0, 0.0)])
    stroke = next(section for section in sections_of(log) if section.kind == "stroke")
    assert (log["duty_supply"][0] > 0, stroke.first) == (True, 0)


def test_motion_without_an_end_is_divided_and_only_the_first_part_has_the_vented_rest_before_it():
    t = np.arange(700_000) / 1000
    log = Log(t, {"position": 0.01 * (1 - np.cos(2 * np.pi * (t - 5.0))) * (t > 5.0)})
    rest, first, *others = sections_of(log)
    assert max(map(len, others)) <= LONGEST_SECTION + 2**16
    assert (kind_of(rest), {kind_of(section) for section in (first, *others)}) == ("vented rest", {"stroke"})
    assert sum(map(len, (rest, first, *others))) == len(log)
    assert first.summary.vented_rest > 4.5
    assert {section.summary.vented_rest for section in others} == {0.0}


def test_pieces_that_do_not_continue_each_other_are_refused(made):
    log = made([(0.0, 0.0), (1.0, 0.0)])
    with pytest.raises(DataError, match=r"made, piece 2: begins at 0 s, but the piece before ends at 0.999 s"):
        list(sections_of([log, log]))
    later = Log(log.time + 1, {"position": log["position"]})
    with pytest.raises(
        DataError, match=r"piece 2: has columns position; the first piece has duty_exhaust, duty_supply, position"
    ):
        list(sections_of([log, later]))
    with pytest.raises(DataError, match="no column 'position'"):
        list(sections_of(Log(log.time, {"duty_supply": log["duty_supply"]})))


def test_nothing_is_cut_into_nothing():
    assert list(sections_of([])) == []
    assert list(sections_of(Log(np.zeros(0), {"position": np.zeros(0)}))) == []


def test_a_section_does_not_keep_the_recording_in_memory(minutes):
    section = next(sections_of(minutes))
    values = section.log["position"]
    assert not np.shares_memory(values, minutes["position"])
    assert values.base is None or values.base.size == values.size
