"""Programs that tests call: of another version, broken, or not there, they leave the test out and say so."""

import ast
import os
import re
from pathlib import Path

import pytest

from clutchid.exports.misra import CHECKER
from fixtures import programs

TESTS = Path(__file__).resolve().parents[1]

needs_scripts = pytest.mark.skipif(os.name == "nt", reason="the stand-ins are scripts")


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine whose programs are scripts: machine("usr", NAME=SCRIPT), or "bin", the environment of the tests."""
    monkeypatch.setattr(programs.sys, "executable", str(tmp_path / "bin" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / "usr"))

    def installed(folder, **scripts):
        (tmp_path / folder).mkdir(exist_ok=True)
        for name, script in scripts.items():
            path = tmp_path / folder / name
            path.write_text(f"#!/bin/sh\n{script}\n")
            path.chmod(0o700)
        programs.tried.cache_clear()
        return tmp_path / folder

    installed("usr")
    yield installed
    programs.tried.cache_clear()


@needs_scripts
@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("echo Cppcheck 2.10", f"says 'Cppcheck 2.10', not {CHECKER[0]!r}"),
        ("echo no library >&2; exit 127", "fails with exit code 127: no library"),
        ("kill -9 $$", "fails with exit code -9"),
    ],
)
def test_a_test_is_left_out_where_its_program_is_of_another_version_or_broken(machine, script, reason):
    folder = machine("usr", cppcheck=script)
    with pytest.raises(pytest.skip.Exception) as skipped:
        programs.path_of("cppcheck")
    assert str(skipped.value).startswith(f"cppcheck is needed, and {folder / 'cppcheck'} {reason}")


@needs_scripts
def test_so_does_one_that_is_not_there_or_cannot_start(machine):
    assert programs.tried("cppcheck") == ("", "there is no cppcheck")
    path = machine("usr", cppcheck="") / "cppcheck"
    path.write_text("#!/nowhere/sh\n")
    assert programs.tried("cppcheck").lacks.startswith(f"cppcheck is needed, and {path} does not run: ")


@needs_scripts
def test_the_environment_goes_before_the_system_and_what_works_before_what_does_not(machine):
    usr = machine("usr", cppcheck=f"echo {CHECKER[0]}", nm="echo nm 2.40")
    assert programs.path_of("cppcheck") == str(usr / "cppcheck")
    of_tests = machine("bin", cppcheck=f"echo {CHECKER[0]}", nm="exit 1")
    assert programs.path_of("cppcheck") == str(of_tests / "cppcheck")
    assert programs.path_of("nm") == str(usr / "nm")


@needs_scripts
def test_a_compiler_without_headers_is_none(machine):
    usr = machine("usr", cc="echo 'math.h: No such file' >&2; exit 1", gcc="exit 0")
    assert programs.path_of("cc") == str(usr / "gcc")


def test_no_test_looks_for_a_program_by_itself():
    """A command begins with a path that `fixtures/programs.py` has tried."""
    names = {name for trial in programs.TRIALS.values() for name in trial.names}
    names |= {"bash", "git", "make", "nm", "objdump", "octave-cli", "wine64"}
    alone = []
    for file in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            seeks = isinstance(node, ast.Call) and ast.unparse(node.func) in ("shutil.which", "which")
            starts = isinstance(node, ast.List) and isinstance(next(iter(node.elts), None), ast.Constant)
            if seeks or (starts and node.elts[0].value in names):
                alone.append(f"{file.relative_to(TESTS).as_posix()}:{node.lineno}")
    assert [place for place in alone if not re.match(r"fixtures/(programs|compilers)\.py", place)] == []
