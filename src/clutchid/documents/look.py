"""A look at a file as a document: its contents and the checks on it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Protocol

from clutchid.documents.document import Document, Row
from clutchid.documents.look_json import look_json

if TYPE_CHECKING:
    from clutchid.measurements.overview import FileOverview
    from clutchid.preparation.inspection import Inspection


class LookResult(Protocol):
    """The contents of a file, the checks on it or, in `unchecked`, why there are none, and their text."""

    @property
    def contents(self) -> FileOverview:
        """Contents of the file."""

    @property
    def inspection(self) -> Inspection | None:
        """Checks on the recording."""

    @property
    def unchecked(self) -> str:
        """Reason why there are none."""

    @property
    def checks(self) -> str:
        """Text of the checks, or that reason."""


def look_document(looked: LookResult, command: str = "") -> Document:
    """Document of a look at a file."""
    rows = (Row(None, looked.contents.table(), fixed=True), Row(None, f"\n{looked.checks}", fixed=True))
    data = partial(look_json, looked.contents, looked.inspection, looked.unchecked)
    return Document("Look at a file", rows=rows, data=data, command=command)
