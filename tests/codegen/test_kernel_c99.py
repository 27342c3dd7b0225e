"""Kernels that are written by hand, in C99: the same text and the same numbers."""

import ctypes
import re
import subprocess

import numpy as np
import pytest

from clutchid.codegen.kernel_c99 import CNames, kernel_c99, record_c99, values_c99
from clutchid.codegen.records import fields_of, new_record, values_in
from clutchid.observer import rest, rest_rule
from clutchid.strokes import plausible, rule, stroke
from clutchid.strokes.stroke import LONGEST_US
from clutchid.strokes.values import new_watch
from fixtures.programs import path_of

LIMITS = new_record(
    rule.ValueLimits, low=-7e-3, high=32e-3, speed=0.84, acceleration=400.0, noise=4e-4, repeats=0.015,
    believed_after=0.5, gap=0.05, interval=1e-3,
)  # fmt: skip

NAMES = CNames("double", lambda x: "NAN" if x != x else "HUGE_VAL" if x == np.inf else repr(x), "own_", "clutch")


def test_only_what_is_called_is_printed():
    text = kernel_c99([plausible], ["count_anew"], NAMES)
    assert "static void own_count_anew(clutch_watch_t *watch, double by)" in text
    assert "own_judge" not in text


def test_what_takes_other_arrays_is_not_printed():
    assert "follow_values(" not in kernel_c99([plausible], ["judge_next"], NAMES)


def test_a_record_has_its_fields_in_their_order_and_the_sizes_of_its_arrays():
    text = record_c99(rest.Rest, NAMES)
    assert text.startswith("/* The vented rest between two samples. */\ntypedef struct {\n    double shift;\n")
    assert "    double returned[8];\n" in text
    assert "    uint32_t vents;\n    int excursion;\n" in text
    assert text.endswith("} clutch_rest_t;\n")
    assert values_c99(new_record(stroke.Stroke, lasted=LONGEST_US), NAMES) == "{.within = 0, .lasted = 4294967295u}"


def compiled(modules, entries, records, folder):
    """A library with some kernels in C, which are visible outside."""
    text = "".join(record_c99(record, NAMES) for record in records) + kernel_c99(modules, entries, NAMES)
    for name in entries:
        text = re.sub(rf"static (\w+ own_{name}\()", r"\1", text)
    (folder / "rule.c").write_text(f"#include <math.h>\n#include <stdint.h>\n{text}")
    strict = ("-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off")
    command = [path_of("cc"), "-shared", "-fPIC", *strict, "-o", folder / "rule.so", folder / "rule.c", "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(folder / "rule.so"))


def in_memory(record, kind):
    """A record as C has it; its whole numbers have 32 bits."""
    types = {"real": ctypes.c_double, "int": ctypes.c_int32, "count": ctypes.c_uint32}
    fields = [(f.name, types[f.kind] * f.size if f.size else types[f.kind]) for f in fields_of(kind)]
    made = type(kind.__name__, (ctypes.Structure,), {"_fields_": fields})()
    for name, value in values_in(record).items():
        setattr(made, name, type(getattr(made, name))(*value) if isinstance(value, list) else value)
    return made


@pytest.mark.slow
@pytest.mark.needs("cc")
def test_the_rule_for_values_has_the_verdicts_of_the_kernel(tmp_path):
    in_c = compiled([plausible], ["judge_next"], [rule.Watch, rule.ValueLimits], tmp_path).own_judge_next
    mine, theirs, bounds = in_memory(new_watch(), rule.Watch), new_watch(), in_memory(LIMITS, rule.ValueLimits)
    random = np.random.default_rng(0)
    y = 1e-2 * np.sin(0.01 * np.arange(4000)) ** 2 + 2e-5 * random.standard_normal(4000)
    y[500:2600:371] += 5e-3
    y[1000:1010], y[2000] = np.nan, 1e30
    y[2700:] += 6e-3
    y[2500:2600] = y[2500]
    pairs = [
        (in_c(ctypes.byref(mine), ctypes.byref(bounds), *map(ctypes.c_double, (1e-3 * i, value, 0.0, 0.0))),
         plausible.judge_next(theirs, LIMITS, 1e-3 * i, value, 0.0, 0.0))
        for i, value in enumerate(y.tolist())
    ]  # fmt: skip
    verdicts = np.array(pairs)
    assert np.array_equal(verdicts[:, 0], verdicts[:, 1])
    assert set(verdicts[:, 0]) >= {rule.VALUE, rule.BEYOND, rule.STEP, rule.SEAM}
    expected = values_in(theirs)
    np.testing.assert_allclose([getattr(mine, name) for name in expected], [*expected.values()], rtol=1e-12)


@pytest.mark.needs("cc")
def test_loops_over_arrays_have_the_numbers_of_the_kernel(tmp_path):
    in_c = compiled([rest_rule], ["sort"], [], tmp_path).own_sort
    values = np.random.default_rng(1).standard_normal(20)
    numbers = (ctypes.c_double * 20)(*values)
    in_c(numbers, 0, 20)
    assert list(numbers) == sorted(values)
