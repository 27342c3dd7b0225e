"""Channels of the conditions of a recording: supply pressure and temperature of the air, which any vehicle may have.

No fit needs them, so what is unclear about one is a note, and a file is read without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from clutchid.log.units import UNITS
from clutchid.recordings.columns import Heading
from clutchid.recordings.formats.can.j1939 import parameter_in
from clutchid.recordings.map.channel_words import Circuit, circuit_of, is_named_by_j1939
from clutchid.recordings.map.ranges import PLAUSIBLE, Range
from clutchid.recordings.table import and_more

#: Why the channel of a circuit is proposed.
_REASONS = {
    Circuit.POWERTRAIN: "it is that of the powertrain or the clutch",
    Circuit.AUXILIARIES: "the circuit of auxiliaries (circuit 4) usually supplies the clutch actuator",
    Circuit.SUPPLY: "no channel is nearer to the clutch than the supply as a whole",
    Circuit.BRAKES: "no other is recorded; check, because braking lowers the circuits of the brakes",
}

_SHOWN = 5


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
