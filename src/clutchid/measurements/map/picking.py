"""Apply a channel map to a file: find the channel of each quantity, and report all mismatches together."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from clutchid.log.units import known_units
from clutchid.measurements.columns import QUANTITIES, Heading, channel_name, is_unit_of, unit_at_end, unit_spelled
from clutchid.measurements.map.channel_map import COUNTED, Channel, ChannelMap, PickedChannels, contradictions
from clutchid.measurements.map.channel_words import means_no_time, means_time
from clutchid.measurements.map.ranges import PLAUSIBLE
from clutchid.measurements.source import Raster, Source

_SHOWN = 8

#: Quantities that a file may lack although a map names their channels: another recording of the vehicle has them.
OPTIONAL = ("pressure_a", *PLAUSIBLE)


def pick(
    source: Source, channels: ChannelMap, required: Sequence[str]
) -> tuple[tuple[PickedChannels, ...], tuple[str, ...]]:
    """Channels that the map selects from the file, and all problems of the map.

    That the file lacks one of `OPTIONAL` is a note, unless it is `required`.
    """
    problems = contradictions(channels)
    columns_by_grid: dict[tuple[int, float], dict[str, tuple[Heading, Channel]]] = {}
    clocks: dict[int, tuple[Heading, Channel]] = {}
    notes: list[str] = []
    for name, entry in channels.channels.items():
        places = _named(source, entry)
        if not places and name in OPTIONAL and name not in required:
            notes.append(f"{name}: this file has no channel '{entry.channel}' and is read without it.")
            continue
        if len(places) != 1:
            problems.append(_misfit(source, name, entry, places))
            continue
        raster, heading = places[0]
        held = dict(source.rasters[raster].others).get(heading.text)
        if held is not None:
            problems.append(_no_numbers(name, heading.text, held))
            continue
        notes += _namesakes(name, heading, source.rasters[raster])
        unit = unit_spelled(entry.unit) or heading.unit
        if unit is None and (unit := unit_at_end(heading.text, QUANTITIES[name])):
            notes.append(f"{name}: the unit [{unit}] is taken from the name of the channel '{heading.text}'.")
        problems += _unit_problem(name, heading, unit)
        chosen = (replace(heading, name=name, unit=unit), entry)
        if name == "time":
            clocks[raster] = chosen
        else:
            columns_by_grid.setdefault((raster, entry.delay), {})[name] = chosen
    picks = []
    for (raster, delay), columns in columns_by_grid.items():
        clock = clocks.get(raster) or _clock(source.rasters[raster], channels.rate, columns, notes, problems)
        timed = columns if clock is None else {"time": clock, **columns}
        rate = channels.rate if clock is not None and clock[0].index == COUNTED else None
        picks.append(PickedChannels(raster, timed, delay, rate, tuple(notes)))
        notes = []
    return tuple(picks), tuple(problems)


def own_clock(raster: Raster) -> tuple[Heading | None, str]:
    """Time stamps as defined by the file, and a warning if their unit or even their meaning is a guess.

    A channel with a unit or a name of another quantity is no time, even if it increases.
    """
    heading = next((heading for heading in raster.headings if heading.index == raster.clock), None)
    if (
        heading is None
        or heading.name not in (None, "time")
        or ((heading.name or heading.unit) is None and means_no_time(heading.text))
    ):
        return None, ""
    named = unit_at_end(heading.text, "s")
    unit = heading.unit or named or "s"
    if not is_unit_of("time", unit):
        return None, ""
    warning = ""
    if heading.unit is None and named:
        warning = f"time: the unit [{unit}] is taken from the name of the channel '{heading.text}'."
    elif heading.unit is None:
        reason = "has no unit" if means_time(heading.text) else "increases and is taken for time"
        warning = f"time: '{heading.text}' {reason}; [s] is guessed. Give the right one in [time] of a channel map."
    return replace(heading, name="time", unit=unit), warning


def _clock(
    raster: Raster,
    rate: float | None,
    columns: Mapping[str, tuple[Heading, Channel]],
    notes: list[str],
    problems: list[str],
) -> tuple[Heading, Channel] | None:
    """Time stamps of a time grid without a time channel in the map; assumptions and problems are appended."""
    heading, warning = own_clock(raster)
    if rate is None and heading is None:
        names = " and ".join(f"'{column.text}'" for column, _ in columns.values())
        problems.append(
            f"{names}: the file defines no time axis for {'it' if len(columns) == 1 else 'them'}; add [time] to the "
            "map, or the rate of the samples in Hz as `rate` above its first table, if they are equally spaced."
        )
        return None
    if rate is None and heading is not None:
        notes += [warning] if warning else []
        return heading, Channel(heading.text)
    if heading is not None and (means_time(heading.text) or not warning):
        problems.append(f"rate = {rate:g} Hz: the file has a time channel, '{heading.text}'; remove rate from the map.")
        return None
    return Heading(COUNTED, "sample / rate", "time", "s"), Channel("")


def _named(source: Source, entry: Channel) -> list[tuple[int, Heading]]:
    """Channels with that name, else with that name before a unit in brackets; then both in any case."""
    wanted = channel_name(entry.channel)
    within = [
        (index, heading)
        for index, raster in enumerate(source.rasters)
        if entry.group in (None, raster.name)
        for heading in raster.headings
    ]
    for same in (str, str.casefold):
        for part in (str, _bare):
            if places := [place for place in within if same(part(place[1].text)) == same(wanted)]:
                return places
    return []


def _namesakes(name: str, heading: Heading, raster: Raster) -> list[str]:
    """Note about further channels with the name of the selected one, which have numbers, see `columns.distinct`."""
    again = re.compile(rf"{re.escape(heading.text)} \(\d+\)")
    others = [f"'{other.text}'" for other in raster.headings if again.fullmatch(other.text)]
    if not others:
        return []
    return [f"{name}: the first channel '{heading.text}' is used, not {' or '.join(others[:_SHOWN])}."]


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
    others = dict(other for raster in source.rasters for other in raster.others)
    if entry.channel in others:
        return _no_numbers(name, entry.channel, others[entry.channel])
    within = f" in group '{entry.group}'" if entry.group is not None else ""
    near = difflib.get_close_matches(entry.channel, [heading.text for heading in source.headings], n=1)
    hint = f"did you mean '{near[0]}'?" if near else "`clutchid look` lists them."
    return f"{name}: there is no channel '{entry.channel}'{within}; {hint}"


def _no_numbers(name: str, text: str, held: str) -> str:
    return (
        f"{name}: channel '{text}' holds {held}, not one number per sample; name another channel, or export it as "
        "numbers."
    )


def _unit_problem(name: str, heading: Heading, unit: str | None) -> list[str]:
    units = known_units(QUANTITIES[name])
    if unit is None:
        return [
            f"{name}: channel '{heading.text}' has no unit; write unit = '...' in the map, one of {', '.join(units)}."
        ]
    if not is_unit_of(name, unit):
        return [
            f"{name}: channel '{heading.text}' has the unit [{unit}]; write unit = '...' in the map (and a factor, "
            f"if the unit of the sensor differs), one of {', '.join(units)}."
        ]
    return []
