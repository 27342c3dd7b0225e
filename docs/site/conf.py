"""Settings of Sphinx for the documentation site, which `docs/make_site.py` builds."""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import version as version_of
from typing import Any

from api_pages import places_of_records
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
    """Prepare docstrings before napoleon reads their sections."""
    app.connect("autodoc-process-docstring", docstring, priority=100)


def docstring(app: Any, what: str, name: str, item: Any, options: Any, lines: list[str]) -> None:  # noqa: ARG001
    """Pages that a docstring names become links, NAME@EACH is no address of mail, and fields of results get types."""
    text = "\n".join(lines)
    text = re.sub(r"(?<![`\w/])docs/([\w/]+)\.md", r":doc:`/\1`", text)
    text = re.sub(r"(?<![`\w])([A-Z]\w*@[A-Z]+)\b", r"``\1``", text)
    lines[:] = (_typed(text, item) if what == "class" else text).split("\n")


def _typed(text: str, item: type) -> str:
    """`text` with the types of the fields in its section Attributes, behind their units; records are links."""
    before, heading, section = text.partition("\nAttributes\n----------\n")
    annotations = [vars(one).get("__annotations__", {}) for one in reversed(item.__mro__)]
    types = {name: getattr(kind, "__forward_arg__", kind) for found in annotations for name, kind in found.items()}

    def entry(found: re.Match[str]) -> str:
        names, unit = found[1], found[2].removeprefix(" : ")
        kind = re.sub(r"\w+", _linked, str(types.get(names.partition(",")[0], "")))
        return f"{names} : {'; '.join(filter(None, (unit, kind)))}"

    return before + heading + re.sub(r"^(\w[\w, ]*?)((?: : .*)?)(?=\n    )", entry, section, flags=re.MULTILINE)


PLACES = places_of_records()


def _linked(name: re.Match[str]) -> str:
    """The name of a type; that of a record as a link to its page."""
    return f":py:obj:`{name[0]} <{PLACES[name[0]]}>`" if name[0] in PLACES else name[0]
