"""A self-contained page: sections of text, tables and figures in one HTML file, with its provenance."""

from __future__ import annotations

import base64
import hashlib
import platform
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Literal

from clutchid.documents.tables import Link, ReportTable, to_html
from clutchid.log import Log

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

    table: ReportTable


Block = Text | Bullets | Notice | Picture | ReportTable | Sortable | Details

#: Blocks as the template calls them.
_KINDS: dict[type[Block], str] = {
    Text: "text", Bullets: "bullets", Notice: "notice", Picture: "picture", ReportTable: "table", Sortable: "sortable",
    Details: "details",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PageSection:
    """A heading in plain text and its content."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Page:
    """A page: title and subtitle in plain text, sections, provenance, and the page that this one is a part of."""

    title: str
    subtitle: str
    sections: tuple[PageSection, ...]
    provenance: Mapping[str, str] = field(default_factory=dict)
    home: Link | None = None

    @property
    def has_script(self) -> bool:
        """Whether the page needs the script of a table that can be sorted."""
        return any(isinstance(block, Sortable) for section in self.sections for block in section.blocks)


@cache
def _environment() -> Any:
    """The environment of the pages, which keeps the templates that it has compiled."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("clutchid.documents"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def render(page: Page) -> str:
    """The page as self-contained HTML, with a question mark for each letter that cannot be shown."""
    environment = _environment()
    template = environment.get_template("page.html.j2")
    script = environment.get_template("sortable.js").render() if page.has_script else ""
    html = template.render(
        page=page, kind=lambda block: _KINDS[type(block)], table=to_html, script=script, policy=_policy(script)
    )
    return _UNSHOWN.sub("?", html)


def _policy(script: str) -> str:
    """Content policy of a page: its own styles and pictures, and this script alone, by its hash."""
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


_PACKAGES = ("clutchid", "numpy", "scipy", "numba")


def provenance(logs: Iterable[Log], command: str) -> dict[str, str]:
    """Names and values of everything needed to reproduce a page made from `logs` with `command`."""
    found = {"command": command, "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")}
    for name in _PACKAGES:
        found[name] = _version(name)
    found["Python"] = platform.python_version()
    found["machine"] = f"{platform.system()} {platform.machine()}"
    for log in logs:
        digest = log.metadata.get("sha256")
        if digest:
            found[f"SHA-256 of {log.metadata.get('source', log.name)}"] = digest
    return found


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed as a package"
