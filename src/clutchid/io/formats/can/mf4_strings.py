"""Payloads that a bus log stores apart from its frames, each with its length before it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchid.errors import DataError
from clutchid.io.formats.can.frames import CLASSIC, FD, Bytes, Counts

_PREFIX = 4

#: Bytes of payloads that may wait for their frames.
_LARGEST = 1 << 26


class Strings:
    """Payloads by the offset that their frames name, while both come in; earlier ones are forgotten."""

    def __init__(self, pieces: Iterator[bytes] | None = None) -> None:
        self._pieces = pieces
        self._base = 0
        self._data = np.zeros(0, dtype=np.uint8)

    def extend(self, data: bytes) -> None:
        """Add payloads, each with its length before it.

        Raises
        ------
        DataError
            If more payloads wait than any log has.
        """
        if data:
            self._data = np.concatenate([self._data, np.frombuffer(data, dtype=np.uint8)])
        if self._data.size > _LARGEST:
            raise DataError("is damaged: payloads come without their frames")

    def ready(self, offsets: Counts) -> int:
        """How many of the first `offsets` lead to a payload that is there as a whole.

        Raises
        ------
        DataError
            If an offset leads back to what is forgotten, or the payloads cannot be read.
        """
        while self._pieces is not None and (missing := self._missing(offsets)) < offsets.size:
            piece = next(self._pieces, None)
            if piece is None:
                self._pieces = None
                return missing
            self.extend(piece)
        return self._missing(offsets)

    def payload(self, offsets: Counts) -> tuple[Bytes, Counts]:
        """The payloads at `offsets`, with zeros behind them, and their lengths; what lies before them is forgotten."""
        places = offsets - self._base
        length = np.minimum(self._lengths(places), FD)
        width = FD if length.size and length.max() > CLASSIC else CLASSIC
        column = np.arange(width)
        inside = column < length[:, None]
        last = max(self._data.size - 1, 0)
        if places.size:
            found = self._data[np.minimum(places[:, None] + _PREFIX + column, last)]
            self._data, self._base = self._data[places.min() :], self._base + int(places.min())
        else:
            found = np.zeros((0, width), dtype=np.uint8)
        return np.where(inside, found, np.uint8(0)), length

    def _missing(self, offsets: Counts) -> int:
        """The index of the first offset that is not ready; their number where all are."""
        places = offsets - self._base
        if np.any(places < 0):
            raise DataError("is damaged: a frame names a payload that is not there")
        there = places <= self._data.size - _PREFIX
        whole = there.copy()
        whole[there] = places[there] + _PREFIX + self._lengths(places[there]) <= self._data.size
        return int(np.argmin(whole)) if not whole.all() else int(offsets.size)

    def _lengths(self, places: Counts) -> Counts:
        if not places.size:
            return np.zeros(0, dtype=np.int64)
        raw = self._data[places[:, None] + np.arange(_PREFIX)]
        return np.ascontiguousarray(raw).view("<u4")[:, 0].astype(np.int64)
