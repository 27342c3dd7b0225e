"""Generated modules on disk."""

import errno
import hashlib
import importlib.util
import os
import pickle
import subprocess
import sys
import tempfile
import threading
from collections import OrderedDict
from contextlib import nullcontext
from pathlib import Path

import pytest

from clutchid.codegen import cache
from clutchid.codegen.cache import keep_text, load_module, when_compiling

owned = pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system knows no owners of folders")


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A source file; the cache folder lies beside it."""
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "equations.py"
    path.write_text("x = 1")
    return path


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The folder for temporary files, where no cache folder can be made."""
    (tmp_path / "file").write_text("")
    # below a file: cannot exist, for root either
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path / "file" / "cache"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "temporary"


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


def test_comments_and_docstrings_of_a_source_do_not_matter(source):
    source.write_text("def f(x):\n    return x + 1\n")
    load_module("numbers", [source], lambda: "value = 1\n")
    source.write_text('"""A module."""\n\n\ndef f(x):\n    """A function."""\n    return x + 1  # one more\n')
    assert load_module("numbers", [source], _never).value == 1
    source.write_text("def f(x):\n    return x + 2\n")
    assert load_module("numbers", [source], lambda: "value = 2\n").value == 2


def test_sources_that_give_the_same_text_share_its_machine_code(source):
    first = load_module("numbers", [source], lambda: "value = 1\n")
    source.write_text("x = 2")
    assert load_module("numbers", [source], lambda: "value = 1\n").__file__ == first.__file__


def test_the_same_text_compiled_in_another_way_makes_another_module(source, monkeypatch, tmp_path):
    files = [load_module("numbers", [source], lambda: "value = 1\n").__file__]
    for path in cache._COMPILING:
        changed = tmp_path / path.name
        changed.write_bytes(path.read_bytes() + b"\nCHANGED = True\n")
        monkeypatch.setattr(cache, "_COMPILING", tuple(changed if p == path else p for p in cache._COMPILING))
        cache._versions.cache_clear()
        files.append(load_module("numbers", [source], lambda: "value = 1\n").__file__)
    cache._versions.cache_clear()
    assert len(set(files)) == 4


def test_the_order_of_the_sources_does_not_matter(source):
    other = source.with_name("more.py")
    other.write_text("y = 1")
    load_module("numbers", [source, other], lambda: "value = 1\n")
    assert load_module("numbers", [other, source], _never).value == 1


def test_the_module_is_known_by_name_so_that_its_kernels_can_be_cached(source):
    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert sys.modules[module.__name__] is module


def test_where_the_cache_folder_cannot_be_made_a_temporary_folder_serves(source, temporary):
    module = load_module("numbers", [source], lambda: "value = 1\n")
    assert Path(module.__file__).is_relative_to(temporary)
    assert load_module("numbers", [source], _never).value == 1


@owned
@pytest.mark.parametrize(
    ("mode", "stranger", "sentence"),
    [(0o770, 0, "others may write to it; chmod 700"), (0o700, 1, "is not used")],
    ids=["others can write", "somebody else's"],
)
def test_a_cache_folder_that_is_not_mine_alone_is_refused(source, temporary, monkeypatch, mode, stranger, sentence):
    folder = temporary.parent / "cache"
    monkeypatch.setenv("CLUTCHID_CACHE", str(folder))
    monkeypatch.setattr(os, "getuid", lambda: temporary.stat().st_uid + stranger)
    folder.mkdir()
    folder.chmod(mode)
    with pytest.warns(RuntimeWarning, match=sentence):
        module = load_module("numbers", [source], lambda: "value = 1\n")
    assert Path(module.__file__).is_relative_to(temporary)
    assert list(folder.iterdir()) == []


