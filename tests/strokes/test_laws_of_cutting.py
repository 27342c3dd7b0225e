"""What holds for every recording: sections are disjoint, in order and complete, and pieces do not matter."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from clutchid.log import HOLE, INPUTS, Log
from clutchid.strokes import choose, joined, sections_of
from clutchid.strokes.borders import LEAD
from clutchid.strokes.rest_level import REST_BAND
from fixtures.strokes import stroke_ends


def same(first, second):
    """Whether two lists of sections are the same, bit for bit."""
    return len(first) == len(second) and all(
        (a.kind, a.first, a.start, a.end, a.departure) == (b.kind, b.first, b.start, b.end, b.departure)
        and repr(a.summary) == repr(b.summary)
        and np.array_equal(a.log.time, b.log.time)
        and all(np.array_equal(a.log[name], b.log[name], equal_nan=True) for name in a.log.columns)
        for a, b in zip(first, second, strict=True)
    )


@pytest.fixture(scope="module")
def whole(minutes):
    return list(sections_of(minutes))


@settings(max_examples=15)
@given(borders=st.lists(st.integers(0, 220_000), max_size=8))
def test_pieces_are_cut_as_the_whole_whatever_their_borders(minutes, whole, borders):
    edges = [0, *sorted(min(border, len(minutes)) for border in borders), len(minutes)]
    pieces = (minutes.slice(a, b) for a, b in pairwise(edges))
    assert same(list(sections_of(pieces)), whole)


def test_pieces_of_one_sample_are_cut_as_the_whole(minutes):
    part = minutes.slice(0, 5000)
    assert same(list(sections_of(part.slice(i, i + 1) for i in range(5000))), list(sections_of(part)))


REACH = 0.022

#: Movements from the rest and back: highest position in m, seconds on the way out, held, back, and at rest.
MOVEMENTS = st.tuples(
    st.sampled_from([0.4e-3, 1.4e-3, 1.8e-3, 2.2e-3, 8e-3, REACH]), st.sampled_from([0.1, 0.4, 2.0]),
    st.sampled_from([0.0, 0.05, 0.5, 4.0]), st.sampled_from([0.1, 0.4, 2.0]), st.sampled_from([0.0, 0.05, 0.4, 1.5]),
)  # fmt: skip


#: Rests for longer above the stop than on it, and a stroke that is too low for one from there.
HELD_ABOVE = [*[(0.4e-3, 0.1, 0.0, 0.1, 0.0)] * 4, (0.4e-3, 0.1, 4.0, 0.1, 0.0), (2.2e-3, 0.1, 0.0, 0.1, 0.0)]


@settings(max_examples=15)
@example(movements=HELD_ABOVE, zero=-3e-3)
@given(movements=st.lists(MOVEMENTS, max_size=8), zero=st.sampled_from([-3e-3, 0.0, 3e-3]))
def test_every_stroke_that_is_counted_is_whole_in_one_section_of_motion(made, movements, zero):
    corners = [(0.0, 0.0), (1.0, 0.0)]
    for peak, out, held, back, rest in [*movements, (REACH, 0.2, 0.4, 0.3, 2.0)]:
        for seconds, level in ((out, peak), (held, peak), (back, 0.0), (rest, 0.0)):
            corners.append((corners[-1][0] + seconds + 1e-3, level))
    log = made(corners, zero=zero)
    ends = stroke_ends(log.time, log["position"] - zero)
    in_sections = []
    for section in sections_of(log):
        within = stroke_ends(section.log.time, section.log["position"] - zero)
        assert section.kind == "stroke" or not within
        in_sections += [section.first + end for end in within]
        # rests within the band of the lowest are one: the level is their median, and may be that of any of them
        assert -1e-4 < section.summary.level - zero < REST_BAND * REACH + 1e-4
    assert in_sections == ends


@st.composite
def recordings(draw):
    """Any course with holes in time, missing inputs and missing positions."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = draw(st.integers(1, 20_000))
    dt = draw(st.sampled_from([1e-3, 1e-2, 2.5e-4, 1.0]))
    steps = np.full(n, dt)
    holes = rng.integers(0, n, draw(st.integers(0, 5)))
    steps[holes] = dt * rng.uniform(6, 5000, holes.size)
    corners = np.sort(rng.uniform(0, n, 2 * (n // 2000) + 2))
    levels = rng.choice([0.0, 0.0, 0.3, 1.0], corners.size) * draw(st.sampled_from([0.01, 0.125]))
    position = np.interp(np.arange(n), corners, levels) + draw(st.sampled_from([0.0, 3e-5])) * rng.standard_normal(n)
    position[rng.uniform(size=n) < draw(st.sampled_from([0.0, 0.05, 1.0]))] = np.nan
    duties = {name: rng.choice([0.0, 0.0, 0.5], n // 100 + 1).repeat(100)[:n] for name in INPUTS}
    for start in rng.integers(0, n, draw(st.integers(0, 5))):
        duties["duty_supply"][start : start + rng.integers(1, 300)] = np.nan
    return Log(np.cumsum(steps), {"position": position, **duties})


@settings(max_examples=60)
@given(log=recordings())
def test_sections_are_disjoint_in_order_and_hold_every_sample_with_known_inputs(log):
    sections = list(sections_of(log))
    taken = np.concatenate([np.arange(s.first, s.first + len(s)) for s in sections]) if sections else np.zeros(0)
    present = np.isfinite(log["duty_supply"]) & np.isfinite(log["duty_exhaust"])
    assert np.array_equal(taken, np.flatnonzero(present))
    usual = np.median(np.diff(log.time)) if len(log) > 1 else 1.0
    for section in sections:
        part = slice(section.first, section.first + len(section))
        assert np.array_equal(section.log.time, log.time[part])
        assert all(np.array_equal(section.log[name], log[name][part], equal_nan=True) for name in log.columns)
        assert (np.diff(section.log.time) <= HOLE * usual).all()
        assert section.start <= section.departure <= section.end
        assert section.summary.vented_rest >= 0
        # the rest before a stroke is as long as LEAD, or what is left where a rest of its own would be too short
        assert section.departure - section.start <= LEAD + 0.2


@settings(max_examples=40)
@given(log=recordings(), seed=st.integers(0, 1000))
def test_joined_keeps_every_sample_bit_for_bit_and_every_border_that_is_one(log, seed):
    sections = list(sections_of(log))
    rng = np.random.default_rng(seed)
    some = [section for section in sections if rng.uniform() < 0.6] or sections
    if not some:
        return
    together = joined(rng.permutation(np.array(some, dtype=object)).tolist())
    at = np.searchsorted(together.time, np.concatenate([section.log.time for section in some]))
    for name in log.columns:
        values = np.concatenate([section.log[name] for section in some])
        assert np.array_equal(together[name][at], values, equal_nan=True)
    added = np.delete(np.arange(len(together)), at)
    assert all(np.isnan(together[name][added]).all() for name in log.columns)
    breaks = 2 * HOLE * np.median(np.concatenate([np.diff(s.log.time) for s in some if len(s) > 1] or [[np.inf]]))
    for before, after in pairwise(some):
        apart = before.first + len(before) != after.first
        between = together.time[(together.time > before.end) & (together.time < after.start)]
        assert (between.size > 0 or after.start - before.end > breaks) if apart else between.size == 0


@settings(max_examples=10)
@given(seconds=st.floats(0.5, 60.0))
def test_what_is_chosen_is_short_enough_and_in_order(whole, seconds):
    chosen = choose(whole, seconds)
    assert sum(section.seconds for section in chosen) <= seconds
    assert all(section.kind == "stroke" for section in chosen)
    assert [section.first for section in chosen] == sorted({section.first for section in chosen})
