"""Samples that come late, twice or out of order, cut in any way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.measurements.clock import JUMP_AHEAD, LONE, WINDOW
from clutchid.measurements.live.order import FIRST, ArrivedBatch, ArrivedSamples, final, none_waiting, sorted_in


def fed(stamps, cuts, streams=None):
    """Samples of two streams in order, counts of late, repeated, invalid ones; `stamps` in the order of arrival."""
    stream = np.zeros(len(stamps), dtype=int) if streams is None else np.asarray(streams)
    stamps = np.asarray(stamps)
    number = np.arange(stamps.size) * 1.0
    waiting, counts, streams_out = none_waiting([["x"], ["x"]]), np.zeros(4, dtype=int), ([], [])
    for piece in [*np.split(np.arange(stamps.size), cuts), np.empty(0, dtype=int)]:
        arrived = []
        for i in (1, 0):
            rows = piece[stream[piece] == i]
            place = rows - (piece[0] if piece.size else 0)
            arrived.append(ArrivedSamples(i, place, {"x": number[rows]}))
        waiting, out, _ = sorted_in(waiting, ArrivedBatch(stamps[piece], arrived), ended=not piece.size)
        counts += out
        waiting, ready = final(waiting, ended=not piece.size)
        for have, new in zip(streams_out, ready, strict=True):
            have += [*zip(new.time.tolist(), new.columns["x"].tolist(), strict=True)]
    return streams_out, counts[[0, 1, 3]].tolist(), waiting


RNG = np.random.default_rng(5)
SHAKEN = np.arange(2000) * 1e-3 + 0.04 * RNG.random(2000) * (RNG.random(2000) < 0.1)
DELAYED = SHAKEN.copy()
DELAYED[[700, 900, 1500]] -= 0.2
DELAYED[[300, 301]] = DELAYED[299]


@pytest.mark.parametrize("cuts", [[1, 2, 3, 100], list(range(1, 2000)), [301, 700, 701, 902]])
@pytest.mark.parametrize("streams", [None, RNG.integers(0, 2, 2000)])
def test_the_order_and_what_is_left_out_do_not_depend_on_how_the_samples_come(cuts, streams):
    whole, counts, _ = fed(DELAYED, [], streams)
    parts, again, _ = fed(DELAYED, cuts, streams)
    assert parts == whole
    assert again == counts
    assert counts[0] == 3
    for samples in whole:
        time = np.array([t for t, _ in samples])
        assert (np.diff(time) > 0).all()


@pytest.mark.parametrize(
    ("stamps", "cuts", "order", "counts"),
    [
        ([0.0, 0.001, 0.001, 0.001, 0.002], [2], [0, 3, 4], [0, 2, 0]),  # of equal stamps the last counts
        ([0.0, 0.1, 0.1 - 0.9 * WINDOW, 0.1 - WINDOW, 0.2], [], [0, 2, 1, 4], [1, 0, 0]),  # too late for the window
        ([0.0, 0.001, 9.0, 9.001, 9.002, 4e3, 4000.001, 4000.002], [3, 6], range(8), [0, 0, 0]),  # three are a pause
        (np.arange(20) * 2.0 * JUMP_AHEAD, range(1, 20), range(20), [0, 0, 0]),  # a slow stream goes on
        ([1e9], [], [0], [0, 0, 0]),
    ],
)
def test_samples_are_sorted_in_confirmed_or_left_out(stamps, cuts, order, counts):
    samples, out, _ = fed(stamps, list(cuts))
    assert samples[0] == [(stamps[i], float(i)) for i in order]
    assert out == counts


@pytest.mark.slow
@pytest.mark.parametrize("cuts", [[], [7, 700, 701, 702, 1999], list(range(1, 2000))])
@pytest.mark.parametrize("streams", [None, RNG.integers(0, 2, 2000)])
@pytest.mark.parametrize("stamp", [1.3, 700.0, 1e300])
def test_a_spoiled_stamp_far_ahead_costs_one_sample_wherever_it_stands(cuts, streams, stamp):
    stamps = np.arange(2000) * 1e-3
    places = [0, 700, 702, 1000, 1999]
    stamps[places] = stamp + 2.0
    stamps[1000] *= 1.5
    by_stream, counts, _ = fed(stamps, cuts, streams)
    assert counts == [0, 0, len(places)]
    assert sorted(x for samples in by_stream for _, x in samples) == np.delete(np.arange(2000.0), places).tolist()


@pytest.mark.parametrize("cuts", [[], [1], [1, 2, 3, 10]])
def test_a_first_stamp_far_below_the_others_is_followed_by_a_hole(cuts):
    stamps = np.arange(2000) * 1e-3
    stamps[0] = -5.0
    samples, counts, _ = fed(stamps, cuts)
    assert [t for t, _ in samples[0]] == stamps.tolist()
    assert counts == [0, 0, 0]


RESTARTED = np.concatenate([3.0 + np.arange(200) * 1e-3, np.arange(1100) * 1e-3])


@pytest.mark.parametrize("cuts", [[], list(range(1, 1300)), [150, 260]])
def test_a_clock_that_begins_again_goes_on_behind_once_that_is_sure(cuts):
    samples, counts, waiting = fed(RESTARTED, cuts)
    assert counts == [0, 0, 0]
    stamps = np.array([t for t, _ in samples[0]])
    assert stamps.size == 1300
    assert stamps[200] - stamps[199] == pytest.approx(1.0)
    assert waiting.clock.shift == pytest.approx(4.199)


@pytest.mark.parametrize("cuts", [[], list(range(1, 400)), [201, 260]])
def test_a_few_samples_from_before_stay_between_those_around_them(cuts):
    stamps = np.concatenate([3.0 + np.arange(200) * 1e-3, np.arange(150) * 1e-3, 3.35 + np.arange(50) * 1e-3])
    samples, counts, _ = fed(stamps, cuts)
    assert counts == [0, 0, 0]
    assert [t for t, _ in samples[0]] == pytest.approx((3.0 + np.arange(400) * 1e-3).tolist(), abs=1e-3)


@pytest.mark.parametrize("cuts", [[150], [152, 155], list(range(1, 500))])
def test_two_steps_back_within_the_window_are_one_restart_wherever_a_block_begins(cuts):
    stamps = np.arange(500) * 1e-3 - 0.04 * (np.arange(500) >= 150) - 0.04 * (np.arange(500) >= 155)
    whole, counts, waiting = fed(stamps, [])
    assert waiting.clock.shift > 0.0
    assert fed(stamps, cuts)[:2] == (whole, counts)


def test_a_stream_that_slows_down_is_not_held_up():
    waiting = none_waiting([["x"]])
    for stamp in [*(np.arange(200) * 1e-3), *(10.0 + np.arange(30))]:
        batch = ArrivedBatch(np.array([stamp]), [ArrivedSamples(0, np.array([0]), {"x": np.zeros(1)})])
        waiting, _, _ = sorted_in(waiting, batch)
        assert waiting.stamps.size <= (LONE if stamp > 0.1 else FIRST)
    assert waiting.count >= 228


TROUBLES = (
    lambda s, a, b, by: np.r_[s[:a], s[a] + by, s[a + 1 :]],
    lambda s, a, b, by: np.r_[s[:a], s[a:b] + by, s[b:]],
    lambda s, a, b, by: np.r_[s[:a], s[a:] - s[a]],
    lambda s, a, b, by: np.round(s % 65.536, 6),
    lambda s, a, b, by: np.r_[s[:a], s[a:b] - 0.04, s[b:] - 0.08],
    lambda s, a, b, by: s - 0.06 * (np.arange(s.size) % 3 == 0) * (np.arange(s.size) < b),
)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(TROUBLES),
            st.integers(0, 240),
            st.integers(1, 120),
            st.sampled_from([60.0, -5.0, 0.3, -0.1, 1e9]),
        ),
        max_size=5,
    ),
    st.lists(st.integers(1, 249), max_size=6),
    st.integers(0, 99),
)
def test_whatever_happens_to_the_clock_stamps_grow_and_do_not_depend_on_how_they_come(troubles, cuts, seed):
    random = np.random.default_rng(seed)
    stamps = np.cumsum(random.choice([1e-3, 2e-3], 250))
    for trouble, a, size, by in troubles:
        stamps = trouble(stamps, a, a + size, by)
    streams = random.integers(0, 2, stamps.size)
    whole, counts, _ = fed(stamps, [], streams)
    assert all((np.diff([t for t, _ in samples]) > 0).all() for samples in whole)
    for other in (sorted({*cuts}), list(range(1, stamps.size, 2))):
        assert fed(stamps, other, streams)[:2] == (whole, counts)
