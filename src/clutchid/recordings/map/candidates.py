"""Channels of a file that may be a quantity by name and unit, each with its score, its range and its unit.

Supply pressure and temperature of the air are conditions of a recording, which any vehicle may have. No fit needs them,
so what is unclear about one is a note, and a file is read without it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from clutchid.log import INPUTS
from clutchid.log.units import UNITS
from clutchid.recordings.columns import QUANTITIES, Heading, unit_at_end
from clutchid.recordings.formats.can.j1939 import parameter_in
from clutchid.recordings.map.channel_map import Channel
from clutchid.recordings.map.channel_words import Circuit, circuit_of, is_named_by_j1939, is_set_point, name_score
from clutchid.recordings.map.picking import own_clock
from clutchid.recordings.map.ranges import PLAUSIBLE, Range, Ranges, gauge_unit, guessed_unit
from clutchid.recordings.source import Raster, Source
from clutchid.recordings.table import and_more

#: Score of a channel with the standard name of the quantity.
STANDARD = 100.0

#: What the name of a set point costs a duty cycle: the one that is measured is preferred.
_SET_POINT = 0.25


#: Why the channel of a circuit is proposed.
_REASONS = {
    Circuit.POWERTRAIN: "it is that of the powertrain or the clutch",
    Circuit.AUXILIARIES: "the circuit of auxiliaries (circuit 4) usually supplies the clutch actuator",
    Circuit.SUPPLY: "no channel is nearer to the clutch than the supply as a whole",
    Circuit.BRAKES: "no other is recorded; check, because braking lowers the circuits of the brakes",
}

_SHOWN = 5


@dataclass(frozen=True, slots=True)
class Candidate:
    """A channel that may be a quantity, its score, its range, and its unit with the reason if that is a guess.

    `implied` is what else is assumed of the unit.
    """

    raster: Raster
    heading: Heading
    score: float
    seen: Range
    unit: str | None
    guess: str
    implied: str = ""


def candidates(source: Source, name: str, ranges: Ranges) -> Iterator[Candidate]:
    """Channels that are called like the quantity `name`, and have a unit of it or none."""
    for index, raster in enumerate(source.rasters):
        clock, _ = own_clock(raster)
        texts = {text for text, _ in raster.others}
        for heading in raster.headings:
            if heading.text in texts or (clock is not None and heading.index == clock.index and name != "time"):
                continue
            score = _score(name, heading)
            if score <= 0.0 or not (heading.unit is None or fits(name, heading.unit)):
                continue
            seen = ranges(index, heading, further=score < STANDARD and name not in PLAUSIBLE)
            seen = seen._replace(constant=seen.constant and score < STANDARD)
            unit = heading.unit or unit_at_end(heading.text, QUANTITIES[name])
            found = Candidate(raster, heading, score + (0.5 if unit else 0.0), seen, *_unit(name, unit, seen))
            yield _gauge_of_standard(found) if name == "pressure_supply" and score < STANDARD else found


def _score(name: str, heading: Heading) -> float:
    """How well a channel is called like a quantity; what a controller asks for is none but a duty cycle."""
    if heading.name == name:
        return STANDARD
    score = name_score(name, standard_title(heading) if name in PLAUSIBLE else heading.text)
    if score >= STANDARD or not is_set_point(heading.text):
        return score
    return max(score - _SET_POINT, 0.0) if name in INPUTS else 0.0


def _gauge_of_standard(found: Candidate) -> Candidate:
    """A supply pressure in the gauge unit if it is one by the standard of the bus."""
    gauge = f"{found.unit}(g)"
    if gauge not in UNITS or not gauge_by_standard(found.heading):
        return found
    return replace(found, unit=gauge, implied="is a gauge pressure by SAE J1939-71")


def gauge_as_well(found: Candidate, chamber: Channel | None) -> Candidate:
    """A supply pressure in the gauge unit if the range of the `chamber` pressure says that it is, in the same unit."""
    gauge = f"{found.unit}(g)"
    if gauge not in UNITS or found.score >= STANDARD:
        return found
    if chamber is not None and chamber.unit == gauge:
        return replace(found, unit=gauge, implied=f"is taken as gauge pressure, as '{chamber.channel}' is")
    return replace(found, implied=f"is read as absolute; write {gauge} in a channel map if it is a gauge pressure")


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


def fits(name: str, unit: str | None) -> bool:
    """Whether a unit is one of the quantity `name`."""
    return unit is not None and unit in UNITS and UNITS[unit].si == QUANTITIES[name]


def standard_title(heading: Heading) -> str:
    """What SAE J1939-71 calls a channel that its comment or its name identifies; else its name."""
    found = parameter_in(heading.comment) or parameter_in(heading.text)
    return found.title if found else heading.text


def gauge_by_standard(heading: Heading) -> bool:
    """Whether a pressure is one of SAE J1939-71 that counts from the ambient pressure."""
    found = parameter_in(heading.comment) or parameter_in(heading.text)
    return not found.absolute if found else is_named_by_j1939(heading.text)


def implausible(name: str, heading: Heading, unit: str | None, seen: Range) -> str:
    """Why the samples of a channel cannot be the condition `name`, in a sentence; empty if they can."""
    if math.isnan(seen.low) or (seen.constant and seen.low == 0.0):
        return f"{name}: '{heading.text}' has no values and is left out."
    known = UNITS.get(unit or "")
    if known is None:
        return ""
    low, high = (value * known.scale + known.offset for value in (seen.low, seen.high))
    least, most = PLAUSIBLE[name]
    if least <= low and high <= most:
        return ""
    what = "an air supply" if name == "pressure_supply" else "the air"
    return (
        f"{name}: '{heading.text}' is {seen.low:.4g} to {seen.high:.4g} {unit}, which {what} never has; it is left out."
    )


def reason(chosen: Heading, others: Sequence[Heading]) -> str:
    """Why of several pressures one is proposed as that of the supply; empty where there is no other, and it is sure."""
    circuit = circuit_of(standard_title(chosen))
    if circuit is None or not (others or circuit is Circuit.BRAKES):
        return ""
    beside = ""
    if others:
        names = [f"'{heading.text}'" for heading in others[:_SHOWN]]
        beside = f"; others are {and_more(names, len(others) - len(names))}"
    return f"pressure_supply: '{chosen.text}' is proposed, because {_REASONS[circuit]}{beside}."


def is_sure(chosen: Heading) -> bool:
    """Whether a pressure is near enough to a clutch actuator to be used without being confirmed."""
    return circuit_of(standard_title(chosen)) is not Circuit.BRAKES
