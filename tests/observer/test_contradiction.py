"""Innovations that contradict the inputs: by their excess over time, whatever the rate of the corrections."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.observer.contradiction import CONTRADICTED, LEARNING
from clutchid.strokes.stroke import QUICKEST

EVERY = 0.01


def time_to_contradiction(sizes, learns, seconds=EVERY):
    """Time in s after which innovations of these sizes contradict; infinite if they do not."""
    sizes = np.asarray(sizes, dtype=float)
    errors, speeds = np.column_stack([2.0 * sizes, np.full(sizes.size, 4.0)])[:, None], np.full((sizes.size, 1), learns)
    first = kernels_in("clutchid.observer.contradiction").first_contradiction(
        np.zeros(1), errors, speeds.astype(float), 0, 0.5, seconds
    )
    return (first + 1) * seconds if first < sizes.size else np.inf


def test_a_piston_that_stands_against_a_worn_stop_contradicts_nothing_for_a_second():
    assert time_to_contradiction(np.full(100, 8.5), learns=False) == np.inf
    assert time_to_contradiction(np.full(100, 60.0), learns=False) < 0.1


def test_what_is_learnt_from_outliers_contradicts_after_a_time_that_does_not_depend_on_the_rate():
    assert time_to_contradiction(np.full(100, 3.9), learns=True) == np.inf
    times = [time_to_contradiction(np.full(1000, 9.0), True, seconds) for seconds in (1e-3, 5e-3, 1e-2)]
    assert times == pytest.approx([CONTRADICTED / (9.0 - LEARNING)] * 3, abs=1e-2)


def test_a_fault_contradicts_after_four_corrections_that_is_within_half_of_the_quickest_stroke():
    """Three outliers in a row, which white noise has with a probability of 6e-5 to the third, contradict nothing."""
    far = [1e6, 1e6, 1e6]
    assert time_to_contradiction([*far, *np.zeros(20), *far, *np.zeros(20)], learns=True) == np.inf
    assert time_to_contradiction([*far, 1e6], learns=True) == pytest.approx(4 * EVERY)
    assert 4 * EVERY <= QUICKEST / 2


def test_the_excess_of_a_sound_recording_is_at_most_a_third_of_a_contradiction():
    """On 45 recordings of nine trucks it was at most 0.09 s: benchmarks/results/contradictions.md."""
    assert CONTRADICTED > 3 * 0.09
