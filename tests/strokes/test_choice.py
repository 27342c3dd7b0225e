"""`choose` selects strokes that complement each other, and never unusable ones: where, which way and how fast."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.strokes import Section, SectionSummary, choice, choose, joined, sections_of
from clutchid.strokes.choice import HATS, SIZE, gram, information_of

REACH = 0.022

#: Reach of the strokes whose Gram matrix is known by hand.
WAY = 0.02


def of_sections(sections, reach=REACH):
    return float(information_of(sum((gram(section, reach) for section in sections), np.zeros((SIZE, SIZE)))))


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_information_grows_and_has_diminishing_returns(seed):
    rng = np.random.default_rng(seed)
    few, more, new = (b @ b.T for b in rng.standard_normal((3, SIZE, 4)) * rng.uniform(0.01, 1.0))
    # rounding of the determinant of a matrix of 45 rows whose logarithm is of order 10
    assert information_of(few + more) >= information_of(few) - 1e-9
    assert (
        information_of(few + new) - information_of(few)
        >= information_of(few + more + new) - information_of(few + more) - 1e-9
    )


def test_fast_and_slow_opening_and_closing_are_chosen_before_the_same_again(made, full_strokes):
    ramp = [(21.0, 0.0), (24.0, REACH), (24.2, REACH), (27.0, 0.0)]
    log = made([*full_strokes(np.arange(2.0, 19.0, 3.0).tolist(), 20.0), *ramp, (29.0, 0.0)])
    chosen = choose(sections_of(log), 9.0)
    fast, ramp = chosen
    assert (fast.departure < 20.0, ramp.departure) == (True, pytest.approx(21.0, abs=0.1))


def test_a_stroke_to_a_new_place_comes_before_a_repetition(made, full_strokes):
    low = full_strokes([2.0, 5.0, 8.0, 11.0], 13.0, 0.4 * REACH)
    log = made([*low, *full_strokes([14.0], 17.0)[1:]])
    assert any(section.summary.highest > 0.9 * REACH for section in choose(sections_of(log), 3.6))


def test_rests_and_strokes_that_miss_most_of_their_positions_are_never_chosen(made, full_strokes):
    log = made(full_strokes([2.0, 5.0], 9.0))
    position = log["position"].copy()
    position[4500:6300:3] = position[4501:6300:3] = np.nan
    chosen = choose(sections_of(log.with_columns(position=position)), 100.0)
    assert [round(section.departure) for section in chosen] == [2]
    assert choose(sections_of(made([(0.0, 0.0), (5.0, 0.0)])), 10.0) == ()
    assert choose(sections_of(log), 0.05) == ()


def test_strokes_that_are_too_short_or_hardly_move_are_never_chosen(made, full_strokes):
    corners = [*full_strokes([2.0], 5.0), (5.1, 1e-3), (6.0, 1e-3), (6.1, 0.0), (9.0, 0.0)]
    strokes = [section for section in sections_of(made(corners)) if section.kind == "stroke"]
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
        section
        for section in sections_of(made([*full_strokes([2.0], 4.0), *slow, (15.0, 0.0)]))
        if section.kind == "stroke"
    )
    assert of_sections([long]) > of_sections([short])
    assert of_sections([long]) / long.seconds < of_sections([short]) / short.seconds
    assert choose([long, short], long.seconds) == (short,)


def test_a_stream_is_read_once_and_more_of_it_never_has_less_information(minutes, monkeypatch):
    sections = list(sections_of(minutes))
    monkeypatch.setattr(choice, "_BATCH", 3)
    before = 0.0
    for n in (5, 10, 20, len(sections)):
        now = of_sections(choose(iter(sections[:n]), 15.0))
        # every stroke goes to the end, so the reach, the scale of the information, changes by noise only: 0.05 of 22 mm
        assert now >= (1 - 0.05 / 22) * before
        before = now


def test_batches_lose_little_against_all_at_once(minutes, monkeypatch):
    sections = list(sections_of(minutes))
    at_once = of_sections(choose(sections, 15.0))
    monkeypatch.setattr(choice, "_BATCH", 4)
    # the bound of greedy choice: each of the two is within 1 - 1/e of the best set
    assert of_sections(choose(sections, 15.0)) >= (1 - 1 / np.e) * at_once


def test_a_length_that_is_none_is_refused():
    with pytest.raises(ParameterError, match=r"seconds = 0: the total length of the strokes must be above 0 s"):
        choose([], 0.0)


def test_a_missing_input_of_one_sample_stays_a_border(made, full_strokes):
    log = made(full_strokes([2.0], 6.0))
    duty = log["duty_supply"].copy()
    duty[2500] = np.nan
    together = joined(sections_of(log.with_columns(duty_supply=duty)))
    assert len(together) == len(log)
    assert np.flatnonzero(np.isnan(together["duty_supply"])).tolist() == [2500]


def test_what_cannot_be_joined_is_refused(made, full_strokes):
    sections = list(sections_of(made(full_strokes([2.0], 6.0))))
    bare = list(sections_of(made(full_strokes([2.0], 6.0), inputs=False)))
    with pytest.raises(DataError, match="no section is given"):
        joined([])
    with pytest.raises(DataError, match="other columns"):
        joined([sections[0], bare[1]])
    with pytest.raises(DataError, match="join disjoint sections"):
        joined([sections[1], sections[1]])


def moved(speed: float, start: float, stop: float, vented_rest: float = 1.0, level: float = 0.0) -> Section:
    """A stroke that goes straight from a start to a stop in m above the level, at a speed in m/s."""
    t = np.arange(10 * round(abs(stop - start) / speed * 1e2)) * 1e-3  # whole bins of 10 ms
    log = Log(t, {"position": level + start + np.sign(stop - start) * speed * t})
    low, high = sorted((start, stop))
    summary = SectionSummary(level + low, level + high, level, WAY, vented_rest, 0.0)
    return Section("stroke", log, 0.0, float(t[-1]), 0.0, 0, summary)


def blocks(G: np.ndarray) -> np.ndarray:
    """Seconds in each block: the hats add up to one everywhere, so a block's entries add up to the time in it."""
    return np.array([G[HATS * k : HATS * (k + 1), HATS * k : HATS * (k + 1)].sum() for k in range(4)])


