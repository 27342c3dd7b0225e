"""Apply a channel map to a file: find the channel of each quantity, and report all mismatches together."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from clutchid.io.columns import QUANTITIES, Heading, channel_name, unit_spelled
from clutchid.io.map.channel_map import Channel, ChannelMap
from clutchid.io.source import Raster, Source
from clutchid.units import UNITS, known_units

_SHOWN = 8


@dataclass(frozen=True, slots=True)
class Pick:
    """Channels on one time grid: heading and map entry by quantity, including `time`.

    `delay` in s is the common delay of the channels after their time stamps.
    """

    raster: int
    columns: Mapping[str, tuple[Heading, Channel]]
    delay: float = 0.0


def pick(source: Source, channels: ChannelMap) -> tuple[tuple[Pick, ...], tuple[str, ...]]:
    """Channels that the map selects from the file, and all problems of the map."""
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
    """Channels with that name, else with that name before a unit in brackets; then both in any case."""
    wanted = channel_name(entry.channel)
    within = [(i, raster) for i, raster in enumerate(source.rasters) if entry.group in (None, raster.name)]
    for same in (str, str.casefold):
        for part in (str, _bare):
            places = [
                (index, heading)
                for index, raster in within
                for heading in raster.headings
                if same(part(heading.text)) == same(wanted)
            ]
            if places:
                yield from places
                return


def _bare(text: str) -> str:
    """A heading without its unit in brackets."""
    return text.partition("[")[0].strip()


def _misfit(source: Source, name: str, entry: Channel, places: list[tuple[int, Heading]]) -> str:
    """Message for an entry of the map that selects no channel, or more than one."""
    if places:
        groups = [source.rasters[raster].name for raster, _ in places]
        several = len(set(groups)) > 1
        names = groups if several else [heading.text for _, heading in places]
        shown = ", ".join(f"'{text}'" for text in names[:_SHOWN])
        what = "name the group" if several else "write the whole name"
        return f"{name}: {len(places)} channels are called '{entry.channel}'; {what}, one of {shown}."
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
            f"if the unit of the sensor differs), one of {', '.join(known)}."
        ]
    return []


def _own_clock(raster: Raster) -> tuple[Heading, Channel] | None:
    """Time stamps as defined by the file."""
    if raster.clock is None:
        return None
    heading = next(heading for heading in raster.headings if heading.index == raster.clock)
    return Heading(heading.index, heading.text, "time", heading.unit or "s"), Channel(heading.text)


def _no_clock(columns: Mapping[str, tuple[Heading, Channel]]) -> str:
    names = " and ".join(f"'{heading.text}'" for heading, _ in columns.values())
    return f"{names}: the file defines no time axis for {'it' if len(columns) == 1 else 'them'}; add [time] to the map."
