"""Propose a channel map from the names, units and ranges of the channels in a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from clutchid.errors import DataError
from clutchid.log import INPUTS
from clutchid.recordings.columns import QUANTITIES, REQUIRED
from clutchid.recordings.map.candidates import (
    STANDARD,
    Candidate,
    candidates,
    fits,
    gauge_as_well,
    implausible,
    is_sure,
    reason,
)
from clutchid.recordings.map.channel_map import Channel, ChannelMap
from clutchid.recordings.map.channel_words import is_set_point, name_score
from clutchid.recordings.map.picking import own_clock
from clutchid.recordings.map.ranges import PLAUSIBLE, Ranges, guessed_unit
from clutchid.recordings.source import Source
from clutchid.recordings.table import and_more

#: Number of channels that are listed where one is missing.
_LISTED = 8


@dataclass(frozen=True, slots=True)
class Proposal:
    """A proposed channel map; `open` lists what the user has to decide, `notes` what the names and samples imply.

    A quantity is `certain` if its unit is known and no other channel matches as well. What is unclear about a condition
    of the recording is a note: nobody has to decide it.
    """

    channels: ChannelMap
    certain: tuple[str, ...]
    open: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing has to be decided, so that the file can be read with this map."""
        return not self.open and all(name in self.certain for name in self.channels.channels if name not in PLAUSIBLE)

    @property
    def without_uncertain(self) -> ChannelMap:
        """The map without conditions that are not certain."""
        kept = {
            name: entry
            for name, entry in self.channels.channels.items()
            if name in self.certain or name not in PLAUSIBLE
        }
        return replace(self.channels, channels=kept)


def propose(source: Source, required: Sequence[str] = REQUIRED) -> Proposal:
    """Assign the channels of a file to quantities by names, units and ranges.

    A channel that is constant is proposed for nothing, unless it has the standard name, or is a duty cycle of 0.

    Raises
    ------
    DataError
        If samples cannot be read.
    """
    ranges = Ranges(source)
    timed = _timed(source, ranges)
    channels: dict[str, Channel] = {}
    certain: list[str] = []
    remarks: list[str] = []
    notes: list[str] = []
    comments: dict[str, str] = {}
    unused: dict[str, list[Candidate]] = {}
    for name in QUANTITIES:
        found = [candidate for candidate in candidates(source, name, ranges) if not _taken(candidate, channels)]
        ranked = _ranked(name, found)
        notes += _left_out(name, found)
        if not ranked or (name == "time" and not source.tabular and timed):
            unused[name] = found
            continue
        best, *others = ranked
        best = gauge_as_well(best, channels.get("pressure_a")) if name == "pressure_supply" else best
        channels[name] = _entry(source, best)
        comments[name] = _comment(best)
        remark = _remark(name, best, [other for other in others if other.score == best.score])
        (notes if name in PLAUSIBLE else remarks).extend([remark] if remark else [])
        sure = name != "pressure_supply" or best.score >= STANDARD or is_sure(best.heading)
        certain += [name] if sure and not remark else []
        notes += _notes(name, best, others if not remark else ())
    for name in required:
        if name not in channels and not (name == "time" and timed):
            remarks.append(_missing(name, unused[name], _set_points(source, name)))
            comments[name] = _choice(source, name, channels)
            if name == "time":
                comments["rate"] = "samples per second, for a file without time"
    return Proposal(ChannelMap(channels, comments=comments), tuple(certain), tuple(remarks), tuple(notes))


def map_for(source: Source, required: Sequence[str]) -> ChannelMap | None:
    """Channel map for a file: the proposed one if it is complete; None for a table whose columns the user can rename.

    Raises
    ------
    DataError
        If there is none; the text lists what is open.
    """
    proposal = propose(source, required)
    if proposal.complete:
        return replace(proposal.without_uncertain, comments={"": "\n".join(_identified(source, proposal))})
    if source.tabular or not source.rasters:
        return None
    save = "`clutchid look FILE --save MAP.toml` writes a proposed channel map; correct it and give it with --map."
    raise DataError.of(str(source.path), [*source.problems, *proposal.open, save])


def _identified(source: Source, proposal: Proposal) -> list[str]:
    """Warnings about channels that were identified by other names than the standard ones."""
    chosen = proposal.without_uncertain.channels
    standard = {heading.text: heading.name for raster in source.rasters for heading in raster.headings}
    if all(standard[entry.channel] == name for name, entry in chosen.items()):
        return list(proposal.notes)
    assigned = ", ".join(f"{name} = '{entry.channel}'" for name, entry in chosen.items())
    note = f"the channels were identified by their names: {assigned}; give a channel map (--map) to be certain."
    return [note, *proposal.notes]


def _timed(source: Source, ranges: Ranges) -> bool:
    """Whether the file defines the time of every time grid, and no interval contradicts its unit."""
    for index, raster in enumerate(source.rasters):
        clock, _ = own_clock(raster)
        if clock is None:
            return False
        undefined = raster.headings[clock.index].unit is None
        if undefined and guessed_unit("time", ranges(index, clock)) not in (clock.unit, None):
            return False
    return bool(source.rasters)


