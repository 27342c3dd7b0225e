"""The parts of a virtual truck, two for each slot; a family is a choice of parts, and a hybrid another one.

>>> parts_of("AAAAAAAAB").sensor.name, parts_of("AAAAAAAAB").letters
('curved scale and coloured noise', 'AAAAAAAAB')
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from clutchid.truck.parts import clutch as diaphragm
from clutchid.truck.parts import driving, flow, friction, gas, hump, sensor, supply, valves
from clutchid.truck.parts.part import Clutch, Driving, Flow, Friction, Gas, Sensor, Supply, Tube, Valves
from clutchid.truck.structure import Structure

#: Slots whose parts have states of their own.
STATEFUL = slice(3, 7)


class Parts(NamedTuple):
    """A part for each slot."""

    valves: Valves
    driving: Driving
    flow: Flow
    gas: Gas
    tube: Tube
    supply: Supply
    friction: Friction
    clutch: Clutch
    sensor: Sensor

    @property
    def letters(self) -> str:
        """Family that each part is of, in the order of the slots."""
        return "".join("AB"[part is other] for part, other in zip(self, PARTS["B"], strict=True))

    @property
    def structure(self) -> Structure:
        """Structure of the equations, which needs a compiled loop of its own."""
        own = (self.gas.module, bool(self.tube.module), self.supply.module, self.friction.module)
        family = next((parts for parts in PARTS.values() if parts[STATEFUL] == self[STATEFUL]), None)
        return Structure(family.flow.module if family else "either", *own)


#: The parts of the families.
PARTS = {
    "A": Parts(
        valves.ON_OFF, driving.LATCHED, flow.ISO, gas.ENERGY, gas.DIRECT, supply.RESERVOIR, friction.BRISTLES,
        diaphragm.DIAPHRAGM, sensor.VIBRATING,
    ),
    "B": Parts(
        valves.SERVO, driving.FREE, flow.NOZZLE, gas.POLYTROPIC, gas.TUBE, supply.REGULATOR, friction.SLIP,
        hump.HUMP, sensor.CURVED,
    ),
}  # fmt: skip


@cache
def parts_of(letters: str) -> Parts:
    """The parts by the letters of their families, in the order of the slots."""
    return Parts(*(PARTS[letter][slot] for slot, letter in enumerate(letters)))  # type: ignore[arg-type]
