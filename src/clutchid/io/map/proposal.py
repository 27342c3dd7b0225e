"""Propose a channel map from the names, units and ranges of the channels in a file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchid.errors import DataError
from clutchid.io.columns import QUANTITIES, REQUIRED, Heading
from clutchid.io.map.channel_map import Channel, ChannelMap
from clutchid.io.map.channel_words import name_score, unit_in_name
from clutchid.io.source import Raster, Source
from clutchid.log import FloatArray
from clutchid.units import UNITS

#: Number of samples that determine the range of a channel.
_SAMPLED = 1 << 16


@dataclass(frozen=True, slots=True)
class Proposal:
    """A proposed channel map; `open` lists what the user has to decide.

    A quantity is `certain` if its unit is known and no other channel matches as well.
    """

    channels: ChannelMap
    certain: tuple[str, ...]
    open: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether nothing has to be decided, so that the file can be read with this map."""
        return not self.open and all(name in self.certain for name in self.channels.channels)


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A channel that may be a quantity, its score, and its unit, which may be `guessed` from the range."""

    raster: Raster
    heading: Heading
    score: float
    unit: str | None
    guessed: bool


def propose(source: Source, required: Sequence[str] = REQUIRED) -> Proposal:
    """Assign the channels of a file to quantities by names, units and ranges.

    Raises
    ------
    DataError
        If samples cannot be read.
    """
    ranges = _Ranges(source)
    channels: dict[str, Channel] = {}
    certain: list[str] = []
    remarks: list[str] = []
    comments: dict[str, str] = {}
    for name in QUANTITIES:
        found = sorted(_candidates(source, name, ranges), key=lambda candidate: -candidate.score)
        found = [candidate for candidate in found if not _taken(candidate, channels)]
        if not found or (name == "time" and not source.tabular and _timed(source)):
            continue
        best, equal = found[0], [candidate for candidate in found[1:] if candidate.score == found[0].score]
        channels[name] = _entry(source, best)
        comments[name] = _comment(best, ranges)
        if equal:
            others = ", ".join(f"'{candidate.heading.text}'" for candidate in equal[:5])
            remarks.append(f"{name}: '{best.heading.text}' is proposed, but {others} would match as well.")
        elif best.guessed:
            remarks.append(f"{name}: '{best.heading.text}' has no unit; [{best.unit}] is guessed from its range.")
        elif best.unit is None:
            remarks.append(f"{name}: '{best.heading.text}' has no known unit; add it to the map.")
        else:
            certain.append(name)
    missing = [name for name in required if name not in channels and not (name == "time" and _timed(source))]
    remarks += [f"{name}: no channel name matches; add it to the map." for name in missing]
    return Proposal(ChannelMap(channels, comments=comments), tuple(certain), tuple(remarks))


def map_for(source: Source, given: ChannelMap | None, required: Sequence[str]) -> ChannelMap | None:
    """Channel map for a file: the `given` one, else the proposed one if it is complete.

    None for a table whose columns the user can rename.

    Raises
    ------
    DataError
        If there is none; the text lists what is open.
    """
    if given is not None:
        return given
    proposal = propose(source, required)
    if proposal.complete:
        assigned = ", ".join(f"{name} = '{entry.channel}'" for name, entry in proposal.channels.channels.items())
        note = f"the channels were identified by their names: {assigned}; give a channel map (--map) to be certain."
        return replace(proposal.channels, comments={"": note})
    if source.tabular or not source.rasters:
        return None
    save = "`clutchid look FILE --save MAP.toml` writes a proposed channel map; correct it and give it with --map."
    raise DataError.of(str(source.path), [*source.problems, *proposal.open, save])


def _timed(source: Source) -> bool:
    return bool(source.rasters) and all(raster.clock is not None for raster in source.rasters)


def _taken(candidate: _Candidate, channels: Mapping[str, Channel]) -> bool:
    return any(
        entry.channel == candidate.heading.text and entry.group in (None, candidate.raster.name)
        for entry in channels.values()
    )


def _candidates(source: Source, name: str, ranges: _Ranges) -> Iterable[_Candidate]:
    for index, raster in enumerate(source.rasters):
        for heading in raster.headings:
            if heading.index == raster.clock and name != "time":
                continue
            score = name_score(name, heading.text)
            if score <= 0.0 or not (heading.unit is None or _fits(name, heading.unit)):
                continue
            unit = heading.unit or unit_in_name(name, heading.text)
            guessed = unit or _guess(name, *ranges(index, heading))
            yield _Candidate(raster, heading, score + (0.5 if unit else 0.0), guessed, guessed is not None and not unit)


def _fits(name: str, unit: str | None) -> bool:
    return unit in UNITS and UNITS[unit].si == QUANTITIES[name]


def _guess(name: str, low: float, high: float) -> str | None:
    """Unit that matches the range of a channel; None if unclear."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    size = max(abs(low), abs(high))
    guess: dict[str, Callable[[], str | None]] = {
        "time": lambda: "s",
        "m": lambda: "m" if size < 0.3 else "mm" if 1.0 < size < 500.0 else None,
        "1": lambda: "1" if low >= 0.0 and high <= 1.0 else "%" if low >= 0.0 and 1.0 < high <= 100.0 else None,
        "Pa": lambda: "Pa" if size > 5e4 else "kPa" if 50.0 < size < 2000.0 else "bar" if 0.5 < size < 20.0 else None,
    }
    chosen = guess.get("time" if name == "time" else QUANTITIES[name])
    return chosen() if chosen else None


def _entry(source: Source, best: _Candidate) -> Channel:
    same = sum(heading.text == best.heading.text for raster in source.rasters for heading in raster.headings)
    entry = Channel(best.heading.text, group=best.raster.name if same > 1 else None)
    return replace(entry, unit=best.unit) if best.heading.unit is None else entry


def _comment(best: _Candidate, ranges: _Ranges) -> str:
    index = next(i for i, raster in enumerate(ranges.source.rasters) if raster is best.raster)
    low, high = ranges(index, best.heading)
    unit = best.heading.unit
    shown_unit = " (no unit in the file)" if unit is None else "" if unit == "1" else f" {unit}"
    return f"{low:.6g} to {high:.6g}{shown_unit}" + (f"; {best.heading.comment}" if best.heading.comment else "")


class _Ranges:
    """Range of the first samples of a channel, read once per channel."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self._known: dict[tuple[int, int], tuple[float, float]] = {}

    def __call__(self, raster: int, heading: Heading) -> tuple[float, float]:
        key = (raster, heading.index)
        if key not in self._known:
            table = next(iter(self.source.tables(raster, [heading.index], _SAMPLED)), None)
            values = np.empty(0) if table is None else table.numbers.get(heading.index, np.empty(0))
            self._known[key] = _range(values)
        return self._known[key]


def _range(values: FloatArray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (math.nan, math.nan)
