"""Kernels that are written by hand: who waits for the compiler, and where their machine code lies."""

import subprocess
import sys
from pathlib import Path

import pytest

from clutchid.codegen.kernels import kernels_in

KERNELS = "clutchid.simulation.comparison"


def test_a_process_that_runs_no_kernel_does_not_import_the_compiler():
    code = "import sys, clutchid.estimation, clutchid.report; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_machine_code_of_a_module_lies_in_the_cache_folder():
    module = kernels_in(KERNELS)
    assert "estimation" not in Path(str(module.__file__)).parts
    assert kernels_in(KERNELS) is module


def test_a_module_that_is_not_there_is_told_by_name():
    with pytest.raises(ModuleNotFoundError, match="no_such_kernels"):
        kernels_in("clutchid.estimation.no_such_kernels")