@owned
def test_a_new_cache_folder_is_the_users_alone(source):
    load_module("numbers", [source], lambda: "value = 1\n")
    assert (source.parent / "cache").stat().st_mode & 0o777 == 0o700


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
    files = [path for path in (source.parent / "cache").rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert [path.name for path in files if path.parent.name != "texts"] == ["numbers.py"]
    assert not [path for path in files if path.suffix == ".tmp"]


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
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    path = Path(load_module("numbers", [source], lambda: "value = 42\n").__file__)
    compiled = Path(importlib.util.cache_from_source(str(path)))
    compiled.write_bytes(compiled.read_bytes()[:rest])
    assert load_module("numbers", [source], _never).value == 42


def test_an_error_in_a_module_is_raised_as_it_is(source):
    with pytest.raises(ValueError, match="as the module has it"):
        load_module("numbers", [source], lambda: "raise ValueError('as the module has it')\n")


@owned
@pytest.mark.parametrize(
    ("mode", "trusted"),
    [(0o777, False), (0o720, False), (0o702, False), (0o755, True), (0o700, True)],
    ids=["anyone writes", "the group writes", "others write", "all read", "mine alone"],
)
def test_a_temporary_folder_is_trusted_where_neither_the_group_nor_others_write(source, temporary, mode, trusted):
    there = temporary / f"clutchid-{os.getuid()}"
    there.mkdir()
    there.chmod(mode)
    with nullcontext() if trusted else pytest.warns(RuntimeWarning, match="others may write to it"):
        module = load_module("numbers", [source], lambda: "value = 1\n")
    assert Path(module.__file__).is_relative_to(there) == trusted


def test_a_full_disk_is_named_and_the_module_goes_without_a_file(source, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "mkstemp", full)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    with pytest.warns(RuntimeWarning, match="No space left on device") as said:
        module = load_module("numbers", [source], lambda: "value = 1\n")
    assert module.value == 1
    assert str(tmp_path / "cache") in str(said[0].message)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [source]


KERNEL = """
from clutchid.codegen.kernels import kernel

@kernel
def twice(x):
    return 2.0 * x
"""


def _twice(source):
    """The kernel as a process finds it that has not compiled it, and whether it had to compile."""
    name = next((name for name in sys.modules if name.startswith("clutchid_generated_doubling_")), None)
    sys.modules.pop(name, None)
    kernel = load_module("doubling", [source], lambda: KERNEL).twice
    assert kernel(21.0) == 42.0
    return bool(kernel.stats.cache_misses)


def _machine_code(source, suffix):
    (path,) = (source.parent / "cache").rglob(f"*.{suffix}")
    return path


def test_a_second_process_finds_the_machine_code(source):
    assert [_twice(source), _twice(source)] == [True, False]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda _: b"",
        lambda code: code[: len(code) // 2],
        lambda code: code[:-1] + bytes([code[-1] ^ 1]),
        lambda _: b"x",
    ],
    ids=["empty", "halved", "a bit changed", "one byte"],
)
def test_damaged_machine_code_is_compiled_once_more(source, suffix, damage):
    _twice(source)
    path = _machine_code(source, suffix)
    path.write_bytes(damage(path.read_bytes()))
    assert [_twice(source), _twice(source)] == [True, False]


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_machine_code_with_types_of_another_process_is_compiled_once_more(source, suffix):
    _twice(source)
    path = _machine_code(source, suffix)
    content = pickle.dumps(OrderedDict()).replace(b"OrderedDict", b"OfNoProcess")
    path.write_bytes(hashlib.sha256(content).digest() + content)
    assert [_twice(source), _twice(source)] == [True, False]


