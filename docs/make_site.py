"""Build the documentation site: ``python docs/make_site.py FOLDER [--gallery]``, with the extra ``docs``.

The pages are those of docs/, the changelog and the tables of benchmarks/results, as they lie in the repository, and
an API reference made from the docstrings; with ``--gallery`` also the pictures that docs/gallery draws. They are
copied to a temporary folder with what a site needs, so no file of the repository changes; every warning of Sphinx is
an error.
"""

from __future__ import annotations

import argparse
import gc
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Sequence
from fnmatch import fnmatch
from importlib import import_module
from inspect import getsourcelines
from os.path import relpath
from pathlib import Path

import printed
from api_pages import api_pages
from make_gallery import gallery

import clutchid

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

#: The navigation: captions and pages. A page of docs/ that is in none of them is put under the last.
NAVIGATION = {
    "Start": ["install", "first_hour", "recordings", "excitation", "result", "trouble", "glossary"],
    "Guides": [
        "calibrate_read_compare", "from_matlab", "from_canape", "control_unit", "assumptions", "actuators",
        "own_models", "truck", "fleet_recipes",
    ],
    "Commands": ["commands/*"],
    "Python": ["python", "gallery/index", "api/index"],
    "Physics": ["models", "equations", "friction", "deviations"],
    "Methods": ["methods", "derivations", "derivations_online", "benchmarks", "results/*"],
    "Project": ["formats", "architecture", "contributing", "changelog", "cite"],
}  # fmt: skip

#: Places in the site of pages that do not lie in docs/.
OUTSIDE = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}

_LINK = re.compile(r"\[([^\]\n]*)\]\(([^)\s]+)\)")


def sources() -> dict[Path, str]:
    """Pages of the site: the file in the repository, and its place in the site."""
    pages = {page: page.relative_to(DOCS).as_posix() for page in sorted(DOCS.rglob("*.md"))}
    pages |= {page: f"results/{page.name}" for page in sorted((ROOT / "benchmarks" / "results").glob("*.md"))}
    return pages | {ROOT / name: place for name, place in OUTSIDE.items() if (ROOT / name).exists()}


def title(page: Path) -> str:
    """The first heading of a page."""
    return re.search(r"^# (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)[1]  # type: ignore[index]


def site_text(page: Path, places: dict[Path, str], stage: Path) -> str:
    """The text of a page for Sphinx; files that it links to are copied to `stage`.

    A link leads to the place in the site, and shows the title of a page where it shows the name of its file.
    """

    def link(match: re.Match[str]) -> str:
        shown, target = match.groups()
        name, sign, section = target.partition("#")
        if not name or re.match(r"[a-z]+:", target):
            return match[0]
        file = (page.parent / name).resolve()
        if not file.is_file():
            sys.exit(f"{page.relative_to(ROOT)}: the link {target} leads to no file.")
        if file not in places or file.suffix != ".md":
            copied = DOCS in file.parents and file.relative_to(DOCS).as_posix()
            place = places.setdefault(file, copied or f"files/{file.name}")
            (stage / place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, stage / place)
        elif shown in {name, file.name}:
            shown = title(file)
        return f"[{shown}]({relpath(places[file], Path(places[page]).parent)}{sign}{section})"

    parts = re.split(r"(^```.*?^```$)", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for i in range(0, len(parts), 2):
        parts[i] = _LINK.sub(link, re.sub(r"\$`([^`\n]+)`\$", r"{math}`\1`", parts[i]))
    return "".join(parts)


def navigation(places: Iterable[str]) -> str:
    """The hidden tables of contents for the start page; a page that no caption names comes under the last."""
    pages = sorted(place.removesuffix(".md") for place in places if place.endswith(".md") and place != "index.md")
    groups = {
        caption: [page for name in names for page in _matching(name, pages)] for caption, names in NAVIGATION.items()
    }
    listed = {page for group in groups.values() for page in group}
    groups[[*groups][-1]] += [page for page in pages if page not in listed]
    return "".join(
        "\n```{toctree}\n:hidden:\n:caption: " + caption + "\n\n" + "\n".join(group) + "\n```\n"
        for caption, group in groups.items()
    )


def _matching(name: str, pages: Sequence[str]) -> list[str]:
    if name == "api/index":
        return [name]
    return [page for page in pages if fnmatch(page, name)]


def _function(match: re.Match[str]) -> str:
    """The function of an equation as a link to its docstring, with its file and line."""
    name, module = match.groups()
    item = getattr(import_module(f"clutchid.model.{module}"), name)
    home = "clutchid" if name in clutchid.__all__ else f"clutchid.model.{module}"
    line = getsourcelines(item)[1]
    return f"{{py:obj}}`{name} <{home}.{name}>` in `model/{module}.py`, line {line}"


def stage(folder: Path, with_gallery: bool) -> None:
    """Write all that Sphinx needs to `folder`."""
    shutil.copytree(DOCS / "site", folder, dirs_exist_ok=True)
    places = sources()
    if with_gallery:
        gallery(folder / "gallery")
    for page, place in [*places.items()]:
        text = printed.with_printed(site_text(page, places, folder))
        if place.startswith("commands/"):
            text = text.replace("## Exit codes", f"## Options\n\n{printed.options(page.stem)}\n\n## Exit codes")
        if place == "index.md":
            text += navigation([*places.values(), *(["gallery/index.md"] if with_gallery else [])])
        if place == "equations.md":
            text = re.sub(r"^`(\w+)` in `model/(\w+)\.py`$", _function, text, flags=re.MULTILINE)
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(text, encoding="utf-8")
    (folder / "api").mkdir()
    for name, text in api_pages(printed.parameters()).items():
        (folder / "api" / name).write_text(text, encoding="utf-8")


def build(out: Path, with_gallery: bool = False, jobs: str = "auto") -> int:
    """Build the site in `out`, and return the exit code of Sphinx: 0 without an error or a warning."""
    from sphinx.cmd.build import build_main

    gc.disable()  # nearly all that Sphinx makes stays until its end: a fifth of the time goes with looking at it again
    with tempfile.TemporaryDirectory() as folder:
        stage(Path(folder) / "pages", with_gallery)
        doctrees = str(Path(folder) / "doctrees")
        return build_main(
            ["-q", "-j", jobs, "-W", "--keep-going", "-d", doctrees, str(Path(folder) / "pages"), str(out)]
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the site is written")
    parser.add_argument("--gallery", action="store_true", help="draw the gallery too, or take kept pictures")
    parser.add_argument("--jobs", default="auto", help="number of processes; one takes less time of processors")
    options = parser.parse_args()
    code = build(options.folder, options.gallery, options.jobs)
    if code == 0:
        print(f"written: {options.folder.resolve() / 'index.html'}")
    sys.exit(code)
