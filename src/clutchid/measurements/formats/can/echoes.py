"""Frames that a log has twice: as sent by the logger, and as received by it again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from clutchid.measurements.clock import WINDOW
from clutchid.measurements.formats.can.frames import Frames
from clutchid.measurements.formats.can.streams import keys

#: Share of the frames of one direction that have a twin in the other, from which on they are echoes.
_TWINS = 0.5


def without_echoes(frames: Frames, left_out: dict[int, bool]) -> Frames:
    """The frames without those that are in the log a second time.

    `left_out` has by identifier the direction that is left out, which is decided once, for all blocks of a log.
    """
    if frames.sent is None and not left_out:
        return frames
    sent = np.zeros(len(frames), dtype=np.bool_) if frames.sent is None else frames.sent
    identifiers = keys(frames)
    for key in np.unique(identifiers[sent]).tolist():
        if key not in left_out:
            direction = _echo(frames, sent, np.flatnonzero(identifiers == key))
            left_out |= {} if direction is None else {key: direction}
    echo = np.zeros(len(frames), dtype=np.bool_)
    for key, direction in left_out.items():
        echo |= (identifiers == key) & (sent == direction)
    return frames.take(~echo) if echo.any() else frames


def _echo(frames: Frames, sent: NDArray[np.bool_], rows: NDArray[np.int64]) -> bool | None:
    """Whether the sent frames of an identifier, or else the received ones, are echoes; None where neither are."""
    way = sent[rows]
    fewer = bool(np.count_nonzero(way) <= way.size / 2)
    if way.all() or not way.any():
        return None
    data, stamp = frames.data[rows], frames.stamp[rows]
    beside = (way[1:] != way[:-1]) & (data[1:] == data[:-1]).all(axis=1) & (np.abs(np.diff(stamp)) <= WINDOW)
    twin = np.append(beside, False) | np.append(False, beside)
    return fewer if np.mean(twin[way == fewer]) >= _TWINS else None
