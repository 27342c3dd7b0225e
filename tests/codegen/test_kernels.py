"""Kernels that are written by hand: who waits for the compiler, and where their machine code lies."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import clutchid
from clutchid.codegen.kernels import kernels_in

KERNELS = "clutchid.simulation.comparison"


@pytest.mark.slow
def test_a_process_that_runs_no_kernel_does_not_import_the_compiler():
    code = "import sys, clutchid.estimation, clutchid.documents; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_machine_code_of_a_module_lies_in_the_cache_folder():
    module = kernels_in(KERNELS)
    assert "estimation" not in Path(str(module.__file__)).parts
    assert kernels_in(KERNELS) is module


def test_a_module_that_is_not_there_is_told_by_name():
    with pytest.raises(ModuleNotFoundError, match="no_such_kernels"):
        kernels_in("clutchid.estimation.no_such_kernels")


#: A kernel that takes the number of a column from a module without kernels, as those of `clutchid.inference.filter` do.
TAKING = """
from clutchid.codegen.kernels import kernel
from clutchid.layout_of_test import COLUMN


@kernel
def taken(x):
    return x[COLUMN]
"""


#: A kernel that takes a record of a module without kernels by its address.
TAKING_A_RECORD = """
from clutchid.codegen.kernels import kernel
from clutchid.codegen.linked import by_address
from clutchid.layout_of_test import Pair

by_address(Pair)


@kernel
def first_of(pair):
    return pair.first


def taken(x):
    return first_of(Pair(first=x[0], second=x[1]))
"""

_PAIR = "from typing import NamedTuple\n\n\nclass Pair(NamedTuple):\n    {}: float\n    {}: float\n"


@pytest.mark.parametrize(
    ("kernel", "layouts", "expected"),
    [
        pytest.param(TAKING, ("COLUMN = 0\n", "COLUMN = 1\n"), [3.0, 4.0], id="number"),
        pytest.param(
            TAKING_A_RECORD, (_PAIR.format("first", "second"), _PAIR.format("second", "first")), [3.0, 3.0], id="record"
        ),
    ],
)
def test_machine_code_is_not_that_of_another_layout_of_the_arrays(tmp_path, monkeypatch, kernel, layouts, expected):
    """Numba freezes a number that a kernel takes from another module, and where the fields of a record lie; its own
    cache does not see that they change."""
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(clutchid, "__path__", [*clutchid.__path__, str(tmp_path)])
    (tmp_path / "taking_of_test.py").write_text(kernel)
    taken = []
    for layout in layouts:
        (tmp_path / "layout_of_test.py").write_text(layout)
        monkeypatch.delitem(sys.modules, "clutchid.layout_of_test", raising=False)
        importlib.invalidate_caches()
        kernels_in.cache_clear()
        taken.append(kernels_in("clutchid.taking_of_test").taken(np.array([3.0, 4.0])))
    kernels_in.cache_clear()
    assert taken == expected


def test_no_two_modules_that_are_compiled_together_define_the_same_name(source):
    """Their texts stand one after the other in one module, in which the last definition would serve both."""
    paths = [path for path in source.rglob("*.py") if "\n@kernel\n" in path.read_text()]
    assert len(paths) > 5
    for path in paths:
        name = ".".join(("clutchid", *path.relative_to(source).with_suffix("").parts))
        defined = list(defined_in(Path(str(kernels_in(name).__file__)).read_text()))
        assert sorted(defined) == sorted(set(defined)), name


def defined_in(text):
    """Names of the functions and constants of a module."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name))