def _taken(candidate: Candidate, channels: Mapping[str, Channel]) -> bool:
    return any(
        entry.channel == candidate.heading.text and entry.group in (None, candidate.raster.name)
        for entry in channels.values()
    )


def _ranked(name: str, found: Sequence[Candidate]) -> list[Candidate]:
    """Candidates by falling score, without constant ones; a duty cycle of 0 remains if it is the only candidate.

    A condition may be constant for all of a recording, but must be possible.
    """
    if name in PLAUSIBLE:
        possible = [c for c in found if c.score >= STANDARD or not implausible(name, c.heading, c.unit, c.seen)]
        return sorted(possible, key=lambda candidate: -candidate.score)
    chosen = [candidate for candidate in found if not candidate.seen.constant]
    if not chosen and name in INPUTS and len(found) == 1 and found[0].seen.high == 0.0:
        chosen = list(found)
    return sorted(chosen, key=lambda candidate: -candidate.score)


def _remark(name: str, best: Candidate, equal: Sequence[Candidate]) -> str:
    """What has to be decided about a proposed channel; empty if nothing."""
    text = best.heading.text
    if equal:
        others = ", ".join(f"'{candidate.heading.text}'" for candidate in equal[:5])
        return f"{name}: '{text}' is proposed, but {others} would match as well."
    if best.guess:
        return f"{name}: '{text}' {best.guess}."
    return "" if best.unit else f"{name}: '{text}' has no known unit; add it to the map."


def _left_out(name: str, found: Sequence[Candidate]) -> list[str]:
    """Why channels that are called like a condition are none."""
    if name not in PLAUSIBLE:
        return []
    named = [c for c in found if c.score < STANDARD]
    return [text for c in named if (text := implausible(name, c.heading, c.unit, c.seen))]


def _notes(name: str, best: Candidate, others: Sequence[Candidate]) -> Iterator[str]:
    """What the name and the samples of a proposed channel imply, and why it is not one of the `others`."""
    if name == "pressure_supply" and best.score < STANDARD:
        why = reason(best.heading, [other.heading for other in others])
        yield from [why] if why else []
    if best.implied:
        yield f"{name}: '{best.heading.text}' [{best.heading.unit or best.unit}] {best.implied}."
    if best.heading.unit is None and best.unit and not best.guess:
        yield f"{name}: the unit [{best.unit}] is taken from the name of the channel '{best.heading.text}'."
    if best.seen.constant and name not in PLAUSIBLE:
        yield f"{name}: '{best.heading.text}' is constant at {best.seen.low:g}."


def _set_points(source: Source, name: str) -> list[str]:
    """Channels that are what a controller asks of a quantity."""
    headings = [heading for raster in source.rasters for heading in raster.headings]
    return [h.text for h in headings if is_set_point(h.text) and name_score(name, h.text) > 0.0 and fits(name, h.unit)]


def _missing(name: str, found: Sequence[Candidate], set_points: Sequence[str]) -> str:
    """Remark on a quantity without a channel, of which only constant ones were `found`, or set points."""
    if not found and set_points and name not in INPUTS:
        return f"{name}: only a set point matches by name, '{set_points[0]}'; add the measured channel to the map."
    if not found:
        also = ", or rate = 1000.0 (Hz)" if name == "time" else ""
        return f"{name}: no channel name matches; add it to the map{also}."
    names = ", ".join(f"'{candidate.heading.text}' (always {candidate.seen.low:g})" for candidate in found[:5])
    return f"{name}: only constant channels match by name, {names}; add the right one to the map."


def _choice(source: Source, name: str, channels: Mapping[str, Channel]) -> str:
    """Channels that a missing quantity may be: those with a unit of it, else those without a unit."""
    taken = {entry.channel for entry in channels.values()}
    free = [
        heading
        for raster in source.rasters
        for heading in raster.headings
        if heading.text and heading.text not in taken and heading.text not in dict(raster.others)
    ]
    chosen = [heading for heading in free if fits(name, heading.unit)] or [h for h in free if h.unit is None]
    shown = [f"'{heading.text}'" for heading in chosen[:_LISTED]]
    return f"candidates: {and_more(shown, len(chosen) - len(shown))}" if shown else "no channel has a unit of it"


def _entry(source: Source, best: Candidate) -> Channel:
    same = sum(heading.text == best.heading.text for raster in source.rasters for heading in raster.headings)
    entry = Channel(best.heading.text, group=best.raster.name if same > 1 else None)
    return replace(entry, unit=best.unit) if best.heading.unit != best.unit else entry


def _comment(best: Candidate) -> str:
    unit, remark = best.heading.unit, best.heading.comment
    shown_unit = " (no unit in the file)" if unit is None else "" if unit == "1" else f" {unit}"
    constant = ", constant" if best.seen.constant else ""
    return f"{best.seen.low:.6g} to {best.seen.high:.6g}{shown_unit}{constant}" + (f"; {remark}" if remark else "")
