"""Strokes are counted sample by sample."""

import numpy as np

from clutchid.strokes.stroke import SHORTEST
from fixtures.strokes import stroke_ends

TIME = np.arange(1000) * 1e-3


def raised(*spans):
    """Positions of 8 mm in some spans of time in s, else 0."""
    position = np.zeros(TIME.size)
    for begin, end in spans:
        position[(begin <= TIME) & (end > TIME)] = 8e-3
    return position


def test_a_stroke_ends_where_the_position_falls():
    assert stroke_ends(TIME, raised((0.1, 0.3), (0.5, 0.7))) == [300, 700]


def test_a_stroke_that_has_not_ended_does_not_count():
    assert stroke_ends(TIME, raised((0.1, 0.3), (0.5, 2.0))) == [300]


def test_noise_about_the_limit_a_spike_and_missing_samples_are_no_strokes():
    noise = 2e-3 + 5e-5 * np.random.default_rng(0).standard_normal(TIME.size)
    assert stroke_ends(TIME, noise) == []
    slow = 1.75e-3 + 0.3e-3 * np.sin(2 * np.pi * 5.0 * TIME)  # from 1.45 to 2.05 mm, then not below 1.5 mm
    assert len(stroke_ends(TIME, slow)) == 5
    assert stroke_ends(TIME, slow + 0.1e-3) == []
    assert stroke_ends(TIME, raised((0.1, 0.1 + 0.5e-6 * SHORTEST))) == []
    torn = raised((0.1, 0.3))
    torn[::3] = np.nan
    assert len(stroke_ends(TIME, torn)) == 1
    assert stroke_ends(TIME[:0], torn[:0]) == []
