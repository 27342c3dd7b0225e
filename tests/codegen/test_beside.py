"""Kernels that a second process compiles: who is waited for, and when there is nothing to compile."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from clutchid.codegen import beside
from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.machine_code import is_kept

pytestmark = pytest.mark.slow

KERNEL = """
from clutchid.codegen.kernels import kernel


@kernel
def doubled(x):
    return 2.0 * x
"""


def in_folder(folder: Path) -> partial[None]:
    """What another process does in place of compiling: it makes a folder; its last argument is that of the caller."""
    return partial(Path.mkdir, folder, 0o700, False)


def test_what_another_process_compiles_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    beside.compile_beside(in_folder(tmp_path / "compiled"))
    beside.wait_for_kernels()
    assert (tmp_path / "compiled").is_dir()
    beside.compile_beside(in_folder(tmp_path / "compiled"))  # it fails: the folder is there
    beside.wait_for_kernels()


def test_one_processor_is_not_shared(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 1)
    beside.compile_beside(in_folder(tmp_path / "compiled"))
    beside.wait_for_kernels()
    assert not (tmp_path / "compiled").exists()


def test_machine_code_is_kept_from_the_first_call_on(tmp_path, monkeypatch):
    import clutchid

    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(clutchid, "__path__", [*clutchid.__path__, str(tmp_path)])
    (tmp_path / "doubled_of_test.py").write_text(KERNEL)
    doubled = kernels_in("clutchid.doubled_of_test").doubled
    assert not is_kept(doubled)
    assert doubled(np.float64(3.0)) == 6.0
    assert is_kept(doubled)
