"""Noise, quantum and runs of a sampled column."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.strokes.sampled import constant_runs, noise, quantum, runs


@given(st.lists(st.sampled_from([0.0, 1.0, float("nan")]), min_size=1, max_size=40))
def test_runs_are_what_a_plain_loop_finds(values):
    expected, i = [], 0
    while i < len(values):
        j = i + 1
        while j < len(values) and values[j] == values[i]:
            j += 1
        if j - i > 1:
            expected.append((i, j - i, values[i]))
        i = j
    constant = constant_runs(np.array(values))
    assert list(zip(constant.start, constant.length, constant.value, strict=True)) == expected


@given(st.lists(st.booleans(), max_size=30))
def test_runs_cover_what_holds_and_nothing_else_and_do_not_touch(mask):
    covered, stretches = np.zeros(len(mask), dtype=bool), runs(np.array(mask, dtype=bool))
    for start, stop in stretches:
        covered[start:stop] = True
    assert covered.tolist() == mask
    assert all(stop < start for (_, stop), (start, _) in pairwise(stretches))


@pytest.mark.parametrize("step", [10e-6, 12.207e-6, 50e-6, 2e-4])
@pytest.mark.parametrize("digits", [6, 9])
def test_a_quantum_is_found_under_noise_and_rounding(step, digits):
    motion = 0.01 + 0.01 * np.sin(np.arange(20_000) / 500) + 3e-5 * np.random.default_rng(0).standard_normal(20_000)
    written = np.round(step * np.round(motion / step), digits)
    # a step of 12.207 um written to 1 um is 12 or 13 um
    assert quantum(written) == pytest.approx(step, rel=0.02 if digits == 6 else 1e-3)


def test_a_column_that_never_changes_or_is_missing_has_no_quantum():
    assert quantum(np.zeros(100)) == quantum(np.full(100, np.nan)) == quantum(np.zeros(0)) == 0.0


@pytest.mark.parametrize("rate", [100, 1000, 10_000])
def test_noise_is_told_beside_strokes_holes_and_steps(rate):
    time, rng = np.arange(0, 10, 1 / rate), np.random.default_rng(1)
    motion = 0.01 * np.clip(np.sin(time), -0.5, 0.5)
    measured = motion + 3e-5 * rng.standard_normal(time.size)
    measured = 12e-6 * np.round(measured / 12e-6)
    measured[rng.uniform(size=time.size) < 0.02] = np.nan
    # the quietest tenth of blocks of 32 samples: a standard deviation below by 1.3 of its own spread, 13 %
    assert noise(measured) == pytest.approx(3e-5, rel=0.35)


def test_noise_of_fewer_samples_than_a_block_is_not_known():
    assert np.isnan(noise(np.zeros(20)))
