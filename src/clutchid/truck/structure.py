"""`Structure` of the compiled plant of a truck, one of 16: the parts whose states differ."""

from __future__ import annotations

from typing import NamedTuple

#: States of supplies and frictions; those of the air are two a zone, and all trucks have y, v, x_s and x_e.
_STATES = {
    "reservoir": ("m_S", "U_S", "p_G"), "regulator": ("p_S", "x_R"), "bristles": ("z", "z_h"),
    "slip": ("z_1", "z_2", "z_3", "z_4", "z_b", "z_f"),
}  # fmt: skip

#: Further states with a ledger: mass and energy that have entered across the boundary of the plant.
LEDGER = ("m_in", "E_in")


class Structure(NamedTuple):
    """Modules of `clutchid.truck.equations` for air, supply and friction, and whether there is a tube.

    `flow` has no states, so it is a flag of most plants ("either"); those of the families have theirs alone ("iso",
    "nozzle"), because a branch more would round otherwise.
    """

    flow: str
    gas: str
    tube: bool
    supply: str
    friction: str

    @property
    def words(self) -> tuple[str, ...]:
        """Its parts in words."""
        return self.flow, self.gas, "tube" if self.tube else "direct", self.supply, self.friction

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states of the plant."""
        second = "U" if self.gas == "energy" else "p"
        air = [f"{name}_{zone}" for zone in ("ADB" if self.tube else "AB") for name in ("m", second)]
        return ("y", "v", *air, *_STATES[self.supply], *_STATES[self.friction], "x_s", "x_e")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Inputs, constant over a tick: rates of both lifts, and of the governor's pressure where there is one."""
        return ("r_s", "r_e", "r_G") if self.supply == "reservoir" else ("r_s", "r_e")
