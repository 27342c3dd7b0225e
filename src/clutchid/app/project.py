"""Recordings, maps and results that a page keeps in the folder of its project, as they were when the server ended."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

from clutchid.app.records import Observation, PageItem, Recording, Result, content
from clutchid.documents.json_text import json_text
from clutchid.errors import DataError
from clutchid.files import write_text
from clutchid.verbs.options import RequestText

_FILE, _FORMAT = "board.json", 1
_KINDS: dict[str, type[PageItem]] = {kind.__name__: kind for kind in (Recording, Result, Observation)}
_ID = re.compile(r"(recording|result|observation)-\d+")


def kept(item: Any) -> dict[str, Any] | None:
    """The part of a record that is kept: recordings without content, others if they have ended."""
    again = isinstance(item, Recording)
    if not again and (not isinstance(item, Result | Observation) or item.status not in ("done", "failed")):
        return None
    left = {"look": None, "found": None, "status": "reading", "message": ""} if again else {}
    entry = content(item) | left
    return {"kind": type(item).__name__, **{field.name: entry[field.name] for field in fields(item)}}


def write_project(folder: Path, items: Iterable[PageItem]) -> None:
    """Write what is kept of records.

    Raises
    ------
    ExportError
        If it cannot be written; what stood there is unchanged.
    """
    text = json_text({f"items {_FORMAT}": [entry for item in items if (entry := kept(item))]})
    write_text(text.replace(json.dumps(f"{folder}/")[1:-1], "./"), folder / _FILE)


def read_project(folder: Path) -> list[PageItem]:
    """The records that were written, none where there is nothing yet.

    Raises
    ------
    DataError
        If it is damaged, or of another version; it is left as it is.
    """
    path = folder / _FILE
    if not path.exists():
        return []
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return [_item(folder, dict(entry)) for entry in stored[f"items {_FORMAT}"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(
            f"{path}: is damaged, or of another version, and is left as it is; move it away for a new project, or name "
            "another folder."
        ) from error


def _item(folder: Path, entry: dict[str, Any]) -> PageItem:
    kind = _KINDS[entry.pop("kind")]
    if not _ID.fullmatch(entry["id"]):
        raise ValueError(f"id {entry['id']}")
    for name in ("path", "map"):
        if entry.get(name) is not None:
            entry[name] = folder / entry[name]
    for name in ("recordings", "verify", "exports"):
        if name in entry:
            entry[name] = tuple(entry[name])
    if entry.get("options") is not None:
        entry["options"] = RequestText(**entry["options"])
    return kind(**entry)
