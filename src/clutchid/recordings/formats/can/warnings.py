"""What is said of a CAN log: names of its messages, what was left out, and why nothing can be decoded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from clutchid.recordings.columns import shortened
from clutchid.recordings.formats.can.dbc import Message
from clutchid.recordings.formats.can.j1939 import EVERYBODY
from clutchid.recordings.formats.can.scan import Seen
from clutchid.recordings.formats.can.streams import Stream, parts_of
from clutchid.recordings.table import SHOWN, and_more

_LONGEST_NAME = 100


def problem(seen: Seen, dbc: Sequence[Path]) -> str:
    """Why a log cannot be decoded, in one sentence; empty where it can."""
    if seen.frames == 0:
        return (
            f"{seen.trouble}; copy it again." if seen.trouble else "holds no data frames of a CAN bus; record it again."
        )
    if seen.sizes:
        return ""
    frames = f"{seen.frames:,}"
    if not dbc:
        return f"holds raw frames ({frames}) of {_identifiers(seen)}; give the DBC with --dbc FILE."
    names = ", ".join(Path(file).name for file in dbc)
    pieces = f", and {seen.pieces:,} are pieces of longer messages, which are not put together" if seen.pieces else ""
    common = f" (the commonest: {_commonest(seen.unknown)}{pieces})" if seen.unknown else ""
    return f"none of its {frames} frames{common} holds a signal of {names}; give the DBC of this bus with --dbc FILE."


def warnings(seen: Seen, streams: Sequence[Stream]) -> tuple[str, ...]:
    """What was left out of a log, one sentence each."""
    found = [f"{seen.trouble}; the {seen.frames:,} frames before it are used."] if seen.trouble else []
    found += [f"{_counted(count, what)} left out." for what, count in seen.left_out.items() if count]
    if seen.pieces:
        found.append(
            f"{_counted(seen.pieces, 'frame')} left out: pieces of longer messages (J1939 transport protocol, "
            "NMEA 2000 fast packets)."
        )
    if seen.unknown:
        found.append(
            f"{_counted(sum(seen.unknown.values()), 'frame')} left out, of {_identifiers(seen)} that no DBC knows; "
            f"the commonest: {_commonest(seen.unknown)}."
        )
    short = [f"{count:,} of {name}" for name, count in seen.short.items() if count]
    if short:
        shown = and_more(short[:SHOWN], len(short) - len(short[:SHOWN]))
        found.append(f"some frames are shorter than the DBC says ({shown}): the signals that they lack are missing.")
    return (*found, *_undecodable({stream.message for stream in streams}))


def names(streams: Sequence[Stream]) -> list[str]:
    """What the rasters are called: the message, and what tells it from others of its name."""
    same: dict[str, list[Stream]] = {}
    for stream in streams:
        same.setdefault(stream.message.name, []).append(stream)
    return [_name(stream, same[stream.message.name]) for stream in streams]


def _name(stream: Stream, same: Sequence[Stream]) -> str:
    differ = {
        f"0x{stream.message.identifier:X}": len({other.message for other in same}) > 1,
        f"CAN{stream.bus}": len({other.bus for other in same}) > 1,
        f"from 0x{stream.sender:02X}": len({other.sender for other in same}) > 1,
        f"to 0x{stream.receiver:02X}": len({other.receiver for other in same}) > 1 and stream.receiver != EVERYBODY,
        stream.page.name: bool(stream.page.selectors),
    }
    marks = ", ".join(mark for mark, needed in differ.items() if needed)
    return shortened(f"{stream.message.name} ({marks})" if marks else stream.message.name, _LONGEST_NAME)


def _undecodable(messages: set[Message]) -> list[str]:
    lacking = sorted(f"{name} of {message.name}" for message in messages for name in message.undecodable)
    if not lacking:
        return []
    shown = and_more(lacking[:SHOWN], len(lacking) - len(lacking[:SHOWN]))
    return [f"what is no number of at most 64 bits is left out: {shown}."]


def _counted(count: int, what: str) -> str:
    head, _, tail = what.partition(" without ")
    plural = f"{head}s without {tail}" if tail else f"{what}s"
    return f"1 {what} is" if count == 1 else f"{count:,} {plural} are"


def _identifiers(seen: Seen) -> str:
    count = len({parts_of(key)[:2] for key in seen.unknown})
    return f"{count:,} identifier" + ("" if count == 1 else "s")


def _commonest(unknown: Mapping[int, int]) -> str:
    """The commonest identifiers with their counts, over all buses."""
    counts: Counter[tuple[int, bool]] = Counter()
    for key, count in unknown.items():
        counts[parts_of(key)[:2]] += count
    shown = [f"0x{i:08X}" if extended else f"0x{i:03X}" for (i, extended), _ in counts.most_common(SHOWN)]
    numbers = [count for _, count in counts.most_common(SHOWN)]
    each = [f"{text} ({count:,})" for text, count in zip(shown, numbers, strict=True)]
    return and_more(each, len(counts) - len(each))
