"""Kernels that are written by hand, in C99: the same text and the same numbers."""

import ctypes
import subprocess

import numpy as np
import pytest

from clutchid.codegen.kernel_c99 import kernel_c99
from clutchid.strokes import plausible, rule
from clutchid.strokes.values import new_watch
from fixtures.programs import path_of

LIMITS = np.array([-7e-3, 32e-3, 0.84, 400.0, 4e-4, 0.015, 0.5, 0.05, 1e-3])


def test_only_what_is_called_is_printed():
    text = kernel_c99(plausible, ("count_anew",), "double", "own_", repr)
    assert "static void own_count_anew(double watch[], double by)" in text
    assert "own_judge" not in text
    assert "own_judge_supply" in kernel_c99(plausible, ("judge_supply",), "double", "own_", repr)


def test_a_loop_cannot_be_printed():
    assert "follow_values(" not in kernel_c99(plausible, ("judge_next",), "double", "own_", repr)


@pytest.mark.slow
@pytest.mark.needs("cc")
def test_the_rule_for_values_has_the_verdicts_of_the_kernel(tmp_path):
    number = {np.inf: "HUGE_VAL"}
    text = kernel_c99(
        plausible, ("judge_next",), "double", "own_", lambda x: "NAN" if x != x else number.get(x, repr(x))
    )
    (tmp_path / "rule.c").write_text(
        f"#include <math.h>\n{text.replace('static int own_judge_next', 'int own_judge_next')}"
    )
    library = tmp_path / "rule.so"
    strict = ("-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off")
    subprocess.run([path_of("cc"), "-shared", "-fPIC", *strict, "-o", library, tmp_path / "rule.c", "-lm"], check=True)
    in_c = ctypes.CDLL(str(library)).own_judge_next
    array, real = np.ctypeslib.ndpointer(np.float64), ctypes.c_double
    in_c.argtypes = [array, array, real, real, real, real, array]
    random = np.random.default_rng(0)
    y = 1e-2 * np.sin(0.01 * np.arange(4000)) ** 2 + 2e-5 * random.standard_normal(4000)
    y[500:2600:371] += 5e-3
    y[1000:1010], y[2000] = np.nan, 1e30
    y[2700:] += 6e-3
    y[2500:2600] = y[2500]
    mine, theirs, since = new_watch(), new_watch(), np.zeros(2)
    pairs = [
        (in_c(mine, LIMITS, 1e-3 * i, value, 0.0, 0.0, since),
         plausible.judge_next(theirs, LIMITS, 1e-3 * i, value, 0.0, 0.0, since))
        for i, value in enumerate(y.tolist())
    ]  # fmt: skip
    verdicts = np.array(pairs)
    assert np.array_equal(verdicts[:, 0], verdicts[:, 1])
    assert set(verdicts[:, 0]) >= {rule.VALUE, rule.BEYOND, rule.STEP, rule.SEAM}
    np.testing.assert_allclose(mine, theirs, rtol=1e-12)
