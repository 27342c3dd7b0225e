"""Kernels that a second process compiles: who is waited for, and when there is nothing to compile."""

import os
from concurrent.futures import ThreadPoolExecutor
from threading import Event

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


def test_what_another_process_compiles_is_waited_for_by_all_threads_and_compiled_once(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    beside.compile_beside(os.mkdir, tmp_path / "compiled")
    beside.compile_beside(os.mkdir, tmp_path / "while that one works")
    with ThreadPoolExecutor(4) as threads:  # as a search that filters on several
        list(threads.map(lambda _: beside.wait_for_kernels(), range(4)))
    assert (tmp_path / "compiled").is_dir()
    assert not (tmp_path / "while that one works").exists()
    beside.compile_beside(os.mkdir, tmp_path / "compiled")  # it fails: the folder is there
    beside.wait_for_kernels()


def test_a_process_that_waits_does_what_comes_later_meanwhile_and_only_then(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    values = []
    work = [lambda i=i: values.append((i, (tmp_path / "compiled").exists())) for i in range(3)]
    beside.compile_beside(os.mkdir, tmp_path / "compiled", work)
    assert not values
    with ThreadPoolExecutor(4) as threads:
        list(threads.map(lambda _: beside.wait_for_kernels(), range(4)))
    assert (0, False) in values
    assert len({i for i, _ in values}) == len(values)
    before = len(values)
    beside.wait_for_kernels()
    assert len(values) == before


def test_where_no_process_can_be_started_its_thread_compiles_and_waits_for_nobody(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    monkeypatch.setattr(beside.Pool, "do", lambda _, function, item: function(item))
    started = Event()
    beside.compile_beside(
        lambda folder: (started.wait(), beside.wait_for_kernels(), folder.mkdir()), tmp_path / "compiled"
    )
    started.set()
    beside.wait_for_kernels()
    assert (tmp_path / "compiled").is_dir()


def test_one_processor_is_not_shared(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 1)
    beside.compile_beside(os.mkdir, tmp_path / "compiled")
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
