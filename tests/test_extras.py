"""How to install an optional library: a command that works for the installation at hand."""

import shlex
import sys
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest

from clutchid.errors import MissingExtra, install_command, missing, requirements

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]


@pytest.mark.parametrize("extra", ["mdf", "mat", "can", "fleet"])
def test_a_command_names_the_libraries_of_an_extra_and_the_interpreter_at_hand(extra):
    words = shlex.split(install_command(extra))
    assert sys.executable in words
    assert words[-len(requirements(extra)) :] == [*requirements(extra)]
    assert len(requirements(extra)) == len(EXTRAS[extra])
    assert {line.partition(";")[0] for line in requires("clutchid")} >= {*requirements(extra)}
    assert not any("clutchid" in requirement for requirement in requirements(extra))


def test_an_interpreter_with_a_blank_in_its_path_is_quoted_and_one_without_pip_has_uv(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/my programs/python")
    assert shlex.split(install_command("mdf"))[0] == "/my programs/python"
    monkeypatch.setattr("clutchid.errors.find_spec", lambda name: None)
    assert shlex.split(install_command("mdf"))[:5] == ["uv", "pip", "install", "--python", "/my programs/python"]


def test_a_missing_library_is_an_error_with_the_command():
    error = missing("reading MDF", "asammdf", "mdf")
    assert isinstance(error, MissingExtra)
    command = install_command("mdf")
    assert str(error) == f"reading MDF needs asammdf, which is not installed; install it with: {command}"


def test_no_text_installs_clutchid_from_an_index_where_it_is_not():
    files = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.py")]
    assert [file.name for file in files if "clutchid[" in file.read_text(encoding="utf-8")] == []
