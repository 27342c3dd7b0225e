"""Rasters of a MATLAB file: vectors of one length under the nearest time vector, with their units.

A struct without a time vector hands its channels up to the struct that it stands in, so that the time of a recording
serves the structs inside it, as in Simulink's structure with time, but no other ones.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from clutchid.log import FloatArray
from clutchid.measurements.columns import channel
from clutchid.measurements.formats.mat.loaded import (
    BrokenMat,
    CharArray,
    NoChannel,
    Node,
    NodeArray,
    NumberArray,
    Struct,
)
from clutchid.measurements.source import Raster
from clutchid.names import printable

_UNITS = ("unit", "units", "einheit", "einheiten")
_LABELS = ("label", "name", "signalname")
_REMARKS = ("description", "comment", "blockname")
_INFOS = ("datainfo", "timeinfo")
_TIME = re.compile(
    r"(t|time|zeit|tout|timestamps?|zeitstempel|messzeit|elapsed_?time)(_?[\[(]?(s|sec|sek|ms|us|ns)[\])]?)?"
)


@dataclass(frozen=True, slots=True)
class StructTexts:
    """Texts of a struct: units by field, and label and comment of its `only` channel besides the time.

    `used` are the fields that hold them.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    only: str = ""
    label: str = ""
    comment: str = ""
    used: frozenset[str] = frozenset()


def is_time_name(name: str) -> bool:
    """Whether a name is one of those that time vectors have.

    Examples
    --------
    >>> [is_time_name(name) for name in ("t", "Zeit", "time_ms", "tout", "torque", "T_oil")]
    [True, True, True, True, False, False]
    """
    return _TIME.fullmatch(name.casefold()) is not None


def struct_texts(fields: Mapping[str, Node]) -> StructTexts:
    """Units, label and comment in the texts of a struct.

    Examples
    --------
    >>> texts = struct_texts({"values": NumberArray((900, 1)), "label": CharArray("stroke"), "unit": CharArray("mm")})
    >>> texts.only, texts.label, texts.units
    ('values', 'stroke', {'values': 'mm'})
    """
    vectors = [name for name, node in fields.items() if isinstance(node, NumberArray) and node.size > 1]
    clocks, others = [n for n in vectors if is_time_name(n)], [n for n in vectors if not is_time_name(n)]
    only = others[0] if len(others) == 1 else ""
    texts = {name: node.text.strip() for name, node in fields.items() if isinstance(node, CharArray)}
    units, used = _units(fields, texts, only, clocks)
    label = _first(texts, _LABELS) if only else ""
    remark = _first(texts, _REMARKS) if only else ""
    used |= {name for name in texts if name.casefold() in (*_LABELS, *_REMARKS)}
    return StructTexts(units, only, label, remark, frozenset(used))


def _first(texts: Mapping[str, str], names: tuple[str, ...]) -> str:
    """The first of these texts that says something."""
    return next((text for key in names for name, text in texts.items() if name.casefold() == key and text), "")


def _units(
    fields: Mapping[str, Node], texts: Mapping[str, str], only: str, clocks: list[str]
) -> tuple[dict[str, str], set[str]]:
    """Units by field, and the fields that they were found in."""
    units: dict[str, str] = {}
    used: set[str] = set()
    for name, node in fields.items():
        key = name.casefold()
        if isinstance(node, Struct) and key in (*_UNITS, *_INFOS):
            units_by_field = {field: child.text for field, child in node.fields.items() if isinstance(child, CharArray)}
            if key in _INFOS:
                ends = clocks if key == "timeinfo" else [only]
                units_by_field = dict.fromkeys(ends, _first(units_by_field, _UNITS))
            elif len(units_by_field) < len(node.fields):
                continue
            units.update(units_by_field)
            used.add(name)
        elif name in texts and key in _UNITS:
            units.setdefault(only, texts[name])
            used.add(name)
        elif name in texts and (match := re.fullmatch(r"(.+)_(unit|units|einheit)", key)):
            of = next((other for other in fields if other.casefold() == match[1]), "")
            units.setdefault(of, texts[name])
            used.add(name)
    return {name: unit for name, unit in units.items() if name and unit}, used


#: Channels of a matrix, and of a file, up to which they are listed.
_MOST_COLUMNS = 256
MOST_CHANNELS = 20_000

#: Samples from which on a first column that grows is taken for time.
_FEWEST = 10

