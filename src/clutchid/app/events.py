"""Messages of a job while it works."""

from __future__ import annotations

import os
import time
from typing import Any

from clutchid.documents.json_text import json_text

#: Interval in s between two events about the same stage.
_GLANCE = 0.1


class Events:
    """Messages of a job as JSON lines; progress within a stage is thinned out."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "w", encoding="utf-8")
        self._stage, self._last = "", 0.0

    def say(self, event: str, **values: Any) -> None:
        """Write an event at once."""
        self._file.write(json_text({"event": event, **values}) + "\n")
        self._file.flush()

    def part(self, result: dict[str, Any]) -> None:
        """Report a partial result."""
        self.say("part", result=result)

    def progress(self, stage: str, share: float | None, words: str) -> None:
        """Report progress: a new stage at once, the same stage at most ten times a second."""
        now = time.monotonic()
        if stage != self._stage or now - self._last >= _GLANCE:
            self._stage, self._last = stage, now
            self.say("progress", stage=stage, share=share, words=words)
