"""What the documentation says is what the code does."""

import importlib.util
import pydoc
import re
from pathlib import Path

import pytest

from clutchid.cli import app
from clutchid.estimation.assess.verdict import NOISE_ONLY, PAPER_HELD, PAPER_OFF
from clutchid.exports.requirements import REQUIREMENTS
from clutchid.log.states import STATES
from clutchid.observer.flags import FLAGS
from clutchid.parameters import GROUPS, Parameters

ROOT = Path(__file__).resolve().parents[2]


def script(name):
    """A script of the folder of pages."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def printed(monkeypatch):
    """The script that prints parts of pages."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return script("printed")


@pytest.fixture(scope="module")
def equations():
    """The page of equations as the code makes it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return script("make_equations").page()


def test_the_page_of_equations_is_the_one_that_the_code_makes(equations):
    assert (ROOT / "docs" / "equations.md").read_text(encoding="utf-8") == equations


def test_the_page_of_equations_has_every_equation_of_the_paper_and_their_names():
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    headings = re.findall(r"^### (\(.*?\))(?: [A-Z])", text, re.MULTILINE)
    numbers = set()
    for heading in headings:
        equations = [int(number) for number in re.findall(r"\d+", heading)]
        numbers |= set(range(equations[0], equations[-1] + 1)) if " to " in heading else set(equations)
    assert sorted(numbers) == [number for number in range(1, 27) if number != 22]  # the paper has no Eq. (22)
    assert "### (2) LuGre friction" in text
    assert "Flow function psi" in text


def test_a_formula_names_other_functions_and_constants_and_does_not_expand_them(equations):
    flow = equations.partition("`orifice_flow`")[2].partition("###")[0]
    assert r"\psi{\left(\frac{p_l}{p_h},B,B_0,r_{lam} \right)}" in flow
    assert "p_N" in equations.partition("`leak_flow`")[2].partition("###")[0]


def test_the_readme_is_read_in_a_minute():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= 70
    headings = re.findall(r"^## (.+)$", readme, re.MULTILINE)
    assert headings == ["Install", "Three commands", "What it is not"]
    assert re.search(r"!\[[^\]]+\]\(docs/images/\w+\.png\)", readme.partition("## ")[0])


def test_the_readme_says_what_an_interval_without_a_calibration_is_in_the_figures_of_the_program():
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"`±` {NOISE_ONLY.removeprefix('± ')}" in readme
    assert f"{PAPER_OFF} % of its peak, and its band contained {PAPER_HELD} % of the points" in readme


def test_the_start_page_names_every_verb_of_the_command_line():
    verbs = [name for name in app() if not name.startswith("-")]
    assert len(verbs) > 10
    page = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert [verb for verb in verbs if f"| [{verb}](commands/{verb}.md) |" not in page] == []


#: Pages whose names a reader looks up in the repository.
PROSE = {
    page: re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md"))
}
PLACES = (ROOT, ROOT / "src" / "clutchid", ROOT / "docs")


def named(pattern):
    """What a pattern finds in the code spans of prose, with the page."""
    spans = ((page, span) for page, text in PROSE.items() for span in re.findall(r"`([^`\n]+)`", text))
    return [(page, name) for page, span in spans for name in re.findall(pattern, span)]


def test_every_path_in_prose_exists():
    paths = named(r"(?<![\w./-])(?:(?:src|tests|docs|benchmarks)/[\w./-]*\w|[\w/-]+\.py\b)|^(?:[a-z_]+/){2,}$")
    assert len(paths) > 200
    lost = {path for _, path in paths if not any((place / path).exists() for place in PLACES)}
    assert {path for path in lost if not [*(ROOT / "tests").rglob(path)]} == set()


def test_every_name_in_prose_exists():
    modules = named(r"(?<![\w/-])clutchid(?:\.[a-z]\w*)+(?:\.[A-Z]\w*)?")
    struct = {"from_matlab.md", "formats.md"}  # pages with the fields of MATLAB's struct `clutchid`
    assert [name for page, name in modules if page.name not in struct and pydoc.locate(name) is None] == []
    pairs = {pair for text in PROSE.values() for pair in re.findall(r"`(\w+)`\s(?:in|of)\s`([\w/]+\.py)`", text)}
    files = {file: next(place / file for place in PLACES if (place / file).exists()) for _, file in pairs}
    assert [pair for pair in pairs if not re.search(rf"\b{pair[0]}\b", files[pair[1]].read_text("utf-8"))] == []
    packages = {name for text in PROSE.values() for name in re.findall(r"[Pp]ackages?\s`([a-z_]+)`", text)}
    assert [name for name in packages if not (PLACES[1] / name).is_dir()] == []


def test_what_pages_leave_to_the_code_is_printed_with_a_row_for_each_of_its_facts(printed):
    marks = [mark for page in (ROOT / "docs").rglob("*.md") for mark in printed.MARK.findall(page.read_text("utf-8"))]
    assert set(marks) == set(printed.PRINTED)
    for part, names in (
        ("flags", FLAGS),
        ("states", STATES),
        ("parameters", Parameters.rows()),
        ("priors", Parameters.rows()),
    ):
        assert re.findall(r"^\| `(\w+)`", printed.with_printed(f"<!-- printed {part} -->"), re.MULTILINE) == [*names]
    assert set(re.findall(r"^\| (.+) \| `", printed.PRINTED["changes"](), re.MULTILINE)) == set(GROUPS)
    assert "| `--start` | Calibration (TOML) with" in printed.options("look")
    assert "| `cli` | The command line: one module per command |" in printed.PRINTED["packages"]()
    assert re.findall(r"^\| (R\d+) \|", printed.PRINTED["requirements"](), re.MULTILINE) == [*REQUIREMENTS]


def test_the_command_that_ci_runs_is_in_the_readme():
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    start = re.search(r"grep -m 1 '\^([^']+)' README.md", script)
    commands = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert start
    assert [line for line in commands if line.startswith(start[1]) and "pytest" in line]
