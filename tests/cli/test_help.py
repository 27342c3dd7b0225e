"""What `--help` says: files in the usage, options in groups, nothing that nobody can use."""

from collections import Counter

import pytest

from clutchid.cli import app
from fixtures.commands import called

APP = app()
COMMANDS = [name for name in APP if not name.startswith("-")]

#: From so many options on they are in groups.
MANY = 9

#: Options that mean something else in one command: a flag of `export`.
HOMONYMS = {"--model", "--table"}

GROUPS = ("Common options", "Method and search", "Fleet and workers", "Files", "Output")


def arguments(command):
    return [a for a in APP[command].assemble_argument_collection() if a.parse and not a.children]


def options(command):
    return [a for a in arguments(command) if any(name.startswith("--") for name in a.names)]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_usage_names_the_files_and_the_options_that_a_command_needs(command):
    usage = APP[command].usage.split()
    words = {word.strip("[].") for word in usage}
    assert usage[:3] == ["Usage:", "clutchid", command]
    assert "ARGS" not in words
    files = {a.name for a in arguments(command) if not a.name.startswith("--")}
    files |= {
        a.name.removeprefix("--").upper() for a in arguments(command) if a.field_info.kind.name == "VAR_POSITIONAL"
    }
    assert {name.upper() for name in files} <= words
    assert {a.name for a in options(command) if a.required} <= words


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_empties_a_list(command):
    assert [name for a in options(command) for name in a.names if name.startswith("--empty-")] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_many_options_are_in_groups(command):
    groups = Counter(group.name for a in options(command) for group in a.parameter.group)
    assert set(groups) <= set(GROUPS)
    assert len(options(command)) < MANY or len(groups) >= 3


def test_an_option_is_in_the_same_group_in_every_command():
    groups = {}
    for command in COMMANDS:
        for a in options(command):
            groups.setdefault(a.name, set()).update(group.name for group in a.parameter.group)
    assert {name for name, groups_of_name in groups.items() if len(groups_of_name) > 1} == HOMONYMS
    assert set().union(*groups.values()) == set(GROUPS)


def test_the_help_of_a_fit_begins_with_its_usage_and_shows_no_default_that_says_nothing(capsys):
    assert called("fit", "--help", "all") == 0
    said = capsys.readouterr().out
    assert said.startswith("Usage: clutchid fit LOGS... [OPTIONS]\n")
    places = [said.find(f"─ {title} ─") for title in ("Arguments", "Common options", "Method and search", "Output")]
    assert -1 not in places
    assert places == sorted(places)
    assert [word for word in ("[default: False]", '[default: ""]', "--empty-", "[ARGS") if word in said] == []


@pytest.mark.parametrize("command", ["fit", "calibrate", "estimate"])
def test_the_help_of_a_fit_fits_a_screen_and_names_all_options(command, capsys):
    assert called(command, "--help") == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    words = {word.strip(",.") for line in lines for word in line.split()}
    assert {name for a in options(command) for name in a.names} <= words
    assert f"More options, listed by `clutchid {command} --help all`: " in " ".join(lines)
