"""A self-contained page: sections of text, tables and figures, rendered from one template into one HTML file."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Literal

from clutchid.reports.link import Link
from clutchid.reports.tables import Table, to_html

__all__ = [
    "Block",
    "Bullets",
    "Details",
    "Notice",
    "Page",
    "Picture",
    "Section",
    "Sortable",
    "Text",
    "escape",
    "render",
]


#: Letters that no text of a page has: control characters, and marks that hide text or turn the direction of writing.
_UNSHOWN = re.compile(
    "[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff\ufff9-\ufffb]"
)


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph of HTML; the caller must escape all external text."""

    html: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of HTML items."""

    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Notice:
    """A highlighted message in plain text, with an optional list: success, warning or failure."""

    text: str
    kind: Literal["ok", "warning", "failed"] = "warning"
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure, PNG or an SVG element, with a caption in HTML; `alt` is its description in plain text."""

    figure: bytes | str
    caption: str
    alt: str

    @property
    def address(self) -> str:
        """The image as a data URL: the names of elements in an SVG cannot clash with those of another on the page."""
        kind, content = ("svg+xml", self.figure.encode()) if isinstance(self.figure, str) else ("png", self.figure)
        return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


@dataclass(frozen=True, slots=True)
class Details:
    """Collapsible blocks under a summary line; expanded in print."""

    summary: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Sortable:
    """A long table that its reader sorts and filters, 200 rows at a time; at most one on a page, outside details.

    All rows are in the page, so it can be read, searched and printed where no script runs.
    """

    table: Table


Block = Text | Bullets | Notice | Picture | Table | Sortable | Details


@dataclass(frozen=True, slots=True)
class Section:
    """A heading in plain text and its content."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """A page: title and subtitle in plain text, sections, provenance, and the page that this one is a part of."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)
    home: Link | None = None

    @property
    def has_script(self) -> bool:
        """Whether the page needs the script of a table that can be sorted."""
        return any(isinstance(block, Sortable) for section in self.sections for block in section.blocks)


def render(page: Page) -> str:
    """The page as self-contained HTML, with a question mark for each letter that cannot be shown."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("clutchid.reports"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    template = environment.get_template("page.html.j2")
    script = environment.get_template("sortable.js").render() if page.has_script else ""
    html = template.render(page=page, kind=_kind, table=to_html, script=script, policy=_policy(script))
    return _UNSHOWN.sub("?", html)


def _policy(script: str) -> str:
    """What a page may load and run: its own styles and pictures, and this script alone, by its hash."""
    allowed = [
        "default-src 'none'",
        "img-src data:",
        "style-src 'unsafe-inline'",
        "base-uri 'none'",
        "form-action 'none'",
    ]
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        allowed.append(f"script-src 'sha256-{digest}'")
    return "; ".join(allowed)


def _kind(block: Block) -> str:
    return type(block).__name__.lower()
