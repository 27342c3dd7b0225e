"""`Board`: all that a page shows, as records with an id, and the changes of them in their order.

A page that is late needs the newest version of each record only, so nothing else is kept: it may ask for all that has
changed since any number, and gets every record at most once.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from clutchid.app import records
from clutchid.app.jobs import Job
from clutchid.app.records import content

#: A record of the board.
BoardItem = Job | records.PageItem
_Kind = TypeVar("_Kind", bound=BoardItem)


class BoardChange(NamedTuple):
    """A change of a record: its number among all changes, the id, and the record, None if it was removed."""

    number: int
    id: str
    item: BoardItem | None

    def content(self) -> dict[str, Any]:
        """The JSON object that the page gets."""
        kind = self.id.partition("-")[0]
        return {"kind": kind, "id": self.id, "content": None if self.item is None else content(self.item)}


class Board:
    """Records by id, each with the number of its last change."""

    def __init__(self) -> None:
        #: Called with a record as it was and as it is, before a page gets the change.
        self.changed: Callable[[BoardItem | None, BoardItem | None], None] = lambda *_: None
        self._newest: dict[str, BoardChange] = {}
        self._number = 0
        self._changed = asyncio.Event()

    def put(self, item: BoardItem) -> None:
        """Set a record."""
        self._change(item.id, item)

    def remove(self, id_: str) -> None:
        """Remove a record."""
        self._change(id_, None)

    def _change(self, id_: str, item: BoardItem | None) -> None:
        before = self.item(id_)
        self._number += 1
        self._newest[id_] = BoardChange(self._number, id_, item)
        self._changed.set()
        self._changed = asyncio.Event()
        self.changed(before, item)

    def update(self, id_: str, **values: Any) -> None:
        """Change some fields of a record, unless it has been removed."""
        if (item := self.item(id_)) is not None:
            self.put(replace(item, **values))

    def item(self, id_: str) -> BoardItem | None:
        """A record, or None."""
        change = self._newest.get(id_)
        return None if change is None else change.item

    def get(self, kind: type[_Kind], id_: str) -> _Kind | None:
        """A record of this kind, or None."""
        item = self.item(id_)
        return item if isinstance(item, kind) else None

    def all(self, kind: type[_Kind]) -> list[_Kind]:
        """All records of a kind, in the order of their creation."""
        return [change.item for change in self._newest.values() if isinstance(change.item, kind)]

    def kept_items(self) -> list[records.PageItem]:
        """All records but jobs, in the order of their creation."""
        return [change.item for change in self._newest.values() if change.item and not isinstance(change.item, Job)]

    def since(self, number: int) -> list[BoardChange]:
        """Changes after this number, the oldest first."""
        return sorted((item for item in self._newest.values() if item.number > number), key=lambda item: item.number)

    async def follow(self, number: int, patience: float) -> AsyncIterator[list[BoardChange]]:
        """Changes after `number`, and those to come; an empty list after `patience` in s without a change."""
        while True:
            changed = self._changed
            changes = self.since(number)
            if changes:
                number = changes[-1].number
                yield changes
                continue
            try:
                await asyncio.wait_for(changed.wait(), patience)
            except TimeoutError:
                yield []
