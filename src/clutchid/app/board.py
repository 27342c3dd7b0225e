"""`Board`: all that a page shows, as objects with a kind and an id, and the changes of them in their order.

A page that is late needs the newest version of each object only, so nothing else is kept: it may ask for all that has
changed since any number, and gets every object at most once.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from typing import Any, NamedTuple

#: A recording, a job, a result; "session" is one object with what concerns all of them.
Content = Mapping[str, Any]


class Change(NamedTuple):
    """A version of an object: its number among all changes, and the object; None where it was removed."""

    number: int
    kind: str
    id: str
    content: Content | None


class Board:
    """Objects by kind and id, each with the number of its last change."""

    def __init__(self) -> None:
        self._newest: dict[tuple[str, str], Change] = {}
        self._number = 0
        self._changed = asyncio.Event()

    def put(self, kind: str, id_: str, content: Content | None) -> None:
        """Set an object, or remove it with None."""
        self._number += 1
        self._newest[kind, id_] = Change(self._number, kind, id_, content)
        self._changed.set()
        self._changed = asyncio.Event()

    def update(self, kind: str, id_: str, **values: Any) -> None:
        """Change some values of an object, unless it has been removed."""
        content = self.get(kind, id_)
        if content is not None:
            self.put(kind, id_, {**content, **values})

    def get(self, kind: str, id_: str) -> Content | None:
        """An object, or None."""
        change = self._newest.get((kind, id_))
        return None if change is None else change.content

    def all(self, kind: str) -> list[Content]:
        """All objects of a kind, in the order of their making."""
        found = [change.content for (of, _), change in self._newest.items() if of == kind]
        return [content for content in found if content is not None]

    def since(self, number: int) -> list[Change]:
        """What has changed after a change with this number, the oldest first."""
        return sorted(change for change in self._newest.values() if change.number > number)

    async def follow(self, number: int, patience: float) -> AsyncIterator[list[Change]]:
        """What has changed after `number`, and from then on; an empty list where nothing has for `patience` in s."""
        while True:
            changed = self._changed
            found = self.since(number)
            if found:
                number = found[-1].number
                yield found
                continue
            try:
                await asyncio.wait_for(changed.wait(), patience)
            except TimeoutError:
                yield []
