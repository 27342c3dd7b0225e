"""Channels of a MATLAB file, each with its time: the time vector of its length in the nearest struct around it.

Where none stands there, a vector such as `pos_time` is the time of channels that have all other words of its name, and
the first column of a matrix that of the others. A vector in another struct is nobody's time.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.columns import Heading, channel, same_word
from clutchid.measurements.formats.mat.contents import ArrayChannel, BrokenMat, Contents, ItemPath
from clutchid.measurements.source import Raster
from clutchid.names import printable

#: Channels of a file up to which they are listed.
MOST_CHANNELS = 20_000

#: Samples from which on a column that grows is taken for time.
_FEWEST = 10

_UNITS = ("unit", "units", "einheit", "einheiten")
_LABELS = ("label", "name", "signalname")
_REMARKS = ("description", "comment", "blockname")
_VALUES = ("data", "values", "value", "val", "y", "x")
_TIME = re.compile(
    r"(t|time|zeit|tout|timestamps?|zeitstempel|messzeit|elapsed_?time)(_?[\[(]?(s|sec|sek|ms|us|ns)[\])]?)?"
)
_TIMES = frozenset(("time", "times", "zeit", "tout", "timestamp", "timestamps", "zeitstempel"))

#: The first samples of a signal, for a look at whether it may be time.
Peek: TypeAlias = Callable[[ArrayChannel], FloatArray]


def matlab_path(path: ItemPath) -> str:
    """A path as MATLAB writes it.

    Examples
    --------
    >>> matlab_path(("rec", "sig", "(2)", "y"))
    'rec.sig(2).y'
    """
    return re.sub(r"\.(?=[({]\d+[)}])", "", ".".join(path))


def is_time_name(name: str) -> bool:
    """Whether a name is one of those that time vectors have.

    Examples
    --------
    >>> [is_time_name(name) for name in ("t", "Zeit", "time_ms", "tout", "torque", "T_oil")]
    [True, True, True, True, False, False]
    """
    return _TIME.fullmatch(name.casefold()) is not None


def signals_of(whole: Contents, least: int) -> list[ArrayChannel]:
    """Every channel with at least `least` samples, in the order of the file; other arrays are left out.

    Raises
    ------
    BrokenMat
        If there are too many.
    """
    vectors = Counter(a.path[:-1] for a in whole.arrays if a.size > 1 and not is_time_name(a.path[-1]))
    texts = {(*path[:-i], *map(str.casefold, path[-i:])): text for i in (2, 1) for path, text in whole.texts.items()}
    signals: list[ArrayChannel] = []
    for array in whole.arrays:
        if what := _no_channel(array, least):
            whole.left[what].append(array.path)
            continue
        only = vectors[array.path[:-1]] == 1 and not is_time_name(array.path[-1])
        signal = _described(array, texts, only=only)
        signals += [replace(signal, column=i) for i in range(min(array.sides) if array.mark else 1)]
        if len(signals) > MOST_CHANNELS:
            raise BrokenMat(f"has more than {MOST_CHANNELS:,} channels; save those that are needed.")
    return signals


def _no_channel(array: ArrayChannel, least: int) -> str:
    """Kind of an array that holds no channel, in the plural; empty of any other."""
    if array.size < least:
        return "single numbers"
    return "arrays of three or more dimensions" if len(array.sides) > 2 else ""


def _described(array: ArrayChannel, texts: Mapping[ItemPath, str], *, only: bool) -> ArrayChannel:
    """An array with the texts about it; those of the struct are about the `only` vector in it besides the time."""
    home, name = array.path[:-1], array.path[-1]

    def text(*tails: ItemPath) -> str:
        return next((texts[home + tail] for tail in tails if texts.get(home + tail)), "")

    own, info = name.casefold(), "datainfo" if only else "timeinfo"
    units: list[ItemPath] = [(word, own) for word in _UNITS]
    units += [tail for word in _UNITS for tail in ((f"{own}_{word}",), (info, word))]
    units += [(word,) for word in _UNITS if only]
    label = text(*((word,) for word in _LABELS)) if only else ""
    remark = text(*((word,) for word in _REMARKS)) if only else ""
    around, serves = _without_index(home), None
    if not array.mark and is_time_name(name):
        serves = home
    elif not array.mark and name.casefold() in _VALUES and around:
        # dSPACE: X(1) is the time of Y(1), Y(2), ...
        serves = around[:-1] if is_time_name(around[-1]) or is_time_name(label) or around[-1] == "X" else None
    item = around != home or around[-1:] == ("signals",)
    return replace(
        array,
        unit=array.unit or text(*units) or None,
        label=matlab_path((*around[:-1], label)) if label and item else "",
        comment="; ".join(filter(None, (remark, "" if item else label))),
        serves=serves,
    )


def _without_index(path: ItemPath) -> ItemPath:
    """The path of the array or cell that an element stands in."""
    return _without_index(path[:-1]) if path and re.fullmatch(r"[({]\d+[)}]", path[-1]) else path


def rasters_of(signals: Sequence[ArrayChannel], peek: Peek) -> list[tuple[Raster, list[ArrayChannel]]]:
    """The signals on their time grids; those without a time share one of their length, where a map can name it."""
    times: dict[tuple[ItemPath, int], ArrayChannel] = {}
    for signal in sorted(signals, key=lambda signal: len(signal.path)):
        if signal.serves is not None and (signal.serves, signal.size) not in times and _runs_on(peek(signal)):
            times[signal.serves, signal.size] = signal
    timed: dict[ArrayChannel, list[ArrayChannel]] = defaultdict(list)
    untimed: dict[int, list[ArrayChannel]] = defaultdict(list)
    first = None
    for signal in signals:
        time = _time_around(signal, times)
        if signal.column == 0:
            first = _first_column(signal, peek) if signal.mark and time is None else None
            if signal.mark and time is not None and np.array_equal(peek(signal), peek(time)):
                continue  # the time again, as Simulink writes it beside `tout`
        owner = first or time
        (timed[owner] if owner else untimed[signal.size]).append(first if first and signal.column == 0 else signal)
    for time in [time for time, group in timed.items() if group == [time]]:
        untimed[time.size] += timed.pop(time)
    for size, group in list(untimed.items()):
        if by_words := _by_words(group, peek):
            timed |= by_words
            del untimed[size]
    names = Counter(_called(signal) for signal in signals)
    grids = [*timed.items(), *((None, group) for group in untimed.values())]
    return [(_raster(group, names, time), group) for time, group in grids]


def _raster(group: Sequence[ArrayChannel], names: Counter[str], time: ArrayChannel | None) -> Raster:
    """A time grid, called by the struct that its time serves; a channel is called by its label if no other is."""
    clock = None if time is None else group.index(time)
    homes = {_without_index(signal.path)[:-1] for signal in group}
    if time is not None:
        homes = {time.path[:-1] if time.serves is None else time.serves}
    headings = tuple(_heading(i, signal, by_label=names[_called(signal)] == 1) for i, signal in enumerate(group))
    return Raster(headings, group[0].size, printable(matlab_path(homes.pop())) if len(homes) == 1 else "", clock)


def _time_around(signal: ArrayChannel, times: Mapping[tuple[ItemPath, int], ArrayChannel]) -> ArrayChannel | None:
    """The time of the length of a signal in the nearest struct around it."""
    homes = (signal.path[:depth] for depth in range(len(signal.path) - 1, -1, -1))
    return next((times[home, signal.size] for home in homes if (home, signal.size) in times), None)


def _first_column(signal: ArrayChannel, peek: Peek) -> ArrayChannel | None:
    """The first column of a matrix where it may be the time of the others: surely, if the next does not increase."""
    if not _increases(peek(signal)):
        return None
    return signal if _increases(peek(replace(signal, column=1))) else replace(signal, serves=signal.path)


def _by_words(group: Sequence[ArrayChannel], peek: Peek) -> dict[ArrayChannel, list[ArrayChannel]]:
    """The signals of each time such as `pos_time` or `DGM1_timestamps`; empty where one has none, or several unlike."""
    words = {signal: _words(".".join(signal.path)) for signal in group}
    owners = {
        time: named - _TIMES
        for time in group
        if not time.mark and len(named := _words(time.path[-1])) > len(named - _TIMES) > 0 and _increases(peek(time))
    }
    owned: dict[ArrayChannel, list[ArrayChannel]] = defaultdict(list)
    for signal in group:
        ranks = {
            time: (len(time.path), len(own))
            for time, own in owners.items()
            if signal.path[: len(time.path) - 1] == time.path[:-1]
            and all(any(same_word(word, other) for other in words[signal]) for word in own)
        }
        nearest = [time for time, rank in ranks.items() if rank == max(ranks.values())]
        if not nearest or any(not np.array_equal(peek(time), peek(nearest[0])) for time in nearest[1:]):
            return {}
        owned[nearest[0]].append(signal)
    return owned


def _words(name: str) -> frozenset[str]:
    """Words of a name in small letters; asammdf calls the time of its group `DG1` by `DGM1`.

    >>> sorted(_words("DGM1_timestamps") | _words("ClutchPos"))
    ['clutch', 'dg1', 'pos', 'timestamps']
    """
    words = re.findall(r"[^\W_]+?(?=[A-Z][a-z])|[^\W_]+", name)
    return frozenset(re.sub(r"^dgm(?=\d)", "dg", word.casefold()) for word in words)


def _runs_on(values: FloatArray) -> bool:
    """Whether the first samples may be stamps: they grow, but for some repeated stamps and resets of the clock."""
    steps = np.diff(values[np.isfinite(values)])
    grow, fall = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
    return values.size < 2 or bool(grow * 100 >= max(steps.size, 1) and fall * 10 <= grow)


def _increases(values: FloatArray) -> bool:
    return values.size >= _FEWEST and bool(np.all(np.diff(values) > 0))


def _called(signal: ArrayChannel) -> str:
    return (signal.label or matlab_path(signal.path)) + signal.mark


def _heading(index: int, signal: ArrayChannel, *, by_label: bool) -> Heading:
    path = matlab_path(signal.path) + signal.mark
    text = _called(signal) if by_label else path
    comment = "; ".join(filter(None, (path if text != path else signal.label, signal.comment)))
    heading = channel(index, printable(text), signal.unit and printable(signal.unit), printable(comment))
    return replace(heading, name="time") if signal.mark and signal.serves is not None else heading
