"""Frames of several groups put together as one log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.recordings.formats.can.frames import Frames


def merged(parts: Sequence[Iterator[Frames]]) -> Iterator[Frames]:
    """Frames of several groups as one log, by their stamps; the order within a group never changes.

    A stamp that is below one before it in its group keeps its place: it is for the checks to find.

    Raises
    ------
    Whatever `parts` raise, after the frames before it were given.
    """
    if len(parts) == 1:
        yield from parts[0]
        return
    waiting: list[Frames | None] = [None] * len(parts)
    latest = [-np.inf] * len(parts)
    failure: DataError | None = None
    open_parts = set(range(len(parts)))
    while True:
        for i in sorted(open_parts):
            if waiting[i] is None:
                try:
                    waiting[i] = next(parts[i])
                except StopIteration:
                    open_parts.discard(i)
                except DataError as error:
                    failure = failure or error
                    open_parts.discard(i)
        present = [(i, block) for i, block in enumerate(waiting) if block is not None]
        if not present:
            break
        keys = {i: np.fmax.accumulate(np.fmax(block.stamp, latest[i])) for i, block in present}
        limit = min((keys[i][-1] for i, _ in present if i in open_parts), default=np.inf)
        taken = []
        for i, block in present:
            count = int(np.searchsorted(keys[i], limit, side="right"))
            taken.append((keys[i][:count], block.take(np.arange(count))))
            latest[i] = keys[i][count - 1] if count else latest[i]
            waiting[i] = block.take(np.arange(count, len(block))) if count < len(block) else None
        yield together(taken)
    if failure is not None:
        raise failure


def together(parts: Sequence[tuple[NDArray[np.float64], Frames]]) -> Frames:
    """Blocks of frames as one, in the order of their keys, which never fall within a block."""
    order = np.argsort(np.concatenate([key for key, _ in parts]), kind="stable")
    width = max(frames.data.shape[1] for _, frames in parts)
    data = [np.pad(frames.data, ((0, 0), (0, width - frames.data.shape[1]))) for _, frames in parts]
    blocks = [frames for _, frames in parts]
    return Frames(
        np.concatenate([frames.stamp for frames in blocks]),
        np.concatenate([frames.bus for frames in blocks]),
        np.concatenate([frames.identifier for frames in blocks]),
        np.concatenate([frames.extended for frames in blocks]),
        np.concatenate([frames.length for frames in blocks]),
        np.concatenate(data),
    ).take(order)
