"""A self-contained page: sections of text, tables and figures, rendered from one template into one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Literal

from clutchid.report.tables import Table, to_html

__all__ = ["Block", "Bullets", "Details", "Notice", "Page", "Picture", "Section", "Text", "escape", "render"]


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph of HTML; whoever writes it has escaped what comes from outside."""

    html: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of HTML items."""

    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Notice:
    """A sentence in a box, plain text, with a list below it: what went well, what to know, what failed."""

    text: str
    kind: Literal["ok", "warning", "failed"] = "warning"
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG figure with a caption in HTML; `alt` says in plain text what it shows."""

    png: bytes
    caption: str
    alt: str

    @property
    def address(self) -> str:
        """The picture as a data address that needs no other file."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


@dataclass(frozen=True, slots=True)
class Details:
    """Blocks behind a line of plain text that opens them; on paper they are open."""

    summary: str
    blocks: tuple[Block, ...]


Block = Text | Bullets | Notice | Picture | Table | Details


@dataclass(frozen=True, slots=True)
class Section:
    """A heading in plain text and what stands below it."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """A page: title and subtitle in plain text, sections, and where it comes from."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)


def render(page: Page) -> str:
    """The page as HTML that loads nothing from anywhere."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("clutchid.report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("page.html.j2").render(page=page, kind=_kind, table=to_html)


def _kind(block: Block) -> str:
    return type(block).__name__.lower()
