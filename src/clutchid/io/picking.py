"""A channel map laid on a file: which column of which raster is what, with every misfit told at once."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from clutchid.io.channel_map import Channel, ChannelMap
from clutchid.io.columns import QUANTITIES, Heading, unit_spelled
from clutchid.io.source import Raster, Source
from clutchid.units import UNITS, known_units

_SHOWN = 8


@dataclass(frozen=True, slots=True)
class Pick:
    """Channels of one raster that share their stamps: columns by quantity, `time` among them, and what becomes of them.

    `delay` in s is what all of them are behind their stamps.
    """

    raster: int
    columns: Mapping[str, tuple[Heading, Channel]]
    delay: float = 0.0


def pick(source: Source, channels: ChannelMap) -> tuple[tuple[Pick, ...], tuple[str, ...]]:
    """What the map picks from the file, and every problem with it."""
    problems: list[str] = []
    found: dict[tuple[int, float], dict[str, tuple[Heading, Channel]]] = {}
    clocks: dict[int, tuple[Heading, Channel]] = {}
    for name, entry in channels.channels.items():
        places = list(_named(source, entry))
        if len(places) != 1:
            problems.append(_misfit(source, name, entry, places))
            continue
        raster, heading = places[0]
        unit = unit_spelled(entry.unit) or heading.unit
        problems += _unit_problem(name, heading, unit)
        chosen = (Heading(heading.index, heading.text, name, unit, heading.comment), entry)
        if name == "time":
            clocks[raster] = chosen
        else:
            found.setdefault((raster, entry.delay), {})[name] = chosen
    picks = []
    for (raster, delay), columns in found.items():
        clock = clocks.get(raster) or _own_clock(source.rasters[raster])
        if clock is None:
            problems.append(_no_clock(columns))
        else:
            picks.append(Pick(raster, {"time": clock, **columns}, delay))
    return tuple(picks), tuple(problems)


def _named(source: Source, entry: Channel) -> Iterator[tuple[int, Heading]]:
    """Where a channel of that name stands, exactly written; else without regard to case."""
    for same in (str, str.casefold):
        places = [
            (index, heading)
            for index, raster in enumerate(source.rasters)
            if entry.group is None or raster.name == entry.group
            for heading in raster.headings
            if same(heading.text) == same(entry.channel) or same(_bare(heading.text)) == same(entry.channel)
        ]
        if places:
            yield from places
            return


def _bare(text: str) -> str:
    """A heading without its unit in brackets."""
    return text.partition("[")[0].strip()


def _misfit(source: Source, name: str, entry: Channel, places: list[tuple[int, Heading]]) -> str:
    """Why an entry of the map picks no channel, or more than one."""
    if places:
        groups = [source.rasters[raster].name for raster, _ in places]
        shown = ", ".join(f"'{group}'" for group in groups[:_SHOWN])
        return f"{name}: {len(places)} channels are called '{entry.channel}'; name the group, one of {shown}."
    every = [heading.text for raster in source.rasters for heading in raster.headings]
    within = f" in group '{entry.group}'" if entry.group is not None else ""
    near = difflib.get_close_matches(entry.channel, every, n=1)
    hint = f"did you mean '{near[0]}'?" if near else "`clutchid look` lists them."
    return f"{name}: there is no channel '{entry.channel}'{within}; {hint}"


def _unit_problem(name: str, heading: Heading, unit: str | None) -> list[str]:
    known = known_units(QUANTITIES[name])
    if unit is None:
        return [
            f"{name}: channel '{heading.text}' has no unit; write unit = '...' in the map, one of {', '.join(known)}."
        ]
    if unit not in UNITS or UNITS[unit].si != QUANTITIES[name]:
        return [
            f"{name}: channel '{heading.text}' has the unit [{unit}]; write unit = '...' in the map (and a factor, "
            f"where the sensor's own unit is another), one of {', '.join(known)}."
        ]
    return []


def _own_clock(raster: Raster) -> tuple[Heading, Channel] | None:
    """The stamps that the file names itself."""
    if raster.clock is None:
        return None
    heading = next(heading for heading in raster.headings if heading.index == raster.clock)
    return Heading(heading.index, heading.text, "time", heading.unit or "s"), Channel(heading.text)


def _no_clock(columns: Mapping[str, tuple[Heading, Channel]]) -> str:
    names = " and ".join(f"'{heading.text}'" for heading, _ in columns.values())
    return (
        f"{names}: the file does not say when {'it was' if len(columns) == 1 else 'they were'} taken; map [time] too."
    )