@pytest.mark.parametrize(
    ("speed", "start", "stop", "block"),
    [
        (0.01, 0.0, WAY, 0),
        (0.10, 0.0, WAY, 1),
        (0.01, WAY, 0.0, 2),
        (0.10, WAY, 0.0, 3),
        (0.019, 0.0, WAY, 0),  # a reach a second divides slow from fast
        (0.021, 0.0, WAY, 1),
    ],
)
def test_time_counts_in_the_block_of_its_direction_and_pace(speed, start, stop, block):
    seconds = abs(stop - start) / speed
    times = blocks(gram(moved(speed, start, stop), WAY))
    # a speed needs 20 ms before and after, the last bin ends with its last sample
    assert times[block] == pytest.approx(seconds - 0.04, abs=0.006)
    assert times.sum() == pytest.approx(times[block], rel=1e-12)


def test_a_piston_that_creeps_slower_than_a_twentieth_of_its_reach_a_second_counts_as_standing():
    assert blocks(gram(moved(0.9e-3, 0.005, 0.006), WAY)).sum() == 0.0
    assert blocks(gram(moved(1.1e-3, 0.005, 0.006), WAY)).sum() > 0.8


def test_time_is_shared_between_the_two_hats_around_the_position_above_the_level():
    # from hat 2 to hat 3 of eleven: at u of the way the two get (1 - u)^2, u (1 - u) and u^2
    section = moved(0.002, 0.2 * WAY, 0.3 * WAY, level=5e-3)
    G = gram(section, WAY)
    used = np.flatnonzero(G[:-1, :-1].any(axis=1)).tolist()
    assert used == [2, 3]
    seconds = G[2:4, 2:4].sum()
    # each mean over an even way, but for the 20 ms at its ends and the bins of 10 ms: 3 % of a second
    np.testing.assert_allclose(G[2:4, 2:4] / seconds, [[1 / 3, 1 / 6], [1 / 6, 1 / 3]], atol=0.01)


def test_without_a_vented_rest_before_it_a_stroke_counts_by_half_and_has_no_anchor():
    anchored, cold = (gram(moved(0.01, 0.0, WAY, vented), WAY) for vented in (0.3, 0.0))
    np.testing.assert_allclose(cold[:-1, :-1], 0.5 * anchored[:-1, :-1], rtol=1e-12)
    assert (anchored[-1, -1], cold[-1, -1]) == (0.3, 0.0)
    assert gram(moved(0.01, 0.0, WAY, 100.0), WAY)[-1, -1] == 0.5


def test_the_matrix_is_one_of_a_quadratic_form():
    G = gram(moved(0.013, 0.0, WAY), WAY)
    assert G.shape == (SIZE, SIZE)
    assert np.array_equal(G, G.T)
    # its least eigenvalue is 0 but for the rounding of a matrix of 45 rows of size 1
    assert np.linalg.eigvalsh(G).min() > -45 * 2.3e-16 * 2
