"""Settings of Sphinx for the documentation site, which `docs/make_site.py` builds."""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import version as version_of
from typing import Any

from api_pages import places_of_records
from furo.navigation import get_navigation_tree
from sphinx.environment.adapters.toctree import global_toctree_for_doc
from sphinx.search.en import SearchEnglish

project = "clutchid"
author = "The clutchid developers"
version = release = version_of("clutchid")
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
exclude_patterns = ["static"]
default_role = "py:obj"  # `clutchid.fit` in a docstring leads to its page, where it has one
nitpicky = False

myst_heading_anchors = 4
myst_fence_as_directive = ["math"]
suppress_warnings = ["myst.header"]  # a section may skip a level, as on the page of the glossary

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_use_unqualified_type_names = True
python_display_short_literal_types = True
maximum_signature_line_length = 80
napoleon_google_docstring = False
napoleon_use_param = False  # units and shapes stand where Sphinx looks for types
napoleon_use_rtype = False
napoleon_custom_sections = [("Attributes", "params_style")]

html_theme = "furo"
html_title = f"clutchid {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_permalinks_icon = "#"
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
mathjax_path = "mathjax/tex-svg.js"  # one file with its fonts: a built page asks for nothing outside its folder
mathjax3_config = {"options": {"enableMenu": False}}

SearchEnglish.stem = cache(SearchEnglish.stem)  # type: ignore[method-assign]  # pages share their words


def setup(app: Any) -> None:
    """Prepare docstrings before napoleon reads their sections, and the navigation in place of furo."""
    app.connect("autodoc-process-docstring", docstring, priority=100)
    app.connect("html-page-context", without_tree, priority=100)
    app.connect("html-page-context", navigation, priority=900)


def without_tree(app: Any, name: str, template: str, context: dict[str, Any], doctree: Any) -> None:  # noqa: ARG001
    """Leave the navigation to `navigation`: furo makes it anew for each page, which is a third of a build."""
    context.pop("toctree", None)


def navigation(app: Any, name: str, template: str, context: dict[str, Any], doctree: Any) -> None:  # noqa: ARG001
    """The tree of a folder with this page marked as the current one, as furo does."""
    nowhere = f"{name.rpartition('/')[0]}/nowhere".lstrip("/")
    tree, link = _tree(app.builder, nowhere), f' href="{app.builder.get_relative_uri(nowhere, name)}">'
    before, entry, after = tree.partition(f'<a class="reference internal"{link}')
    if entry:
        around: list[re.Match[str]] = []
        for tag in re.finditer(r"<(/?)(?:ul|li)([^>]*)>", before):
            around.pop() if tag[1] else around.append(tag)
        tree = f'{before}<a class="current reference internal" href="#">{after}'
        for number, tag in enumerate(reversed(around)):
            shown = tag[0].replace("<ul>", '<ul class="current">')
            shown = re.sub(r"(toctree-l\d)", r"\1 current", shown)
            rest = tree[tag.end() :]
            if "has-children" in shown:
                rest = rest.replace(' class="toctree-checkbox"', ' checked="" class="toctree-checkbox"', 1)
            tree = tree[: tag.start()] + (shown if number else f'{shown[:-2]} current-page">') + rest
    context["furo_navigation_tree"] = tree


@cache
def _tree(builder: Any, place: str) -> str:
    """The navigation of all pages, as seen from a place that is none of them."""
    options = {"collapse": False, "titles_only": True, "maxdepth": -1, "includehidden": True}
    tree = global_toctree_for_doc(builder.env, place, builder, tags=builder.tags, **options)
    return str(get_navigation_tree(builder.render_partial(tree)["fragment"]))


def docstring(app: Any, what: str, name: str, item: Any, options: Any, lines: list[str]) -> None:  # noqa: ARG001
    """Pages that a docstring names become links, NAME@EACH is no address of mail, and fields of results get types."""
    text = "\n".join(lines)
    text = re.sub(r"(?<![`\w/])docs/([\w/]+)\.md", r":doc:`/\1`", text)
    text = re.sub(r"(?<![`\w])([A-Z]\w*@[A-Z]+)\b", r"``\1``", text)
    lines[:] = (_typed(text, item) if what == "class" else text).split("\n")


def _typed(text: str, item: type) -> str:
    """`text` with the types of the fields in its section Attributes, behind their units; records are links."""
    before, heading, section = text.partition("\nAttributes\n----------\n")
    annotations = [vars(base).get("__annotations__", {}) for base in reversed(item.__mro__)]
    types = {
        name: getattr(kind, "__forward_arg__", kind) for annotation in annotations for name, kind in annotation.items()
    }

    def entry(match: re.Match[str]) -> str:
        names, unit = match[1], match[2].removeprefix(" : ")
        kind = re.sub(r"\w+", _linked, str(types.get(names.partition(",")[0], "")))
        return f"{names} : {'; '.join(filter(None, (unit, kind)))}"

    return before + heading + re.sub(r"^(\w[\w, ]*?)((?: : .*)?)(?=\n    )", entry, section, flags=re.MULTILINE)


PLACES = places_of_records()


def _linked(name: re.Match[str]) -> str:
    """The name of a type; that of a record as a link to its page."""
    return f":py:obj:`{name[0]} <{PLACES[name[0]]}>`" if name[0] in PLACES else name[0]
