"""A look at a file as a document: its contents and the checks on it."""

from __future__ import annotations

from clutchid.documents.document import Document, Row
from clutchid.documents.look_json import look_json
from clutchid.documents.results import Looked


def look_document(looked: Looked, command: str = "") -> Document:
    """Document of a look at a file."""
    rows = (Row(None, looked.contents.table(), fixed=True), Row(None, f"\n{looked.checks}", fixed=True))
    return Document("Look at a file", rows=rows, data=lambda: look_json(looked), command=command)
