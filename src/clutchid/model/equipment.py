"""Parts of an actuator: chamber B, a supply valve, an exhaust valve, or one 3/2 valve in place of both."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.names import unknown_name
from clutchid.parameters import Parameters

#: Valves by name, with the duty cycles that a recording needs for them.
VALVES = MappingProxyType(
    {"supply and exhaust": INPUTS, "supply": INPUTS[:1], "exhaust": INPUTS[1:], "3/2": INPUTS[:1]}
)

#: Parameters that stand for a chamber B that does not exist. Its pressure then is P_0, always: a reservoir of 1 m³
#: that the piston does not squeeze, neither breathes nor warms. The area is not 0, as formulas divide by it.
_NO_CHAMBER_B = MappingProxyType({"A_B": 1e-9, "V_0B": 1.0, "C_r": 0.0, "h_B": 0.0})


@dataclass(frozen=True, slots=True)
class Equipment:
    """Chambers and valves of an actuator, and its name; by default those of the paper.

    Parameters
    ----------
    name, description : text
        For people; a name is one line.
    chamber_b : bool
        Whether there is a chamber B that breathes through an orifice; without it p_B is P_0, always.
    valves : 'supply and exhaust', 'supply', 'exhaust' or '3/2'
        A valve that does not exist passes nothing, and its duty cycle need not be recorded. A 3/2 valve supplies where
        its one duty cycle, ``duty_supply``, is 1, and vents where it is 0.

    Raises
    ------
    ParameterError
        If an entry is of another type, or there are no such valves.

    Examples
    --------
    >>> Equipment(valves="3/2").recorded
    ('duty_supply',)
    """

    name: str = ""
    description: str = ""
    chamber_b: bool = True
    valves: str = "supply and exhaust"

    def __post_init__(self) -> None:
        problems = []
        for key in ("name", "description"):
            text = getattr(self, key)
            if not isinstance(text, str) or (key == "name" and not text.isprintable()):
                problems.append(f"[actuator] {key} = {text!r}: a text in quotes is needed, a name on one line.")
        if not isinstance(self.chamber_b, bool):
            problems.append(f"[actuator] chamber_b = {self.chamber_b!r}: true or false.")
        if self.valves not in list(VALVES):
            problems.append(f"[actuator] {unknown_name(str(self.valves), VALVES, 'set of valves')}")
        ParameterError.raise_for(problems)

    @property
    def recorded(self) -> tuple[str, ...]:
        """Duty cycles that a recording must have."""
        return VALVES[self.valves]

    @property
    def fixed(self) -> dict[str, float]:
        """Parameters that stand for what does not exist, with their values."""
        values = {} if self.chamber_b else dict(_NO_CHAMBER_B)
        values |= {"C_vs": 0.0} if self.valves == "exhaust" else {}
        return values | ({"C_ve": 0.0} if self.valves == "supply" else {})

    def missing(self, name: str) -> str:
        """Reason why the parameter `name` has no meaning here, in words; empty where it has one."""
        rows = Parameters.rows()
        part = rows[name].part if name in rows else ""
        if not self.chamber_b and part == "chamber B":
            return f"{name}: this actuator has no chamber B ([actuator] chamber_b = false); leave {name} out."
        for valves, other in (("exhaust", "supply"), ("supply", "exhaust")):
            if self.valves == valves and part == f"{other} valve":
                return f"{name}: this actuator has no {other} valve ([actuator] valves = '{valves}'); leave {name} out."
        return ""

    def fitted(self, parameters: Parameters) -> Parameters:
        """`parameters` with the values that stand for what does not exist.

        Raises
        ------
        ParameterError
            Where the piston's area is smaller than what stands for no area.
        """
        fixed = self.fixed
        return parameters.replace(fixed) if any(getattr(parameters, k) != v for k, v in fixed.items()) else parameters

    def driven(self, log: Log) -> Log:
        """`log` with a duty cycle for both valves of the model, where only that of the existing one is recorded.

        Examples
        --------
        >>> pulse = Log(np.arange(3.0), {"duty_supply": np.array([0.0, 1.0, 0.0])})
        >>> Equipment(valves="3/2").driven(pulse)["duty_exhaust"].tolist()
        [1.0, 0.0, 1.0]
        """
        lacking = [name for name in INPUTS if name not in log and name not in self.recorded]
        if not lacking or any(name not in log for name in self.recorded):
            return log
        return log.with_columns(**{name: self._other(log) for name in lacking})

    def _other(self, log: Log) -> FloatArray:
        recorded = log[self.recorded[0]]
        return 1.0 - recorded if self.valves == "3/2" else np.zeros(recorded.size)