_VALUES = ("data", "values", "value", "val", "y", "x")


@dataclass(frozen=True, slots=True)
class ArrayChannel:
    """A channel of the file: the array and the column (or row) of it, its path and how a label calls it instead.

    `time_like` says whether a name of it means time, `home` the struct that it stands in.
    """

    numbers: NumberArray
    column: int
    path: str
    home: str
    label: str = ""
    unit: str | None = None
    comment: str = ""
    time_like: bool = False


@dataclass(slots=True)
class ScannedChannels:
    """Channels of a file: groups of them with the index of their clock, and items that are no channels."""

    groups: list[tuple[str, tuple[ArrayChannel, ...], int | None]] = field(default_factory=list)
    left: dict[NoChannel, list[str]] = field(default_factory=lambda: defaultdict(list))
    channels: int = 0

    def leave(self, what: str, path: str) -> None:
        """Count an item that is no channel."""
        self.left[NoChannel(what)].append(path)


#: The first samples of a signal, for a look at whether it may be time.
Peek = Callable[[ArrayChannel], FloatArray]


def signals_of(root: Struct, peek: Peek, *, least: int = 2) -> ScannedChannels:
    """Every channel of the file, in groups that share their stamps.

    Parameters
    ----------
    root
        The variables of the file.
    peek
        Reads the first samples of a signal.
    least
        Samples without which a vector is no channel.

    Raises
    ------
    BrokenMat
        If the file has too many channels, or samples cannot be read.
    """
    scan = _ChannelScan(ScannedChannels(), peek, least)
    for group in _by_size(scan.struct(root, "", None)):
        scan.without_time(group)
    return scan.scanned


def rasters_of(scanned: ScannedChannels) -> tuple[Raster, ...]:
    """The groups as rasters; a channel is called by its label where no other channel is."""
    every = [signal for _, signals, _ in scanned.groups for signal in signals]
    used = Counter(signal.label or signal.path for signal in every)
    rasters = []
    for name, signals, clock in scanned.groups:
        headings = []
        for index, signal in enumerate(signals):
            by_label = bool(signal.label) and used[signal.label] == 1
            also = (signal.path if by_label else signal.label, signal.comment)
            text = printable(signal.label if by_label else signal.path)
            comment = printable("; ".join(part for part in also if part))
            headings.append(channel(index, text, signal.unit and printable(signal.unit), comment))
        rasters.append(Raster(tuple(headings), signals[0].numbers.samples, printable(name), clock))
    return tuple(rasters)


