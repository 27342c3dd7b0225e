"""Propose a channel map from the names, units and ranges of the channels in a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from clutchid.errors import DataError
from clutchid.io.columns import QUANTITIES, REQUIRED, Heading, unit_at_end
from clutchid.io.map.channel_map import Channel, ChannelMap
from clutchid.io.map.channel_words import name_score
from clutchid.io.map.picking import own_clock
from clutchid.io.map.ranges import Range, Ranges, gauge_unit, guessed_unit
from clutchid.io.source import Raster, Source
from clutchid.io.table import and_more
from clutchid.log import INPUTS
from clutchid.units import UNITS

#: Score of a channel with the standard name of the quantity.
_STANDARD = 100.0

#: Number of channels that are listed where one is missing.
_LISTED = 8


@dataclass(frozen=True, slots=True)
class Proposal:
    """A proposed channel map; `open` lists what the user has to decide, `notes` what the names and samples imply.

    A quantity is `certain` if its unit is known and no other channel matches as well.
    """

    channels: ChannelMap
    certain: tuple[str, ...]
    open: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing has to be decided, so that the file can be read with this map."""
        return not self.open and all(name in self.certain for name in self.channels.channels)


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A channel that may be a quantity, its score, its range, and its unit with the reason if that is a guess."""

    raster: Raster
    heading: Heading
    score: float
    seen: Range
    unit: str | None
    guess: str


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
    unused: dict[str, list[_Candidate]] = {}
    for name in QUANTITIES:
        found = [candidate for candidate in _candidates(source, name, ranges) if not _taken(candidate, channels)]
        ranked = _ranked(name, found)
        if not ranked or (name == "time" and not source.tabular and timed):
            unused[name] = found
            continue
        best, *others = ranked
        channels[name] = _entry(source, best)
        comments[name] = _comment(best)
        remark = _remark(name, best, [other for other in others if other.score == best.score])
        remarks += [remark] if remark else []
        certain += [] if remark else [name]
        notes += _notes(name, best)
    for name in required:
        if name not in channels and not (name == "time" and timed):
            remarks.append(_missing(name, unused[name]))
            comments[name] = _choice(source, name, channels)
            if name == "time":
                comments["rate"] = "samples per second, for a file without time"
    return Proposal(ChannelMap(channels, comments=comments), tuple(certain), tuple(remarks), tuple(notes))


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
        return replace(proposal.channels, comments={"": "\n".join(_identified(source, proposal))})
    if source.tabular or not source.rasters:
        return None
    save = "`clutchid look FILE --save MAP.toml` writes a proposed channel map; correct it and give it with --map."
    raise DataError.of(str(source.path), [*source.problems, *proposal.open, save])


def _identified(source: Source, proposal: Proposal) -> list[str]:
    """Warnings about channels that were identified by other names than the standard ones."""
    chosen = proposal.channels.channels
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


def _taken(candidate: _Candidate, channels: Mapping[str, Channel]) -> bool:
    return any(
        entry.channel == candidate.heading.text and entry.group in (None, candidate.raster.name)
        for entry in channels.values()
    )


def _candidates(source: Source, name: str, ranges: Ranges) -> Iterator[_Candidate]:
    for index, raster in enumerate(source.rasters):
        clock, _ = own_clock(raster)
        texts = {text for text, _ in raster.others}
        for heading in raster.headings:
            if heading.text in texts or (clock is not None and heading.index == clock.index and name != "time"):
                continue
            score = _STANDARD if heading.name == name else name_score(name, heading.text)
            if score <= 0.0 or not (heading.unit is None or _fits(name, heading.unit)):
                continue
            seen = ranges(index, heading, further=score < _STANDARD)
            seen = seen._replace(constant=seen.constant and score < _STANDARD)
            unit = heading.unit or unit_at_end(heading.text, QUANTITIES[name])
            yield _Candidate(raster, heading, score + (0.5 if unit else 0.0), seen, *_unit(name, unit, seen))


def _unit(name: str, unit: str | None, seen: Range) -> tuple[str | None, str]:
    """The unit of a channel, and the reason if it is a guess."""
    gauge = gauge_unit(unit, seen.low)
    if unit is None:
        guess = guessed_unit(name, seen)
        where = "intervals" if name == "time" else "range"
        return guess, f"has no unit; [{guess}] is guessed from its {where}" if guess else ""
    if gauge and not seen.constant:
        return gauge, f"falls to {seen.low:.3g} {unit}, so that the gauge unit [{gauge}] is guessed instead of [{unit}]"
    return unit, ""


def _ranked(name: str, found: Sequence[_Candidate]) -> list[_Candidate]:
    """Candidates by falling score, without constant ones; a duty cycle of 0 remains if it is the only candidate."""
    chosen = [candidate for candidate in found if not candidate.seen.constant]
    if not chosen and name in INPUTS and len(found) == 1 and found[0].seen.high == 0.0:
        chosen = list(found)
    return sorted(chosen, key=lambda candidate: -candidate.score)


def _fits(name: str, unit: str | None) -> bool:
    return unit in UNITS and UNITS[unit].si == QUANTITIES[name]


def _remark(name: str, best: _Candidate, equal: Sequence[_Candidate]) -> str:
    """What has to be decided about a proposed channel; empty if nothing."""
    text = best.heading.text
    if equal:
        others = ", ".join(f"'{candidate.heading.text}'" for candidate in equal[:5])
        return f"{name}: '{text}' is proposed, but {others} would match as well."
    if best.guess:
        return f"{name}: '{text}' {best.guess}."
    return "" if best.unit else f"{name}: '{text}' has no known unit; add it to the map."


def _notes(name: str, best: _Candidate) -> Iterator[str]:
    """What the name and the samples of a proposed channel imply."""
    if best.heading.unit is None and best.unit and not best.guess:
        yield f"{name}: the unit [{best.unit}] is taken from the name of the channel '{best.heading.text}'."
    if best.seen.constant:
        yield f"{name}: '{best.heading.text}' is constant at {best.seen.low:g}."


def _missing(name: str, found: Sequence[_Candidate]) -> str:
    """Remark on a quantity without a channel, of which only constant ones were `found`."""
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
    chosen = [heading for heading in free if _fits(name, heading.unit)] or [h for h in free if h.unit is None]
    shown = [f"'{heading.text}'" for heading in chosen[:_LISTED]]
    return f"candidates: {and_more(shown, len(chosen) - len(shown))}" if shown else "no channel has a unit of it"


def _entry(source: Source, best: _Candidate) -> Channel:
    same = sum(heading.text == best.heading.text for raster in source.rasters for heading in raster.headings)
    entry = Channel(best.heading.text, group=best.raster.name if same > 1 else None)
    return replace(entry, unit=best.unit) if best.heading.unit != best.unit else entry


def _comment(best: _Candidate) -> str:
    unit, remark = best.heading.unit, best.heading.comment
    shown_unit = " (no unit in the file)" if unit is None else "" if unit == "1" else f" {unit}"
    constant = ", constant" if best.seen.constant else ""
    return f"{best.seen.low:.6g} to {best.seen.high:.6g}{shown_unit}{constant}" + (f"; {remark}" if remark else "")
