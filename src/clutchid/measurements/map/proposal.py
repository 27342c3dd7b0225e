"""Propose a channel map from the names, units and ranges of the channels in a file.

Supply pressure and temperature of the air are conditions of a recording, which any vehicle may have. No fit needs them,
so a candidate that is unclear is left out with a note.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

from clutchid.errors import DataError
from clutchid.log import INPUTS
from clutchid.log.units import UNITS
from clutchid.measurements.columns import QUANTITIES, REQUIRED, Heading, is_unit_of, unit_at_end
from clutchid.measurements.formats.can.j1939 import parameter_in
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from clutchid.measurements.map.channel_words import (
    Circuit,
    circuit_of,
    is_beside,
    is_named_by_j1939,
    is_set_point,
    name_score,
)
from clutchid.measurements.map.picking import own_clock
from clutchid.measurements.map.ranges import PLAUSIBLE, Range, gauge_unit, guessed_unit, range_of
from clutchid.measurements.source import Raster, Source
from clutchid.messages import listed

#: Score of a channel with the standard name of the quantity.
STANDARD = 100.0

#: Loss of score of a duty cycle with the name of a set point: the measured one is preferred.
_SET_POINT = 0.25

#: What the conditions of a recording are of.
_CONDITIONS = {"pressure_supply": "an air supply", "temperature_ambient": "the air"}

#: Why the channel of a circuit is proposed.
_REASONS = {
    Circuit.POWERTRAIN: "it is that of the powertrain or the clutch",
    Circuit.AUXILIARIES: "the circuit of auxiliaries (circuit 4) usually supplies the clutch actuator",
    Circuit.SUPPLY: "no channel is nearer to the clutch than the supply as a whole",
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """A channel that may be the quantity `name`: its score, its range, and its unit with the reason if it is a guess.

    `implied` is a further assumption about the unit.
    """

    name: str
    raster: Raster
    heading: Heading
    score: float
    span: Range
    unit: str | None
    guess: str
    implied: str = ""

    @property
    def place(self) -> tuple[str, str]:
        """Names of its time grid and of the channel."""
        return self.raster.name, self.heading.text

    @property
    def circuit(self) -> Circuit | None:
        """Source of the air of a supply pressure, as its name says; None under the standard name."""
        named = self.name != "pressure_supply" or self.score >= STANDARD
        return None if named else circuit_of(_title(self.heading))

    @property
    def flag(self) -> str:
        """Reason why it may be no duty cycle but a flag beside one; empty if none."""
        if self.name not in INPUTS or self.score >= STANDARD or self.heading.unit == "%":
            return ""
        if is_beside(self.heading.text):
            return "has the name of a flag or a state"
        return "is 0 or 1 only" if self.span.switched else ""

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Order among the candidates: of duty cycles no flag and a unit of their own count before any word."""
        return bool(self.flag), self.name in INPUTS and self.heading.unit is None, -self.score


def _candidates(source: Source, name: str, ranges: Callable[..., Range]) -> Iterator[Candidate]:
    """Channels that are called like the quantity `name`, and have a unit of it or none."""
    for index, raster in enumerate(source.rasters):
        clock, _ = own_clock(raster)
        texts = {text for text, _ in raster.others}
        for heading in raster.headings:
            if heading.text in texts or (clock is not None and heading.index == clock.index and name != "time"):
                continue
            score = _score(name, heading)
            if score <= 0.0 or not (heading.unit is None or is_unit_of(name, heading.unit)):
                continue
            span = ranges(index, heading.index, further=score < STANDARD and name not in PLAUSIBLE)
            span = span._replace(constant=span.constant and score < STANDARD)
            unit = heading.unit or unit_at_end(heading.text, QUANTITIES[name])
            candidate = Candidate(name, raster, heading, score + (0.5 if unit else 0.0), span, *_unit(name, unit, span))
            yield _gauge_of_standard(candidate) if candidate.circuit is not None else candidate


def _score(name: str, heading: Heading) -> float:
    """Score of the name of a channel for a quantity; a set point is none, except of a duty cycle."""
    if heading.name == name:
        return STANDARD
    score = name_score(name, _title(heading) if name in PLAUSIBLE else heading.text)
    if score >= STANDARD or not is_set_point(heading.text):
        return score
    return max(score - _SET_POINT, 0.0) if name in INPUTS else 0.0


