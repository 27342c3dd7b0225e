"""The documentation site: built without a warning, complete, without broken links, readable without a network."""

import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from os.path import normpath
from pathlib import Path
from urllib.parse import unquote

import pytest

import clutchid
from fixtures.programs import path_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

#: Attributes that make a browser ask for a file, by tag. Links that a reader follows are no request.
LOADED = {
    "img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "audio": "src", "video": "src",
}  # fmt: skip


class Page(HTMLParser):
    """Targets, links and loaded files of a page."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loaded = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        entries = dict(attrs)
        self.ids |= {entries[name] for name in ("id", "name") if entries.get(name)}
        if tag == "a" and entries.get("href"):
            self.links.append(entries["href"])
        # of the links of the head only those that a browser loads
        if (
            tag in LOADED
            and entries.get(LOADED[tag])
            and entries.get("rel") not in {"index", "search", "next", "prev", "canonical"}
        ):
            self.loaded.append(entries[LOADED[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site."""
    pytest.importorskip("sphinx", reason="the extra docs is not installed: no Sphinx to build the site with")
    pytest.importorskip("furo", reason="the extra docs is not installed: no furo to build the site with")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, DOCS / "make_site.py", out, "--jobs", "1"]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (process.stdout, process.stderr, process.returncode) == (f"written: {out}/index.html\n", "", 0)
    return out


@pytest.fixture(scope="module")
def pages(site):
    """Parsed pages by path in the site."""
    return {path.relative_to(site): Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}


def test_every_page_of_the_repository_and_every_public_name_has_its_page(site):
    sources = {page.relative_to(DOCS).with_suffix(".html") for page in DOCS.rglob("*.md")}
    sources |= {Path("results") / f"{page.stem}.html" for page in (ROOT / "benchmarks" / "results").glob("*.md")}
    assert [str(page) for page in sources if not (site / page).is_file()] == []
    objects = set(re.findall(r'id="clutchid\.(\w+)"', "".join(p.read_text() for p in (site / "api").glob("*.html"))))
    assert set(clutchid.__all__) - objects == set()


def test_no_two_files_have_names_that_differ_in_case_only(site):
    names = [path.relative_to(site).as_posix().lower() for path in site.rglob("*")]
    assert len(names) == len(set(names))


def test_every_link_of_the_site_leads_to_a_page_and_its_section(site, pages):
    broken, files = [], {path.relative_to(site).as_posix() for path in site.rglob("*") if path.is_file()}
    for path, page in pages.items():
        for link in page.links:
            if re.match(r"[a-z]+:", link):
                continue
            target, _, section = link.partition("#")
            file = normpath(path.parent / unquote(target)) if target else str(path)
            inside = pages.get(Path(file))
            if Path(file).as_posix() not in files or (section and inside and unquote(section) not in inside.ids):
                broken.append(f"{path}: {link}")
    assert len(pages) > 120
    assert broken == []


def test_no_page_loads_anything_from_elsewhere(site, pages):
    outside = [
        (str(path), url) for path, page in pages.items() for url in page.loaded if re.match(r"([a-z]+:)?//", url)
    ]
    assert outside == []
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert re.findall(r"(?:url\(|@import\s+)[\"']?(?:https?:)?//[^\"')]*", styles) == []


def test_no_reader_is_offered_an_address_of_mail_that_is_none(pages):
    assert [
        (str(path), link) for path, page in pages.items() for link in page.links if link.startswith("mailto:")
    ] == []


def test_the_site_is_not_large(site):
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < 15e6


@pytest.mark.parametrize(("word", "page"), [("lugr", "equations"), ("psi", "equations"), ("stribeck", "models")])
def test_the_index_of_the_search_has_the_words_of_the_model(site, word, page):
    """Words are those of the index, which cuts endings off: LuGre is 'lugr'."""
    text = (site / "searchindex.js").read_text(encoding="utf-8")
    index = json.loads(text[text.index("{") : text.rindex("}") + 1])
    entries = index["terms"].get(word, []), index["titleterms"].get(word, [])
    numbers = {n for entry in entries for n in (entry if isinstance(entry, list) else [entry])}
    assert page in {index["docnames"][n] for n in numbers}


def test_the_page_of_equations_leads_to_the_line_of_each_function(site):
    text = (site / "equations.html").read_text(encoding="utf-8")
    line = int(re.search(r"orifice_flow</span>.*?valves\.py</span></code>, line (\d+)", text, re.DOTALL)[1])
    source = (ROOT / "src" / "clutchid" / "model" / "valves.py").read_text(encoding="utf-8").splitlines()
    assert source[line - 1].startswith("def orifice_flow(")


@pytest.fixture(scope="module")
def browser():
    """A browser, where there is one."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: the site is not looked at in a browser"
    )
    with playwright.sync_playwright() as started:
        shown = started.chromium.launch(executable_path=path_of("chromium"), args=["--no-sandbox"])
        yield shown
        shown.close()


def test_no_page_is_wider_than_a_phone_and_none_asks_for_anything_outside_its_folder(site, pages, browser):
    wide, outside = [], []
    page = browser.new_page(viewport={"width": 500, "height": 900})
    page.on(
        "request",
        lambda request: outside.append(request.url) if not request.url.startswith(("file:", "data:")) else None,
    )
    for path in pages:
        page.goto((site / path).as_uri(), wait_until="load")
        if page.evaluate("document.documentElement.scrollWidth") > 500:
            wide.append(str(path))
    page.close()
    assert wide == []
    assert outside == []


def test_formulas_are_drawn_and_the_search_finds_an_equation_without_a_server(site, browser):
    page = browser.new_page()
    page.goto((site / "equations.html").as_uri())
    page.locator("mjx-container svg").first.wait_for(timeout=20_000)
    page.goto((site / "search.html").as_uri() + "?q=LuGre")
    page.locator("#search-results a", has_text="The model").first.wait_for(timeout=20_000)
    page.close()