@dataclass(frozen=True, slots=True)
class _ChannelScan:
    scanned: ScannedChannels
    peek: Peek
    least: int

    def struct(self, node: Struct, path: str, above: str | None) -> list[ArrayChannel]:
        """The signals of a struct, and of all in it, that have no clock yet; labels are names in `above`."""
        names = struct_texts(node.fields)
        loose = [
            signal
            for name, child in node.fields.items()
            if isinstance(child, NumberArray)
            for signal in self.vectors(child, name, path, names, above)
        ]
        for name, child in node.fields.items():
            if not isinstance(child, NumberArray) and name not in names.used:
                loose += self.other(child, _joined(path, name), path)
        untimed = []
        for group in _by_size(loose):
            clock = self.clock(group)
            if clock is None or len(group) == 1:
                untimed += group
            else:
                self.scanned.groups.append((path, tuple(group), clock))
        return untimed

    def other(self, node: Node, path: str, above: str) -> list[ArrayChannel]:
        """The signals of anything but an array, that have no clock yet; `above` is the struct that it stands in."""
        match node:
            case Struct():
                as_item = path.endswith((")", "}")) or path.rpartition(".")[2] == "signals"
                return self.struct(node, path, above if as_item else None)
            case NodeArray(items, cell):
                if cell and items and all(isinstance(item, CharArray) for item in items):
                    self.scanned.leave("cells of text", path)
                    return []
                marks = "{}" if cell else "()"
                paths = [f"{path}{marks[0]}{i + 1}{marks[1]}" for i in range(len(items))]
                return [s for item, p in zip(items, paths, strict=True) for s in self.item(item, p, above)]
            case CharArray():
                self.scanned.leave("texts", path)
            case NoChannel():
                self.scanned.left[node].append(path)
        return []

    def item(self, node: Node, path: str, above: str) -> list[ArrayChannel]:
        """The signals of an element of a struct array or of a cell."""
        if isinstance(node, NumberArray):
            return self.vectors(node, path.removeprefix(f"{above}."), above, StructTexts())
        return self.other(node, path, above)

    def vectors(
        self, numbers: NumberArray, name: str, home: str, names: StructTexts, above: str | None = None
    ) -> list[ArrayChannel]:
        """The channels that an array is; a label is another name of it in the struct `above`."""
        path = _joined(home, name)
        if numbers.samples < self.least:
            self.scanned.leave("single numbers" if numbers.size else "empty arrays", path)
            return []
        if len(numbers.sides) > 2 and not numbers.is_vector:
            self.scanned.leave("arrays of three or more dimensions", path)
            return []
        if numbers.channels > _MOST_COLUMNS:
            self.scanned.leave(f"matrices of more than {_MOST_COLUMNS} columns", path)
            return []
        self.scanned.channels += numbers.channels
        if self.scanned.channels > MOST_CHANNELS:
            raise BrokenMat(f"has more than {MOST_CHANNELS:,} channels; save those that are needed.")
        plain = _signal(numbers, name, home, names, above)
        if numbers.is_vector:
            return [plain]
        form = "({},:)" if numbers.is_wide else "(:,{})"
        return [_column(plain, i, form.format(i + 1)) for i in range(numbers.channels)]

    def clock(self, group: Sequence[ArrayChannel]) -> int | None:
        """The signal whose name means time, if its samples run on."""
        for index, signal in enumerate(group):
            if signal.time_like and self.runs_on(signal):
                return index
        return None

    def runs_on(self, signal: ArrayChannel) -> bool:
        """Whether the first samples may be stamps: they grow, but for some repeated stamps and resets of the clock."""
        values = self.peek(signal)
        steps = np.diff(values[np.isfinite(values)])
        grow, fall = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
        return values.size < 2 or bool(grow * 100 >= max(steps.size, 1) and fall * 10 <= grow)

    def without_time(self, group: Sequence[ArrayChannel]) -> None:
        """Signals for which no struct has a time: a matrix may have it in its first column, [t, x1, x2]."""
        matrices: dict[NumberArray, list[ArrayChannel]] = defaultdict(list)
        rest: list[ArrayChannel] = []
        for signal in group:
            (rest if signal.numbers.is_vector else matrices[signal.numbers]).append(signal)
        for columns in matrices.values():
            values = self.peek(columns[0])
            if values.size >= _FEWEST and np.all(np.isfinite(values)) and np.all(values[1:] > values[:-1]):
                self.scanned.groups.append((columns[0].path.rpartition("(")[0], tuple(columns), 0))
            else:
                rest += columns
        if rest:  # one raster, so that a map can name the time of all of them
            homes = {signal.home for signal in rest}
            self.scanned.groups.append((homes.pop() if len(homes) == 1 else "", tuple(rest), self.clock(rest)))


def _signal(numbers: NumberArray, name: str, home: str, names: StructTexts, above: str | None) -> ArrayChannel:
    text, remark = (names.label, names.comment) if name == names.only else ("", "")
    label = _joined(above, text) if text and above is not None else ""
    remarks = (remark, "" if label else text)
    return ArrayChannel(
        numbers,
        0,
        _joined(home, name),
        home,
        label,
        names.units.get(name) or numbers.unit,
        "; ".join(filter(None, remarks)),
        _is_time(name, home, text),
    )


def _column(plain: ArrayChannel, column: int, mark: str) -> ArrayChannel:
    label = plain.label and plain.label + mark
    return replace(plain, column=column, path=plain.path + mark, label=label, time_like=False)


def _by_size(signals: Iterable[ArrayChannel]) -> list[list[ArrayChannel]]:
    groups: dict[int, list[ArrayChannel]] = defaultdict(list)
    for signal in signals:
        groups[signal.numbers.samples].append(signal)
    return list(groups.values())


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _is_time(name: str, home: str, label: str) -> bool:
    """Whether the name, or of a field such as `data` the label or the struct around it, means time."""
    if is_time_name(name):
        return True
    if name.casefold() not in _VALUES:
        return False
    around = re.sub(r"[({]\d+[)}]$", "", home.rpartition(".")[2])
    return is_time_name(around) or is_time_name(label) or around == "X"  # dSPACE: X(1) is the time of Y(1), Y(2), ...
