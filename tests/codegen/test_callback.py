"""Kernels as arguments of other kernels: compiled once for all of them, and kept on disk."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

CODE = """
from pathlib import Path
from numba import types
from clutchid.codegen.cache import load_module
from clutchid.codegen.linked import Callback

text = '''
from clutchid.codegen.kernels import kernel

@kernel
def twice(x):
    return 2.0 * x

@kernel
def thrice(x):
    return 3.0 * x

@kernel
def applied(function, x):
    return function(function(x))
'''
module = load_module("applied", [Path({source!r})], lambda: text)
functions = [Callback(function, (types.float64,)) for function in (module.twice, module.thrice)]
assert [module.applied(function, 1.0) for function in functions] == [4.0, 9.0]
assert len(module.applied.signatures) == 1
print(sum(module.applied.stats.cache_hits.values()), sum(module.applied.stats.cache_misses.values()))
"""


def test_a_kernel_that_takes_a_callback_is_compiled_once_for_all_and_kept(tmp_path):
    source = tmp_path / "source.txt"
    source.write_text("any")
    environment = {**os.environ, "CLUTCHID_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-W", "error", "-c", CODE.format(source=str(source))]
    runs = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    assert [run.stdout.split() for run in runs] == [["0", "1"], ["1", "0"]]
