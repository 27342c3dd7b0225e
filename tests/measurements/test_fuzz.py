"""Broken files of every format get a recording or one sentence; `benchmarks/fuzz.py` does the same at length."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.slow


def unexpected(fuzz, answers):
    """Answers that are no words; the first case is an empty file."""
    assert answers[0] == "refused"
    return {seed: answer for seed, answer in answers.items() if answer not in ("read", "refused", *fuzz.ENDS)}


@pytest.mark.parametrize("kind", ["csv", "gz", "parquet", "mf4", "mat", "mat73", "blf", "asc"])
def test_a_file_is_read_and_answered_in_words_once_it_is_broken(fuzz, kind, tmp_path):
    path, channels = fuzz.good_file(kind, tmp_path)
    made, original = fuzz.read(path, channels=channels), fuzz.example()
    assert list(made.columns) == list(original.columns)
    if kind not in ("blf", "asc"):  # these have the resolution of their signals
        assert np.array_equal(made.time, original.time)
        for name, values in original.columns.items():
            assert np.array_equal(made[name], values, equal_nan=True)
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases(kind, range(60), tmp_path)}
    assert unexpected(fuzz, answers) == {}


def test_a_log_of_can_with_a_broken_database_is_answered_in_words(fuzz, tmp_path):
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases("dbc", range(120), tmp_path)}
    assert unexpected(fuzz, answers) == {}
    assert {"read", "refused"} <= set(answers.values())


def test_a_parquet_file_that_promises_samples_and_has_none_is_refused(fuzz, tmp_path):
    for _, path, channels in fuzz.cases("parquet", [7167, 7428], tmp_path):
        assert fuzz.answered(path, channels) == "refused"
