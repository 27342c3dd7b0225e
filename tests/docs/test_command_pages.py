"""A page a command: it names every option of the command, and no other."""

import re
from functools import cache
from pathlib import Path

import pytest
from cyclopts import Argument

from clutchid.cli import app

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "commands"
COMMANDS = [name for name in app() if not name.startswith("-")]

#: Options of the command line itself.
GENERAL = {"--help", "--version"}


def arguments(command: str) -> list[Argument]:
    """Arguments of a command that the command line can set, without the groups that hold them."""
    return [a for a in app()[command].assemble_argument_collection(parse_docstring=True) if a.parse and not a.children]


@cache
def options(command: str) -> set[str]:
    """The options of a command."""
    return {name for argument in arguments(command) for name in argument.names if name.startswith("--")}


def text(command: str) -> str:
    return (FOLDER / f"{command}.md").read_text(encoding="utf-8")


def named(page: str) -> set[str]:
    return set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", page))


def test_every_command_has_a_page_and_every_page_is_of_a_command():
    assert {path.stem for path in FOLDER.glob("*.md")} == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_has_a_sentence_for_each_of_its_options(command):
    words = arguments(command)
    assert words
    assert [a.name for a in words if not (a.parameter.help or "").rstrip().endswith(".")] == []


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_the_page_of_a_command_has_an_example_its_exit_codes_and_no_list_of_options_or_others(command):
    page = text(command)
    assert f"$ clutchid {command} " in page
    assert "## Exit codes\n\n0: done" in page or "## Exit codes\n\n0: the file" in page
    assert re.findall(r"^\| *`(--[a-z-]+)", page, re.MULTILINE) == []
    every = set().union(*(options(name) for name in COMMANDS)) | GENERAL
    assert set(re.findall(r"`(--[a-z][a-z-]*)", page)) - every == set()


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda path: path.stem)
def test_every_example_of_a_command_uses_its_options_only(page):
    calls = re.findall(r"clutchid ((?:\w|-)+)((?:[^`#\n\\]|\\\n)*)", page.read_text(encoding="utf-8"))
    unknown = {(verb, *sorted(named(rest) - options(verb) - GENERAL)) for verb, rest in calls if verb in COMMANDS}
    assert {option for option in unknown if len(option) > 1} == set()
