"""`cut`: the strokes of a long recording that say most about the load."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from os import PathLike
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
    from clutchid.measurements import check_duties, read_pieces

    if isinstance(recording, Log):
        check_duties(recording)
        name, pieces = recording.name, iter([recording])
    else:
        name, pieces = str(recording), read_pieces(recording, ambient=ambient, channels=channels, dbc=dbc)
    best = _cut(pieces, seconds)
    if best.log is None:
        raise DataError(f"{name}: no usable stroke of at most {seconds:g} s was found.")
    return best.log


class CutRecording(NamedTuple):
    """Strokes of a long recording.

    Attributes
    ----------
    log
        The chosen strokes as one recording; None where no stroke can be used.
    chosen
        Their number, length and times, in a sentence.
    counts
        The number of strokes and of rests.
    divisions
        Where strokes are divided, one sentence for holds and one for strokes that are too long.
    """

    log: Log | None
    chosen: str
    counts: str
    divisions: tuple[str, ...]


def cut_file(
    reading: Reading,
    seconds: float,
    warn: Callable[[Sequence[str]], None],
    show: Callable[[str, float], None],
) -> CutRecording:
    """`cut` of a file of any length.

    Parameters
    ----------
    warn
        Takes the warnings of the recording as they come.
    show
        Takes words, and the share of the file that has been read.

    Raises
    ------
    DataError
        If the recording cannot be read.
    """
    return _cut(_pieces(reading, warn, show), seconds)


def _cut(pieces: Iterable[Log], seconds: float) -> CutRecording:
    """The strokes of a recording in pieces that say most about the load."""
    from clutchid.messages import listed
    from clutchid.strokes import choose, joined, sections_of

    counts: Counter[str] = Counter()
    divisions: dict[bool, list[float]] = {}
    chosen = choose(_counted(sections_of(pieces), counts, divisions), seconds)
    said = tuple(_sentence(times, held=held) for held, times in divisions.items())
    log = replace(joined(chosen), warnings=said) if chosen else None
    length = sum(section.end - section.start for section in chosen)
    begins = listed(f"{section.start:.2f} s" for section in chosen)
    sentence = f"chosen: {len(chosen):,} of them, {length:.2f} s, from {begins}"
    counted = f"{counts['stroke']:,} strokes, {counts['rest']:,} rests"
    return CutRecording(log, sentence, counted, said)


def _sentence(times: Sequence[float], *, held: bool) -> str:
    """Where strokes are divided: by holds, or because they are too long."""
    from clutchid.strokes.borders import LONGEST_HOLD, LONGEST_SECTION

    where = f"it is held for {LONGEST_HOLD:g} s or longer" if held else f"it has {LONGEST_SECTION:,} samples"
    count = "once" if len(times) == 1 else f"{len(times):,} times, the first"
    return f"a stroke ends where {where}, and the rest of it counts as another stroke: {count} at {times[0]:.3f} s."


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
) -> Iterator[Section]:
    """The sections, counted by kind; times of `divisions`, at holds or not."""
    for section in sections:
        counts[section.kind] += 1
        if section.divided:
            divisions.setdefault(section.kind == "rest", []).append(section.start)
        yield section
