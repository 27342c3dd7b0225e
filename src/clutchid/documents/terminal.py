"""A document for a terminal: rows as lines, with their labels in a column of their own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from textwrap import fill
from typing import NamedTuple

from clutchid.documents.document import LabelRow, Level
from clutchid.names import printable

#: Least columns of the labels.
_LABEL = 9


class TextLine(NamedTuple):
    """A line: its label, filled up to the column of the texts, its text, and its mood."""

    label: str
    text: str
    mood: Level = ""


def lines_of(rows: Iterable[LabelRow], width: int) -> Iterator[TextLine]:
    """Lines of rows, wrapped at words, without control characters."""
    rows = list(rows)
    margin = max([_LABEL, *(len(row.label or "") + 2 for row in rows)])
    for row in rows:
        lines = [printable(line) for line in row.text.splitlines()]
        label = "" if row.label is None else row.label.ljust(margin)
        if not row.fixed and row.label is None:
            lines = fill("\n".join(lines), width, subsequent_indent="  ").splitlines()
        elif not row.fixed:
            lines = fill("\n".join(lines), max(width - margin, 20), break_on_hyphens=False).splitlines()
        for i, line in enumerate(lines):
            yield TextLine(label if i == 0 else " " * len(label), line, row.mood)


def text_of(rows: Iterable[LabelRow], width: int = 80) -> str:
    """Rows as plain text."""
    return "\n".join(f"{line.label}{line.text}".rstrip() for line in lines_of(rows, width))
