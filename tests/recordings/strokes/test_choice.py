"""`choose` selects strokes that complement each other, and never unusable ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.recordings.strokes import choice, choose, cut, joined, sections_table
from clutchid.recordings.strokes.choice import SIZE, gram, information

REACH = 0.022


def information_of(sections, reach=REACH):
    return float(information(sum((gram(section, reach) for section in sections), np.zeros((SIZE, SIZE)))))


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_information_grows_and_has_diminishing_returns(seed):
    rng = np.random.default_rng(seed)
    few, more, new = (b @ b.T for b in rng.standard_normal((3, SIZE, 4)) * rng.uniform(0.01, 1.0))
    # rounding of the determinant of a matrix of 45 rows whose logarithm is of order 10
    assert information(few + more) >= information(few) - 1e-9
    assert information(few + new) - information(few) >= information(few + more + new) - information(few + more) - 1e-9


def test_fast_and_slow_opening_and_closing_are_chosen_before_the_same_again(made, full_strokes):
    ramp = [(21.0, 0.0), (24.0, REACH), (24.2, REACH), (27.0, 0.0)]
    log = made([*full_strokes(np.arange(2.0, 19.0, 3.0).tolist(), 20.0), *ramp, (29.0, 0.0)])
    chosen = choose(cut(log), 9.0)
    assert sorted(section.label for section in chosen) == ["full stroke", "ramp"]


def test_a_stroke_to_a_new_place_comes_before_a_repetition(made, full_strokes):
    low = full_strokes([2.0, 5.0, 8.0, 11.0], 13.0, 0.4 * REACH)
    log = made([*low, *full_strokes([14.0], 17.0)[1:]])
    assert any(section.summary.highest > 0.9 * REACH for section in choose(cut(log), 3.6))


def test_a_stroke_with_a_vented_rest_before_it_has_more_information(made):
    log = made([(0.0, 0.0), (1.0, 0.0), (1.15, REACH), (1.9, REACH), (2.2, 0.0), (4.0, 0.0)])
    _, anchored, _ = cut(log)
    cold = next(cut(log.slice(1005, len(log))))
    assert cold.summary.vented_rest == 0.0
    assert information_of([anchored]) > information_of([cold])


def test_rests_and_strokes_that_miss_most_of_their_positions_are_never_chosen(made, full_strokes):
    log = made(full_strokes([2.0, 5.0], 9.0))
    position = log["position"].copy()
    position[4500:6300:3] = position[4501:6300:3] = np.nan
    chosen = choose(cut(log.with_columns(position=position)), 100.0)
    assert [round(section.departure) for section in chosen] == [2]
    assert choose(cut(made([(0.0, 0.0), (5.0, 0.0)])), 10.0) == ()
    assert choose(cut(log), 0.05) == ()


def test_strokes_that_are_too_short_or_hardly_move_are_never_chosen(made, full_strokes):
    corners = [*full_strokes([2.0], 5.0), (5.1, 1e-3), (6.0, 1e-3), (6.1, 0.0), (9.0, 0.0)]
    strokes = [section for section in cut(made(corners)) if section.kind == "stroke"]
    assert [round(section.departure) for section in strokes] == [2, 5]
    # 1 mm of 22 mm, 4.5 %
    assert [round(section.departure) for section in choose(strokes, 100.0)] == [2]
    brief, long = (replace(strokes[0], end=strokes[0].start + seconds) for seconds in (0.09, 0.11))
    assert choose([brief], 100.0) == ()
    assert choose([long], 100.0) == (long,)


def test_of_two_strokes_the_one_with_more_information_for_its_length_is_taken(made, full_strokes):
    # the second one stands at its end for seconds, and adds a little information on the way back
    slow = [(6.0, 0.0), (6.15, REACH), (12.0, REACH), (12.4, 0.0)]
    short, long = (
        section for section in cut(made([*full_strokes([2.0], 4.0), *slow, (15.0, 0.0)])) if section.kind == "stroke"
    )
    assert information_of([long]) > information_of([short])
    assert information_of([long]) / long.seconds < information_of([short]) / short.seconds
    assert choose([long, short], long.seconds) == (short,)


def test_a_stream_is_read_once_and_more_of_it_never_has_less_information(minutes, monkeypatch):
    sections = list(cut(minutes))
    monkeypatch.setattr(choice, "BATCH", 3)
    before = 0.0
    for n in (5, 10, 20, len(sections)):
        now = information_of(choose(iter(sections[:n]), 15.0))
        # every stroke goes to the end, so the reach, the scale of the information, changes by noise only: 0.05 of 22 mm
        assert now >= (1 - 0.05 / 22) * before
        before = now


def test_batches_lose_little_against_all_at_once(minutes, monkeypatch):
    sections = list(cut(minutes))
    at_once = information_of(choose(sections, 15.0))
    monkeypatch.setattr(choice, "BATCH", 4)
    # the bound of greedy choice: each of the two is within 1 - 1/e of the best set
    assert information_of(choose(sections, 15.0)) >= (1 - 1 / np.e) * at_once


def test_a_length_that_is_none_is_refused():
    with pytest.raises(ParameterError, match=r"seconds = 0: the total length of the strokes must be above 0 s"):
        choose([], 0.0)


def test_sections_that_touch_are_joined_without_a_hole_and_others_with_one(made, full_strokes):
    log = made(full_strokes([2.0, 6.0], 10.0))
    sections = list(cut(log))
    whole = joined(reversed(sections))
    assert np.array_equal(whole.time, log.time)
    assert all(np.array_equal(whole[name], log[name]) for name in log.columns)
    apart = joined([sections[1], sections[3]])
    assert np.count_nonzero(np.diff(apart.time) > 5.1e-3) == 1


def test_a_missing_input_of_one_sample_stays_a_border(made, full_strokes):
    log = made(full_strokes([2.0], 6.0))
    duty = log["duty_supply"].copy()
    duty[2500] = np.nan
    together = joined(cut(log.with_columns(duty_supply=duty)))
    assert len(together) == len(log)
    assert np.flatnonzero(np.isnan(together["duty_supply"])).tolist() == [2500]


def test_what_cannot_be_joined_is_refused(made, full_strokes):
    sections = list(cut(made(full_strokes([2.0], 6.0))))
    bare = list(cut(made(full_strokes([2.0], 6.0), inputs=False)))
    with pytest.raises(DataError, match="no section is given"):
        joined([])
    with pytest.raises(DataError, match="different columns"):
        joined([sections[0], bare[1]])
    with pytest.raises(DataError, match="join disjoint sections"):
        joined([sections[1], sections[1]])


def test_the_table_has_a_line_for_every_section_but_one_for_the_parts_of_a_rest(made, full_strokes):
    log = made(full_strokes([1100.0], 1105.0))
    sections = list(cut(log))
    lines = sections_table(sections).splitlines()
    assert len(sections) > 3
    assert len(lines) == 4
    assert lines[1].split()[:4] == [f"1-{len(sections) - 2}", "rest", "vented", "rest"]
    assert "full stroke" in lines[2]
    assert all(line == line.rstrip() for line in lines)


def test_the_table_says_a_dash_where_nothing_is_known():
    log = Log(np.arange(100) * 1e-3, {"position": np.full(100, np.nan)})
    line = sections_table(cut(log)).splitlines()[1]
    assert "no position" in line
    assert "100.0 %" in line
    assert " - " in line
