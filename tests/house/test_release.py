"""What a release needs: one version, a README that an index can show, citations, extras, pinned actions."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

import clutchid

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
WORKFLOW = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def expanded(extra):
    """Names of the extras of users that an extra consists of."""
    inner = {name for line in EXTRAS[extra] for name in re.findall(r"[a-z]+", line.partition("[")[2])}
    return {extra} | set().union(*(expanded(inner_extra) for inner_extra in inner)) if inner else {extra}


def test_the_version_is_the_same_wherever_it_stands():
    ours = PROJECT["project"]["version"]
    assert clutchid.__version__ == version("clutchid") == ours
    assert yaml.safe_load(text("CITATION.cff"))["version"] == ours
    assert f"version = {{{ours}}}" in text("docs/cite.md")
    assert f"## {ours}" in text("CHANGELOG.md")
    asking = [path.name for path in (ROOT / "src").rglob("*.py") if 'version("clutchid")' in path.read_text("utf-8")]
    assert asking == ["version.py"]


def test_an_index_gets_a_readme_without_links_or_pictures_that_lead_nowhere():
    shown = text("README.md")
    for change in PROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        shown = re.sub(change["pattern"], change["replacement"], shown)
    assert re.findall(r"\]\((?!https?:)", shown) == []
    assert "Dotted are the true loads" not in shown, "the caption of a picture that is left out"
    assert len(shown) > 0.8 * len(text("README.md"))
    assert "docs/index.md leads on from here" in shown


def test_the_citation_has_the_authors_and_the_title_of_the_paper():
    (paper,) = yaml.safe_load(text("CITATION.cff"))["references"]
    assert paper["title"] == "Estimation of electropneumatic clutch actuator load characteristics"
    assert [author["family-names"] for author in paper["authors"]] == ["Langjord", "Johansen", "Snare", "Bratli"]
    assert all(author["family-names"] in text("docs/cite.md") for author in paper["authors"])


def test_the_citation_is_that_of_the_print(shared):
    print_ = (shared / "paper" / "paper.txt").read_text(encoding="utf-8")
    (paper,) = yaml.safe_load(text("CITATION.cff"))["references"]
    assert paper["title"] in print_
    names = [f"{author['given-names']} {author['family-names']}" for author in paper["authors"]]
    assert [name for name in names if name not in print_] == []
    # no year and no proceedings in its head: none is added
    assert re.search(r"\b(19|20)\d\d\b|[Pp]roceedings", print_.split("1. INTRODUCTION")[0]) is None
    assert paper.keys() == {"type", "title", "authors"}
    places = ("docs/cite.md", "src/clutchid/study/templates/prose.html.j2")
    assert [place for place in places if "names neither proceedings nor year" not in text(place)] == []


def test_every_extra_holds_something_and_all_holds_those_of_users():
    assert [name for name, lines in EXTRAS.items() if not lines] == []
    developers = {"test", "lint", "docs", "delta", "export", "bench", "all"}
    assert set(EXTRAS) - developers <= expanded("all")
    page = text("docs/install.md")
    assert [name for name in EXTRAS if name not in {"test", "lint"} and f"| `{name}` |" not in page] == []


def test_the_sdist_takes_every_file_of_the_top_folder_that_git_has():
    include = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    wanted = {"CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "LICENSE", "constraints.txt"}
    wanted |= {"hatch_build.py", "src", "tests", "benchmarks", "docs", ".ci", ".github", "README.md", "CHANGELOG.md"}
    assert [name for name in wanted if not any(Path(f"/{name}").match(pattern) for pattern in include)] == []
    assert [name for name in wanted if not (ROOT / name).exists()] == []


def test_the_workflow_pins_every_action_by_its_commit_and_every_tool_by_its_version():
    jobs = yaml.safe_load(WORKFLOW)["jobs"]
    actions = [step["uses"] for job in jobs.values() for step in job["steps"] if "uses" in step]
    assert len(actions) > 5
    assert [action for action in actions if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action)] == []
    assert re.findall(r"\buv\b(?!==| pip| publish)(?= )", WORKFLOW) == []


def test_the_workflow_tries_every_python_that_the_classifiers_name():
    named = [c.rpartition(" ")[2] for c in PROJECT["project"]["classifiers"] if re.search(r":: 3\.\d+$", c)]
    tried = yaml.safe_load(WORKFLOW)["jobs"]["quick"]["strategy"]["matrix"]["python"]
    assert set(named) <= set(tried)
    assert PROJECT["project"]["requires-python"] == f">={named[0]}"


def test_the_workflow_says_that_it_has_not_run():
    assert "It has not run yet" in WORKFLOW


@pytest.mark.parametrize(
    "path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")), ids=lambda path: path.stem
)
def test_an_issue_template_is_valid_and_asks_for_something(path):
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    if path.stem == "config":
        assert set(form) == {"blank_issues_enabled"}
        return
    assert {"name", "description", "body"} <= set(form)
    assert [field["attributes"]["label"] for field in form["body"]]
    assert len({field["id"] for field in form["body"]}) == len(form["body"])
