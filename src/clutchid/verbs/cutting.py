"""`cut`: the strokes of a long recording that say most about the load."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from clutchid.arguments import checked
from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.verbs.reading import LogOrPath, Reading

if TYPE_CHECKING:
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.strokes import Section


@checked
def cut(
    recording: LogOrPath,
    *,
    seconds: float = 60.0,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> Log:
    """The strokes of a long recording with the most information about the load, as one recording with holes.

    Parameters
    ----------
    recording : Log or path
        Of any length; a file is read in pieces.
    seconds : s
        Greatest total length of the strokes.
    ambient : Pa, optional
        Ambient pressure for gauge units, by default 101,300 Pa.
    channels, dbc
        As in `clutchid.read`.

    Returns
    -------
    log : Log
        Strokes in order of time; where samples were left out, its time has a hole. Its warnings say where strokes were
        divided: at a long hold.

    Raises
    ------
    DataError
        If there is no usable stroke of at most that length.

    Examples
    --------
    The strokes of half a minute that say most about the load, in less than 8 s:

    >>> import clutchid
    >>> best = clutchid.cut(clutchid.bundled_recording(), seconds=8.0)
    >>> bool(len(best) <= 8000), f"{best['position'].max() * 1e3:.0f} mm"
    (True, '23 mm')
    """
    from clutchid.measurements import read_pieces
    from clutchid.measurements.checks import check_duties

    if isinstance(recording, Log):
        check_duties(recording)
        name, pieces = recording.name, iter([recording])
    else:
        name, pieces = str(recording), read_pieces(recording, ambient=ambient, channels=channels, dbc=dbc)
    best = _chosen(pieces, seconds, lambda _: None)
    if best.log is None:
        raise DataError(f"{name}: no usable stroke of at most {seconds:g} s was found.")
    return best.log


class CutRecording(NamedTuple):
    """Strokes and rests of a long recording.

    Attributes
    ----------
    log
        The chosen strokes as one recording; None where no stroke can be used.
    table
        The chosen strokes as text.
    counts
        Labels with the number of their strokes and rests, most frequent first.
    divisions
        Where strokes are divided, one sentence for holds and one for strokes that are too long.
    """

    log: Log | None
    table: str
    counts: Sequence[tuple[str, int]]
    divisions: tuple[str, ...]


def cut_file(
    reading: Reading,
    seconds: float,
    table: Path | None,
    warn: Callable[[Sequence[str]], None],
    show: Callable[[str, float], None],
) -> CutRecording:
    """`cut` of a file of any length, whose strokes and rests are also written as a `table` (CSV).

    Parameters
    ----------
    warn
        Takes the warnings of the recording as they come.
    show
        Takes words, and the share of the file that has been read.

    Raises
    ------
    DataError, ExportError
        If the recording cannot be read, or the table cannot be written.
    """
    from clutchid.files import atomic_write

    pieces = _pieces(reading, warn, show)
    if table is None:
        return _chosen(pieces, seconds, lambda _: None)
    with atomic_write(table) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        return _chosen(pieces, seconds, csv.writer(file).writerow)


def _chosen(pieces: Iterable[Log], seconds: float, write_row: Callable[[Iterable[object]], object]) -> CutRecording:
    """The strokes and rests of a recording in pieces, each written as a row."""
    from clutchid.strokes import choose, joined, sections_of, sections_table

    counts: Counter[str] = Counter()
    divisions: dict[bool, list[float]] = {}
    chosen = choose(_counted(sections_of(pieces), counts, divisions, write_row), seconds)
    said = tuple(_sentence(times, held=held) for held, times in divisions.items())
    log = replace(joined(chosen), warnings=said) if chosen else None
    return CutRecording(log, sections_table(chosen), counts.most_common(), said)


def _sentence(times: Sequence[float], *, held: bool) -> str:
    """Where strokes are divided: by holds, or because they are too long."""
    from clutchid.strokes.borders import LONGEST_HOLD, LONGEST_SECTION

    where = f"it is held for {LONGEST_HOLD:g} s or longer" if held else f"it has {LONGEST_SECTION:,} samples"
    count = "once" if len(times) == 1 else f"{len(times):,} times, the first"
    return f"a stroke ends where {where}, and what is left of it is one of its own: {count} at {times[0]:.3f} s."


def _pieces(
    reading: Reading, warn: Callable[[Sequence[str]], None], show: Callable[[str, float], None]
) -> Iterator[Log]:
    from clutchid.measurements import read_pieces

    def shown(count: int, size: int) -> None:
        show(f"{count:,} samples", count / max(size, 1))

    reported: set[str] = set()
    (file,) = reading.files
    ambient, channels, dbc = reading.ambient, reading.channels, reading.dbc
    for piece in read_pieces(file, ambient=ambient, channels=channels, dbc=dbc, progress=shown):
        warn([warning for warning in piece.warnings if warning not in reported])
        reported.update(piece.warnings)
        yield piece


def _counted(
    sections: Iterable[Section],
    counts: Counter[str],
    divisions: dict[bool, list[float]],
    write_row: Callable[[Iterable[object]], object],
) -> Iterator[Section]:
    """The sections, counted by label and written to the table one by one; times of `divisions`, at holds or not."""
    for number, section in enumerate(sections, 1):
        summary = asdict(section.summary)
        if number == 1:
            heads = [name + _UNITS.get(name, "") for name in summary]
            write_row(["number", "kind", "label", "first_sample", "start_s", "departure_s", "end_s", *heads])
        ends = (section.start, section.departure, section.end)
        write_row([number, section.kind, section.label, section.first, *ends, *summary.values()])
        counts[section.label] += 1
        if section.divided:
            divisions.setdefault(section.kind == "rest", []).append(section.start)
        yield section


_UNITS = {
    **dict.fromkeys(("lowest", "highest", "level", "reach"), "_m"),
    **dict.fromkeys(("opening_speed", "closing_speed"), "_m_s"),
    "vented_rest": "_s",
}