def _gauge_of_standard(candidate: Candidate) -> Candidate:
    """A supply pressure in the gauge unit if it is one by the standard of the bus."""
    gauge, heading = f"{candidate.unit}(g)", candidate.heading
    parameter = parameter_in(heading.comment) or parameter_in(heading.text)
    if gauge not in UNITS or not (not parameter.absolute if parameter else is_named_by_j1939(heading.text)):
        return candidate
    return replace(candidate, unit=gauge, implied="is a gauge pressure by SAE J1939-71")


def gauge_as_well(candidate: Candidate, chamber: Channel | None) -> Candidate:
    """A supply pressure in the gauge unit if the range of the `chamber` pressure says that it is, in the same unit."""
    gauge = f"{candidate.unit}(g)"
    if gauge not in UNITS or candidate.score >= STANDARD:
        return candidate
    if chamber is not None and chamber.unit == gauge:
        return replace(candidate, unit=gauge, implied=f"is taken as gauge pressure, as '{chamber.channel}' is")
    return replace(candidate, implied=f"is read as absolute; write {gauge} in a channel map if it is a gauge pressure")


def _unit(name: str, unit: str | None, span: Range) -> tuple[str | None, str]:
    """The unit of a channel, and the reason if it is a guess."""
    gauge = gauge_unit(unit, span.low)
    if unit is None:
        guess = guessed_unit(name, span)
        where = "intervals" if name == "time" else "range"
        return guess, f"has no unit; [{guess}] is guessed from its {where}" if guess else ""
    if gauge and not span.constant:
        return gauge, f"falls to {span.low:.3g} {unit}, so that the gauge unit [{gauge}] is guessed instead of [{unit}]"
    return unit, ""


def _title(heading: Heading) -> str:
    """Title in SAE J1939-71 of a channel that its comment or its name identifies; else its name."""
    parameter = parameter_in(heading.comment) or parameter_in(heading.text)
    return parameter.title if parameter else heading.text


def _implausible(candidate: Candidate) -> str:
    """Reason why the samples of a channel cannot be a condition, in a sentence; empty if they can."""
    name, unit, span = candidate.name, candidate.unit, candidate.span
    if name not in PLAUSIBLE or candidate.score >= STANDARD:
        return ""
    if math.isnan(span.low) or (span.constant and span.low == 0.0):
        return f"{name}: '{candidate.heading.text}' has no values and is left out."
    si_unit = UNITS.get(unit or "")
    if si_unit is None:
        return ""
    low, high = (value * si_unit.scale + si_unit.offset for value in (span.low, span.high))
    least, most = PLAUSIBLE[name]
    if least <= low and high <= most:
        return ""
    what = f"is {span.low:.4g} to {span.high:.4g} {unit}, which {_CONDITIONS[name]} never has"
    return f"{name}: '{candidate.heading.text}' {what}; it is left out."


#: Number of channels that are listed where one is missing.
_LISTED = 8


