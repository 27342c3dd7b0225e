"""A document as a self-contained page: one HTML file with styles, pictures and provenance."""

from __future__ import annotations

import base64
import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from os import PathLike
from typing import Any

from clutchid.documents.document import Block, Bullets, Details, Document, LabelRow, Notice, On, Picture, Sortable, Text
from clutchid.documents.figures import png, svg
from clutchid.documents.tables import Link, ReportTable, to_html
from clutchid.files import write_text

#: Letters that no text of a page has: control characters, and marks that hide text or turn the direction of writing.
_UNSHOWN = re.compile(
    "[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff\ufff9-\ufffb]"
)


#: Blocks as the template calls them.
_KINDS: dict[type[Block], str] = {
    Text: "text", Bullets: "bullets", Notice: "notice", Picture: "picture", ReportTable: "table", Sortable: "sortable",
    Details: "details",
}  # fmt: skip


@cache
def html_templates(package: str) -> Any:
    """The environment of the HTML templates of a package, which keeps those that it has compiled."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(package), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def write_page(document: Document, path: str | PathLike[str]) -> None:
    """Write a document as one self-contained HTML file; an existing one is replaced atomically.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    write_text(page_of(document), path)


def page_of(document: Document) -> str:
    """The document as self-contained HTML, with a question mark for each letter that cannot be shown."""
    environment = html_templates("clutchid.documents")
    sections = tuple(document.sections())
    scripted = any(isinstance(block, Sortable) for section in sections for block in section.blocks)
    script = environment.get_template("sortable.js").render(part=PART) if scripted else ""
    html = environment.get_template("page.html.j2").render(
        document=document, sections=sections, answer=answer_html(document), provenance=_provenance(document),
        kind=lambda block: _KINDS[type(block)], table=to_html, address=_address, script=script, policy=_policy(script),
        part=PART, cells=_cells,
    )  # fmt: skip
    return _UNSHOWN.sub("?", html)


#: Rows of a sortable table that are shown at a time.
PART = 100


def _cells(table: ReportTable) -> str:
    """JSON within a page: the cells of a table as displayed, by column, and the address of each row or nothing."""
    cells = [[column.shown(row[i]) for row in table.rows] for i, column in enumerate(table.columns)]
    links = [row[0].address if isinstance(row[0], Link) and row[0].path else "" for row in table.rows]
    return json.dumps([cells, links], ensure_ascii=False, separators=(",", ":")).replace("<", r"\u003c")


def answer_html(document: Document) -> str:
    """The rows of a document with its picture and the next step, as a fragment."""
    return str(html_templates("clutchid.documents").get_template("answer.html.j2").render(
        groups=grouped(document.rows_on(On.PAGE)), next=document.next, address=_address,
        transposed=lambda cells: zip(*cells, strict=True), picture=document.figure() if document.figure else None,
    ))  # fmt: skip


def grouped(rows: Iterable[LabelRow]) -> list[tuple[str, list[LabelRow]]]:
    """Labels with the rows that belong to them."""
    groups: list[tuple[str, list[LabelRow]]] = []
    for row in rows:
        if row.label or not groups:
            groups.append((row.label or "", []))
        groups[-1][1].append(row)
    return groups


def _address(picture: Picture) -> str:
    """A picture as a data URL: the names of elements in an SVG cannot clash with those of another on the page."""
    figure = picture.figure
    if isinstance(figure, bytes) or picture.dense:
        kind, content = "png", figure if isinstance(figure, bytes) else png(figure)
    else:
        kind, content = "svg+xml", svg(figure).encode()
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


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


def _provenance(document: Document) -> Mapping[str, str]:
    """Names and values of everything needed to reproduce a page."""
    if not document.command:
        return {}
    about = {"command": document.command, "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")}
    about |= {name: version(name) for name in _PACKAGES}
    about |= {"Python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    return about | {f"SHA-256 of {name}": digest for name, digest in document.sources.items()}