def test_machine_code_that_a_full_disk_cannot_keep_is_named_and_used(source, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    kernel = load_module("doubling", [source], lambda: KERNEL).twice
    monkeypatch.setattr(os, "replace", full)
    with pytest.warns(RuntimeWarning, match="cannot keep machine code: .*No space left on device"):
        assert kernel(21.0) == 42.0
    assert kernel(21) == 42.0  # nor does it try again
    assert list((source.parent / "cache").rglob("*.nb*")) == []


@pytest.fixture
def read_only(source, tmp_path, monkeypatch):
    """Makes the cache folder read-only, for root too; returns the folder for temporary files."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    opened, made = tempfile.TemporaryFile, tempfile.mkstemp

    def refusing(function):
        def called(*arguments, **options):
            if Path(options.get("dir") or "/").is_relative_to(tmp_path / "cache"):
                raise OSError(errno.EROFS, "Read-only file system")
            return function(*arguments, **options)

        return called

    def turn():
        monkeypatch.setattr(tempfile, "TemporaryFile", refusing(opened))
        monkeypatch.setattr(tempfile, "mkstemp", refusing(made))
        return tmp_path / "temporary"

    return turn


def test_a_warm_cache_that_is_read_only_is_used(source, read_only):
    assert _twice(source)
    temporary = read_only()
    assert not _twice(source)
    source.write_text("x = 1  # a comment")  # found by what the source means, which cannot be noted
    assert not _twice(source)
    assert list(temporary.iterdir()) == []


def test_what_a_read_only_cache_lacks_is_built_in_the_temporary_folder(source, read_only):
    load_module("numbers", [source], lambda: "value = 1\n")
    temporary = read_only()
    assert [_twice(source), _twice(source)] == [True, False]
    assert list(temporary.rglob("doubling.py"))


def test_machine_code_stays_in_the_cache_folder_whatever_numba_is_set_to(source, tmp_path, monkeypatch):
    import numba

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "elsewhere"))
    assert [_twice(source), _twice(source)] == [True, False]
    assert _machine_code(source, "nbi").is_file()
    assert not (tmp_path / "elsewhere").exists()


@pytest.fixture
def brought(source, tmp_path, monkeypatch):
    """The file of a text that came with the wheel."""
    monkeypatch.setattr(cache, "TEXTS", tmp_path / "texts")
    return keep_text(tmp_path / "texts", "numbers", [source], "value = 42\n")


def test_a_text_that_came_with_the_wheel_is_not_built_and_its_module_is_the_same(source, brought, monkeypatch):
    first = load_module("numbers", [source], _never)
    assert first.value == 42
    monkeypatch.setattr(cache, "TEXTS", source.parent / "none")
    monkeypatch.setenv("CLUTCHID_CACHE", str(source.parent / "another"))
    second = load_module("numbers", [source], lambda: "value = 42\n")
    assert Path(second.__file__).read_bytes() == Path(first.__file__).read_bytes()
    assert Path(second.__file__).parent.name == Path(first.__file__).parent.name


def _another_source(source, _brought, _monkeypatch):
    source.write_text("x = 2")


def _another_comment(source, _brought, _monkeypatch):
    source.write_text("x = 1  # one")


def _another_sympy(_source, _brought, monkeypatch):
    version = cache.version
    monkeypatch.setattr(cache, "version", lambda name: version(name) + (".post1" if name == "sympy" else ""))


def _damage(_source, brought, _monkeypatch):
    brought.write_bytes(brought.read_bytes()[:-1])


@pytest.mark.parametrize("change", [_another_source, _another_comment, _another_sympy, _damage])
def test_a_text_of_other_sources_or_another_sympy_and_a_damaged_one_are_not_used(source, brought, monkeypatch, change):
    change(source, brought, monkeypatch)
    assert load_module("numbers", [source], lambda: "value = 1\n").value == 1


HOSTILE = """
import os, sys, tempfile, warnings
from pathlib import Path
from clutchid.codegen.cache import load_module

warnings.simplefilter("ignore")
source = Path(sys.argv[1])
for name in ("one", "two"):
    print(load_module(name, [source], lambda: "value = 1\\n").__file__)
"""


@owned
def test_where_others_can_write_to_every_folder_a_process_has_one_of_its_own_and_takes_it_away(source, tmp_path):
    planted = [tmp_path / "cache", tmp_path / "temporary" / f"clutchid-{os.getuid()}"]
    for folder in planted:
        folder.mkdir(parents=True)
        folder.chmod(0o777)
    process = subprocess.run(
        [sys.executable, "-c", HOSTILE, source], capture_output=True, text=True, check=True,
        env={**os.environ, "TMPDIR": str(tmp_path / "temporary")},
    )  # fmt: skip
    first, two = (Path(line).parents[1] for line in process.stdout.split())
    assert first == two
    assert first.parent == tmp_path / "temporary"
    assert list((tmp_path / "temporary").iterdir()) == planted[1:]


def test_compiling_is_announced_once(source, monkeypatch):
    said = []
    when_compiling(said.append)
    _twice(source)
    load_module("numbers", [source], lambda: "value = 1\n")
    assert said == ["compiling the model, once per machine ..."]
    when_compiling(said.append)
    assert not _twice(source)
    assert len(said) == 1
    when_compiling(lambda _: None)
