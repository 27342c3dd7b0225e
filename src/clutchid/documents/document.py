"""`Document`: a result as rows, notices, sections of tables and figures, and data, for every medium."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from clutchid.documents.tables import Link, ReportTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from clutchid.log import Log

#: Grade of a row or a notice: good news, what needs attention, what prevents the use of the result; or neither.
Level = Literal["", "good", "with care", "none"]


class On(Flag):
    """Media that a row is for: a terminal in brief or in full, and pages (HTML, notebook, application)."""

    BRIEF = auto()
    FULL = auto()
    PAGE = auto()
    TERMINAL = BRIEF | FULL
    ALL = BRIEF | FULL | PAGE


class LabelRow(NamedTuple):
    """A label, which is empty below the first of several rows, and its text.

    The text is wrapped at words unless it is `fixed`, as a table is. Without any label, None, it takes the whole width.
    `cells` are those of a table in the text, by row, for media that have tables.
    """

    label: str | None
    text: str
    mood: Level = ""
    fixed: bool = False
    on: On = On.ALL
    cells: tuple[tuple[str, ...], ...] = ()


class NextStep(NamedTuple):
    """The next step: its kind, for a page with buttons, why, and the command that does it."""

    kind: str
    why: str
    command: str


class Markup(str):
    """HTML of our own; all other texts are escaped."""

    __slots__ = ()

    def __html__(self) -> str:
        """The same, for the templates."""
        return self


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list."""

    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Notice:
    """A highlighted message with an optional list."""

    text: str
    level: Level = "with care"
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure, or the bytes of a PNG file, with a caption; `alt` is its description for screen readers.

    A `dense` figure, one of samples over time, is drawn as PNG.
    """

    figure: Figure | bytes
    caption: str
    alt: str
    dense: bool = False


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


@dataclass(frozen=True, slots=True)
class Chapter:
    """A heading and its content."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """A result for every medium.

    Attributes
    ----------
    title, subtitle
        What it is about.
    rows
        The answer, each row with the media that it is for.
    notices
        What needs attention besides the rows, or is good to know.
    sections
        Makes tables and figures by heading, for a page.
    figure
        Makes the picture that stands beside the answer; None where there is nothing to draw.
    data
        Makes the JSON object.
    next
        The next step, where one is known.
    command, sources
        The command that repeats the result, and the SHA-256 of its files by name.
    home
        The page that this one is a part of.
    """

    title: str
    subtitle: str = ""
    rows: tuple[LabelRow, ...] = ()
    notices: tuple[Notice, ...] = ()
    sections: Callable[[], Sequence[Chapter]] = tuple
    figure: Callable[[], Picture] | None = None
    data: Callable[[], dict[str, Any]] = dict
    next: NextStep | None = None
    command: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    home: Link | None = None

    def rows_on(self, medium: On) -> list[LabelRow]:
        """The rows for a medium."""
        return [row for row in self.rows if row.on & medium]


def page_rows(document: Document) -> list[dict[str, Any]]:
    """The rows for pages as plain values."""
    names = ("label", "text", "mood", "fixed")
    return [{name: getattr(row, name) for name in names} for row in document.rows_on(On.PAGE)]


def labelled(label: str, texts: Sequence[str], on: On = On.ALL) -> list[LabelRow]:
    """A row for each text, the first of them with the label."""
    return [LabelRow(label if i == 0 else "", text, on=on) for i, text in enumerate(texts)]


def sources_of(logs: Iterable[Log]) -> dict[str, str]:
    """SHA-256 of the files of recordings by name."""
    return {log.metadata.get("source", log.name): log.metadata["sha256"] for log in logs if "sha256" in log.metadata}
