"""Generated modules on disk."""

import os
import tempfile
import threading
from pathlib import Path

import pytest

from clutchid.codegen.cache import load_module


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A source file; the cache folder lies beside it."""
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "equations.py"
    path.write_text("x = 1")
    return path


def _never():
    pytest.fail("a cached module was built again")


def test_a_second_load_does_not_build(source):
    first = load_module("numbers", [source], lambda: "value = 42\n")
    second = load_module("numbers", [source], _never)
    assert first.value == second.value == 42


def test_other_contents_or_another_name_of_a_source_make_another_module(source):
    first = load_module("numbers", [source], lambda: "value = 1\n")
    source.write_text("x = 2")
    second = load_module("numbers", [source], lambda: "value = 2\n")
    renamed = source.rename(source.with_name("others.py"))
    third = load_module("numbers", [renamed], lambda: "value = 3\n")
    assert [m.value for m in (first, second, third)] == [1, 2, 3]
    assert len({m.__file__ for m in (first, second, third)}) == 3


def test_the_order_of_the_sources_does_not_matter(source):
    other = source.with_name("more.py")
    other.write_text("y = 1")
    load_module("numbers", [source, other], lambda: "value = 1\n")
    assert load_module("numbers", [other, source], _never).value == 1


def test_the_module_is_known_by_name_so_that_its_kernels_can_be_cached(source):
    import sys

    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert sys.modules[module.__name__] is module


def test_where_the_cache_folder_cannot_be_made_a_temporary_folder_serves(source, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(
        "CLUTCHID_CACHE", str(tmp_path / "file" / "cache")
    )  # below a file: cannot exist, for root either
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert Path(module.__file__).is_relative_to(tmp_path / "temporary")
    assert load_module("numbers", [source], _never).value == 1


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system knows no owners of folders")
def test_a_temporary_folder_that_others_can_write_to_is_not_trusted(source, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    planted = tmp_path / f"clutchid-{os.getuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert not Path(module.__file__).is_relative_to(planted)


def test_a_user_without_a_name_can_use_the_cache(source, monkeypatch):
    import getpass

    def nameless():
        raise KeyError("uid not found")

    monkeypatch.setattr(getpass, "getuser", nameless)
    assert load_module("numbers", [source], lambda: "value = 1\n").value == 1


def test_concurrent_writers_leave_one_whole_module_and_nothing_else(source):
    ready, modules = threading.Barrier(8), []
    text = "\n".join(f"value_{i} = {i}" for i in range(2000))

    def build():
        ready.wait(timeout=10)  # all eight have found no module and build at the same time
        return text

    def load():
        modules.append(load_module("numbers", [source], build))

    threads = [threading.Thread(target=load) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [m.value_1999 for m in modules] == [1999] * 8
    (folder,) = (source.parent / "cache").iterdir()
    assert [path.name for path in folder.iterdir() if path.is_file()] == ["numbers.py"]


def test_a_failed_build_leaves_no_module_behind(source):
    def broken():
        raise NotImplementedError("no gamma() in this language")

    with pytest.raises(NotImplementedError):
        load_module("numbers", [source], broken)
    assert load_module("numbers", [source], lambda: "value = 1\n").value == 1


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: b"",
        lambda text: text.replace(b"42", b"43"),
        lambda text: text.partition(b"\n")[2],
        lambda text: b"\xff\x00" + text,
    ],
    ids=["truncated", "empty", "a digit changed", "without the mark", "no text"],
)
def test_a_damaged_module_is_built_once_more(source, damage):
    path = Path(load_module("numbers", [source], lambda: "value = 42\n").__file__)
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    built = []

    def build():
        built.append(1)
        return "value = 42\n"

    assert load_module("numbers", [source], build).value == 42
    assert load_module("numbers", [source], _never).value == 42
    assert len(built) == 1
    assert path.read_bytes() == whole


@pytest.mark.parametrize("rest", [0, 8, 20])
def test_a_damaged_compiled_file_of_python_is_made_again(source, rest, monkeypatch):
    import importlib.util
    import sys

    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    path = Path(load_module("numbers", [source], lambda: "value = 42\n").__file__)
    compiled = Path(importlib.util.cache_from_source(str(path)))
    compiled.write_bytes(compiled.read_bytes()[:rest])
    assert load_module("numbers", [source], _never).value == 42


def test_an_error_in_a_module_is_told_as_it_is(source):
    with pytest.raises(ValueError, match="as the module has it"):
        load_module("numbers", [source], lambda: "raise ValueError('as the module has it')\n")


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system knows no owners of folders")
@pytest.mark.parametrize(
    ("mode", "trusted"),
    [(0o720, False), (0o702, False), (0o755, True), (0o700, True)],
    ids=["the group writes", "others write", "all read", "mine alone"],
)
def test_a_temporary_folder_is_trusted_where_neither_the_group_nor_others_write(
    source, tmp_path, monkeypatch, mode, trusted
):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    there = tmp_path / f"clutchid-{os.getuid()}"
    there.mkdir()
    there.chmod(mode)
    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert Path(module.__file__).is_relative_to(there) == trusted