@dataclass(frozen=True, slots=True)
class Proposal:
    """A proposed channel map.

    Attributes
    ----------
    channels
        The map.
    open
        What the user has to decide, one sentence each.
    notes
        What names and samples imply, one sentence each.
    """

    channels: ChannelMap
    open: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing has to be decided, so that the file can be read with this map."""
        return not self.open

    @property
    def remedy(self) -> str:
        """Request to add the channels that the map lacks, or else to confirm its guesses."""
        names = (text.partition(":")[0] for text in self.open)
        lacking = " and ".join(name for name in names if name not in self.channels.channels)
        guessed = "units" if all("is guessed" in text for text in self.open) else "channels and units"
        return f"Add {lacking}" if lacking else f"Confirm the guessed {guessed}"


def propose(source: Source, required: Sequence[str] = REQUIRED) -> Proposal:
    """Assign the channels of a file to quantities by names, units and ranges.

    A channel that is constant is proposed for nothing, unless it has the standard name, or is a duty cycle of 0.

    Raises
    ------
    DataError
        If samples cannot be read.
    """
    ranges = cache(partial(range_of, source))
    timed = _timed(source)
    channels: dict[str, Channel] = {}
    remarks: list[str] = []
    notes: list[str] = []
    unused: dict[str, list[Candidate]] = {}
    taken: set[tuple[str, str]] = set()
    for name in QUANTITIES:
        named = [candidate for candidate in _candidates(source, name, ranges) if candidate.place not in taken]
        notes += filter(None, map(_implausible, named))
        ranked = _ranked(name, named)
        if not ranked or (name == "time" and timed and not (source.tabular and len(source.rasters) == 1)):
            unused[name] = named
            continue
        best, *others = ranked
        best = gauge_as_well(best, channels.get("pressure_a")) if name == "pressure_supply" else best
        remark = _remark(best, [other for other in others if other.rank == best.rank], source.tabular)
        if remark and name in PLAUSIBLE:
            notes.append(f"{remark} It is left out; add the right one to a channel map.")
            continue
        channels[name] = _entry(source, best)
        taken.add(best.place)
        remarks += [remark] if remark else []
        notes += _notes(best, [other for other in others if other.rank != best.rank])
    missing = [name for name in required if name not in channels and not (name == "time" and timed)]
    for name in missing:
        left = _left(source, name, channels)
        sole = [QUANTITIES[other] for other in missing].count(QUANTITIES[name]) == 1 and not unused[name]
        if sole and name in INPUTS and len(left) == 1 and left[0].unit and not is_set_point(left[0].text):
            channels[name] = Channel(left[0].text)
            remarks.append(f"{name}: '{left[0].text}' is proposed, the only channel left with a unit of it.")
        else:
            remarks.append(_missing(source, name, unused[name], left))
    return Proposal(ChannelMap(channels), tuple(remarks), tuple(notes))


def map_for(source: Source, required: Sequence[str]) -> ChannelMap | None:
    """Channel map for a file: the proposed one if it is complete; None for a table without other names that are known.

    Raises
    ------
    DataError
        If there is none; the text lists what is open.
    """
    proposal = propose(source, required)
    entries, standard = proposal.channels.channels, {heading.text: heading.name for heading in source.headings}
    by_other_names = any(standard[entry.channel] != name for name, entry in entries.items())
    if proposal.complete:
        assigned = ", ".join(f"{name} = '{entry.channel}'" for name, entry in entries.items())
        note = f"the channels were identified by their names: {assigned}; give a channel map (--map) to be certain."
        return replace(proposal.channels, comment="\n".join([*([note] if by_other_names else []), *proposal.notes]))
    if not source.rasters or (source.tabular and (means_the_contract(source) or not by_other_names)):
        return None
    save = "`clutchid look FILE --save MAP.toml` writes a proposed channel map; correct it and give it with --map."
    rename = _units_to_write(source, proposal) if source.tabular else []
    raise DataError.of(str(source.path), [*source.problems, *proposal.open, *rename, save])


def means_the_contract(source: Source) -> bool:
    """Whether enough columns of a table have standard names to report what is wrong with the others."""
    return sum(heading.name is not None for heading in source.headings) > 1 or not source.rasters


def _units_to_write(source: Source, proposal: Proposal) -> list[str]:
    """Headings of a table with the units that were guessed, which make them sure."""
    units = {entry.channel: entry.unit for entry in proposal.channels.channels.values()}
    headings = [
        f"'{heading.text} [{units[heading.text]}]'"
        for heading in source.headings
        if heading.unit is None and units.get(heading.text)
    ]
    return [f"write units in brackets after the names: {', '.join(headings)}, if that is right."] if headings else []


def _timed(source: Source) -> bool:
    """Whether the file defines the time of every time grid, and no interval contradicts its unit."""
    for index, raster in enumerate(source.rasters):
        clock, _ = own_clock(raster)
        if clock is None:
            return False
        undefined = any(heading.index == clock.index and heading.unit is None for heading in raster.headings)
        if undefined and guessed_unit("time", range_of(source, index, clock.index)) not in (clock.unit, None):
            return False
    return bool(source.rasters)


def _ranked(name: str, named: Sequence[Candidate]) -> list[Candidate]:
    """Candidates by their rank, without constant ones; a duty cycle of 0 remains if it is the only candidate.

    A condition may be constant for all of a recording, but must be possible.
    """
    if name in PLAUSIBLE:
        chosen = [candidate for candidate in named if not _implausible(candidate)]
    else:
        chosen = [candidate for candidate in named if not candidate.span.constant]
    if not chosen and name in INPUTS and len(named) == 1 and named[0].span.high == 0.0:
        chosen = list(named)
    return sorted(chosen, key=lambda candidate: candidate.rank)


def _remark(best: Candidate, equal: Sequence[Candidate], tabular: bool) -> str:
    """Decision that a proposed channel needs, which others may `equal`; empty if none.

    A unit that is guessed under the standard name needs one only where the user can write it into a heading.
    """
    name, text = best.name, best.heading.text
    if equal:
        same = any(candidate.heading.text == text for candidate in equal)
        own, *others = [
            f"'{match.heading.text}'" + (f" of '{match.raster.name}'" if same and match.raster.name else "")
            for match in (best, *equal[:5])
        ]
        may = "may be it" if name in PLAUSIBLE else "is proposed"
        return f"{name}: {own} {may}, but {', '.join(others)} would match as well."
    if best.circuit is Circuit.BRAKES:  # too far from a clutch to be sure
        return f"{name}: '{text}' is in a circuit of the brakes, whose pressure falls with braking."
    if best.flag and is_beside(text):
        return f"{name}: '{text}' {best.flag}; write it into a channel map if it is the duty cycle."
    if best.guess and (tabular or best.score < STANDARD):
        return f"{name}: '{text}' {best.guess}."
    return "" if best.unit else f"{name}: '{text}' has no known unit; add it to the map."


def _notes(best: Candidate, others: Sequence[Candidate]) -> Iterator[str]:
    """Implications of the name and the samples of a proposed channel, and the `others` that match less."""
    name, own = best.name, f"{best.name}: '{best.heading.text}'"
    names = listed(f"'{other.heading.text}'" for other in others)
    if best.circuit is not None and others:
        yield f"{own} is proposed, because {_REASONS[best.circuit]}; others are {names}."
    if name in INPUTS and best.score < STANDARD and others:
        yield f"{own} is proposed; by name it may also be {names}."
    if best.implied:
        yield f"{own} [{best.heading.unit or best.unit}] {best.implied}."
    if best.guess and best.score >= STANDARD:
        yield f"{own} {best.guess}."
    if best.heading.unit is None and best.unit and not best.guess:
        yield f"{name}: the unit [{best.unit}] is taken from the name of the channel '{best.heading.text}'."
    if best.span.constant and name not in PLAUSIBLE:
        yield f"{own} is constant at {best.span.low:g}."


def _missing(source: Source, name: str, named: Sequence[Candidate], left: Sequence[Heading]) -> str:
    """Remark on a quantity without a channel, which only constant ones, set points or texts are called like."""
    if named:
        names = ", ".join(f"'{candidate.heading.text}' (always {candidate.span.low:g})" for candidate in named[:5])
        return f"{name}: only constant channels match by name, {names}; add the right one to the map."
    for text, held in (other for raster in source.rasters for other in raster.others):
        if name_score(name, text) > 0.0:
            stamps = "seconds, or times such as 2024-05-01T12:00:00.001 and 12:00:00.001"
            return f"{name}: '{text}' holds {held}; write {stamps if name == 'time' else 'numbers'}."
    for heading in source.headings:
        wanted = is_set_point(heading.text) and name_score(name, heading.text) > 0.0
        if wanted and is_unit_of(name, heading.unit) and name not in INPUTS:
            return f"{name}: only a set point matches by name, '{heading.text}'; add the measured channel to the map."
    if name == "time":
        return "time: no channel name matches; add it to the map, or the rate of the samples in Hz as `rate`."
    shown = listed((f"'{heading.text}'" for heading in left), _LISTED)
    choice = f"candidates: {shown}" if shown else "no channel has a suitable unit"
    return f"{name}: no channel name matches; add it to the map ({choice})."


def _left(source: Source, name: str, channels: Mapping[str, Channel]) -> list[Heading]:
    """Channels that a missing quantity may be: those with a unit of it, else those without a unit."""
    taken = {"", *(entry.channel for entry in channels.values())}
    free = [
        heading
        for raster in source.rasters
        for heading in raster.headings
        if heading.text not in taken | dict(raster.others).keys()
    ]
    return [heading for heading in free if is_unit_of(name, heading.unit)] or [h for h in free if h.unit is None]


def _entry(source: Source, best: Candidate) -> Channel:
    same = sum(heading.text == best.heading.text for heading in source.headings)
    entry = Channel(best.heading.text, group=best.raster.name if same > 1 else None)
    return replace(entry, unit=best.unit) if best.heading.unit != best.unit else entry
