"""Broken files of every format get a recording or one sentence; `benchmarks/fuzz.py` does the same at length."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def driver():
    spec = importlib.util.spec_from_file_location("fuzz", ROOT / "benchmarks" / "fuzz.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("kind", ["csv", "gz", "parquet", "mf4", "mat", "mat73", "blf", "asc"])
def test_a_broken_file_is_answered_in_words(kind, tmp_path):
    fuzz = driver()
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases(kind, range(60), tmp_path)}
    expected = ("read", "refused", *fuzz.ENDS)
    assert {seed: answer for seed, answer in answers.items() if answer not in expected} == {}
    assert answers[0] == "refused"  # the empty file


@pytest.mark.parametrize("kind", ["csv", "gz", "parquet", "mf4", "mat", "mat73", "blf", "asc"])
def test_the_file_before_it_was_broken_is_read(kind, tmp_path):
    fuzz = driver()
    path, channels = fuzz.good_file(kind, tmp_path)
    made, known = fuzz.read(path, channels=channels), fuzz.example()
    assert list(made.columns) == list(known.columns)
    if kind not in ("blf", "asc"):  # these have the resolution of their signals
        assert np.array_equal(made.time, known.time)
        for name, values in known.columns.items():
            assert np.array_equal(made[name], values, equal_nan=True)


def test_a_log_of_can_with_a_broken_database_is_answered_in_words(tmp_path):
    fuzz = driver()
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases("dbc", range(120), tmp_path)}
    assert {seed: answer for seed, answer in answers.items() if answer not in ("read", "refused", *fuzz.ENDS)} == {}
    assert answers[0] == "refused"  # the empty database
    assert {"read", "refused"} <= set(answers.values())


def test_a_parquet_file_that_promises_samples_and_has_none_is_refused(tmp_path):
    fuzz = driver()
    for _, path, channels in fuzz.cases("parquet", [7167, 7428], tmp_path):
        assert fuzz.answered(path, channels) == "refused"
