"""A recording that arrives as text: CSV or JSON lines, to blocks in SI."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from clutchid.errors import DataError
from clutchid.recordings.live.arrival import LiveBlock, Piece, live_blocks
from clutchid.recordings.live.streams import arrived, indices, picked_streams
from clutchid.recordings.live.text import TextFeed, text_feed
from clutchid.recordings.map.channel_map import Pick

if TYPE_CHECKING:
    from clutchid.recordings.map.channel_map import ChannelMap


def text_blocks(
    pieces: Iterator[bytes], name: str, channels: ChannelMap | None, ambient: float, required: Sequence[str]
) -> Iterator[LiveBlock]:
    """Blocks of a recording from pieces of text of any length, see `clutchid.recordings.live.arrival.live_blocks`.

    Parameters
    ----------
    name
        Of the recording.
    channels
        The channel map; without it the columns must have standard names.
    ambient : Pa
        Absolute pressure that is added to gauge pressures.
    required
        Quantities that the recording must have.

    Raises
    ------
    DataError
        If it is no text, its columns do not fit, it has no sample, or its time goes back for good.
    """
    feed = text_feed(pieces, name)
    if channels is None and feed.unnamed:
        raise DataError(f"{name}: {feed.unnamed}")
    picks = picked_streams(name, [feed.raster], channels, required)
    metadata = {"source": name, "ambient_Pa": repr(float(ambient))}
    yield from live_blocks(_pieces(feed, picks, ambient), picks, name, metadata)


def _pieces(feed: TextFeed, picks: Sequence[Pick], ambient: float) -> Iterator[Piece]:
    """The picked channels of the rows, in SI."""
    done = 0
    chosen = sorted({index for each in picks for index in indices(each)})
    for rows in feed.rows(chosen):
        place, spoiled = np.arange(rows.table.size), rows.spoiled.copy()
        each = [arrived(i, one, rows.table, ambient, place, done) for i, one in enumerate(picks)]
        for one in each:
            spoiled |= ~np.isin(place, one.place)  # without a time
        yield Piece(each, rows.left_out + int(spoiled.sum()))
        done += rows.table.size
