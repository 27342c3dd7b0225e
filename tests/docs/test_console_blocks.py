"""The commands of the documentation print what its pages show, but for those that take long."""

import importlib.util
import re
from pathlib import Path

import pytest

from fixtures.cases import case_tables
from fixtures.once import fits_once
from fixtures.programs import path_of

CASES = case_tables(__file__, "test_console_blocks")

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def _console():
    spec = importlib.util.spec_from_file_location("console", ROOT / "benchmarks" / "docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


console = _console()
#: Programs that commands of a page call.
PROGRAMS = {"cc": "cc|make|clutchid export", "make": "make"}
PAGES = {page.relative_to(ROOT).as_posix(): page for page in console.pages()}


@fits_once()
@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_a_page_print_what_it_shows(blank, page):
    for name, commands in PROGRAMS.items():
        if re.search(rf"^\$ ({commands})\b", PAGES[page].read_text(encoding="utf-8"), re.MULTILINE):
            path_of(name)
    changes = console.differences(PAGES[page].read_text(encoding="utf-8"), long=False)
    assert not changes, "\n".join([*map(str, changes), f"if that is right: python benchmarks/docs.py {page} --write"])


def test_the_readme_shows_what_the_first_hour_prints():
    readme, source = (path.read_text(encoding="utf-8") for path in (console.README, console.SOURCE))
    assert len([step for block in console.blocks(readme) for step in block.steps]) == 4
    texts = console.excerpts(readme, source)
    assert not texts, "\n".join([*map(str, texts), "if that is right: python benchmarks/docs.py README.md --write"])
    assert len(console.excerpts(readme, source.replace("trust    good", "trust    none"))) == 2


def test_most_pages_of_commands_have_an_example_that_runs():
    text = {name: page.read_text(encoding="utf-8") for name, page in PAGES.items()}
    short = {name for name, page in text.items() if any(b.steps and not b.long for b in console.blocks(page))}
    assert len([name for name in short if "commands" in name]) >= 5


PAGE = """
<!-- file note.txt -->
```text
two 22
```

```console
$ cat \\
  note.txt  # a comment
two 22.3
$ ls missing; false
...
$ echo $?
1
$ false
[exit code 1]
```

<!-- long -->
```console
$ cat note.txt
three
```
"""


def test_a_page_whose_outputs_agree_to_two_digits_has_no_differences():
    assert console.differences(PAGE, long=False) == []


def test_a_long_block_runs_only_where_it_is_wanted_and_can_be_rewritten():
    changes = console.differences(PAGE, long=True)
    assert [(change.step.command, change.printed) for change in changes] == [("cat note.txt", "two 22\n")]
    assert console.rewritten(PAGE, changes) == PAGE.replace("three\n", "two 22\n")


@pytest.mark.parametrize(("expected", "printed", "same"), CASES["texts"])
def test_texts_that_mean_the_same_are_the_same_and_others_are_not(expected, printed, same):
    assert console.same(expected, printed) == same


def test_an_output_is_shortened_as_it_was_before():
    old = "```console\n$ seq 9\n0\n...\n8\n9\n```\n"
    changes = console.differences(old, long=False)
    assert console.rewritten(old, changes) == "```console\n$ seq 9\n1\n...\n8\n9\n```\n"
