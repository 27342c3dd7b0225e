"""Links of the documentation lead somewhere, and every page can be reached from the start page."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
RESULTS = ROOT / "benchmarks" / "results"
PAGES = [
    ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md",
    *sorted(DOCS.rglob("*.md")), *sorted(RESULTS.glob("*.md")),
]  # fmt: skip


def links(page: Path) -> list[tuple[Path, str]]:
    """The local links of a page: a file, and a section or nothing."""
    text = re.sub(r"```.*?```|`[^`\n]+`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", text)
    return [((page.parent / name).resolve() if name else page, section) for name, section in targets]


def sections(page: Path) -> set[str]:
    """The headings of a page as a link names them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


def test_every_link_leads_to_a_file():
    assert [f"{page.name}: {target.name}" for page in PAGES for target, _ in links(page) if not target.exists()] == []


def test_every_link_to_a_section_leads_to_its_heading():
    named = [(page, target, section) for page in PAGES for target, section in links(page) if section]
    dead = [f"{page.name}: {target.name}#{to}" for page, target, to in named if to not in sections(target)]
    assert len(named) > 10
    assert dead == []


def test_every_page_can_be_reached_from_the_start_page():
    reached, new = set(), {DOCS / "index.md"}
    while new:
        reached |= new
        new = {to for page in new for to, _ in links(page) if to.suffix == ".md" and DOCS in to.parents} - reached
    assert sorted(page.relative_to(DOCS).as_posix() for page in set(DOCS.rglob("*.md")) - reached) == []


def test_the_page_of_benchmarks_leads_to_every_file_of_results_and_names_every_command():
    page = DOCS / "benchmarks.md"
    assert set(RESULTS.glob("*.md")) - {target for target, _ in links(page)} == set()
    text = page.read_text(encoding="utf-8")
    assert [path.name for path in (ROOT / "benchmarks").glob("*.py") if f"benchmarks/{path.name}" not in text] == []
