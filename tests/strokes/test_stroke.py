"""Strokes are counted sample by sample."""

import numpy as np

from clutchid.strokes.stroke import NO_STROKES, SHORTEST, count_strokes

TIME = np.arange(1000) * 1e-3


def raised(*spans):
    """Positions of 8 mm in some spans of time in s, else 0."""
    position = np.zeros(TIME.size)
    for begin, end in spans:
        position[(begin <= TIME) & (end > TIME)] = 8e-3
    return position


def test_a_stroke_ends_where_the_position_falls():
    after, ends = count_strokes(NO_STROKES, TIME, raised((0.1, 0.3), (0.5, 0.7)))
    assert after == (2, None)
    assert ends == [300, 700]


def test_a_stroke_that_has_not_ended_does_not_count():
    after, ends = count_strokes(NO_STROKES, TIME, raised((0.1, 0.3), (0.5, 2.0)))
    assert after == (1, 0.5)
    assert ends == [300]


def test_noise_about_the_limit_a_spike_and_missing_samples_are_no_strokes():
    noise = 2e-3 + 5e-5 * np.random.default_rng(0).standard_normal(TIME.size)
    assert count_strokes(NO_STROKES, TIME, noise)[0].ended == 0
    slow = 1.75e-3 + 0.3e-3 * np.sin(2 * np.pi * 5.0 * TIME)  # from 1.45 to 2.05 mm, then not below 1.5 mm
    assert count_strokes(NO_STROKES, TIME, slow)[0].ended == 5
    assert count_strokes(NO_STROKES, TIME, slow + 0.1e-3)[0].ended == 0
    assert count_strokes(NO_STROKES, TIME, raised((0.1, 0.1 + 0.5 * SHORTEST)))[0].ended == 0
    torn = raised((0.1, 0.3))
    torn[::3] = np.nan
    assert count_strokes(NO_STROKES, TIME, torn)[0].ended == 1
    assert count_strokes(NO_STROKES, TIME[:0], torn[:0]) == (NO_STROKES, [])
