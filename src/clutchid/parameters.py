"""`Parameters`: the Appendix of the paper as code, one row per parameter.

Each row holds value, unit, meaning, admissible range and source; documentation tables, parameter files and exports read
the same rows. The load weights theta are part of a `clutchid.model.Load`, because a weight is meaningless
without its basis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import ParameterError
from clutchid.names import unknown_name

_APPENDIX = "Appendix A"
_ERRATA = "not in the paper, docs/deviations.md"
_BALANCE = "energy balance, docs/models.md"
_SENSORS = "sensors, docs/methods.md"
_STRIBECK = "Stribeck friction, docs/models.md"


@dataclass(frozen=True, slots=True)
class Row:
    """Unit, meaning, admissible range and source of one parameter."""

    unit: str
    meaning: str
    low: float
    high: float
    low_included: bool
    source: str

    def admits(self, value: float) -> bool:
        """Whether `value` lies in the admissible range."""
        above = value >= self.low if self.low_included else value > self.low
        return math.isfinite(value) and above and value <= self.high

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest admissible value, or infinity."""
        return self.low, self.high

    @property
    def allowed(self) -> str:
        """The admissible range in words."""
        lower = f"{'at least' if self.low_included else 'above'} {self.low:g}" if math.isfinite(self.low) else ""
        upper = f"at most {self.high:g}" if math.isfinite(self.high) else ""
        return " and ".join(part for part in (lower, upper) if part) or "any finite number"


def _row(
    value: float,
    unit: str,
    meaning: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float = math.inf,
    source: str = _APPENDIX,
) -> Any:
    low = above if above is not None else at_least if at_least is not None else -math.inf
    return field(default=value, metadata={"row": Row(unit, meaning, low, at_most, above is None, source)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Parameters of the actuator in SI; the defaults are the paper's Appendix A.

    Raises
    ------
    ParameterError
        If values are outside their admissible ranges; the text lists all of them.

    Examples
    --------
    The supply pressure holds against 9.7 kN on the piston of chamber A:

    >>> p = Parameters()
    >>> f"{p.A_A * (p.P_S - p.P_0):.0f} N"
    '9723 N'
    """

    A_A: float = _row(12.3e-3, "m²", "area of the piston in chamber A", above=0)
    A_B: float = _row(11.848e-3, "m²", "area of the piston in chamber B", above=0)
    V_0A: float = _row(0.148e-3, "m³", "volume of chamber A at y = 0", above=0)
    V_0B: float = _row(1.2e-4, "m³", "dead volume of chamber B at y = y_max", above=0)
    P_0: float = _row(1.095e5, "Pa", "ambient pressure", above=0)
    T_0: float = _row(293.0, "K", "temperature", above=0)
    R: float = _row(288.0, "J/(kg·K)", "gas constant of air", above=0)
    M: float = _row(10.0, "kg", "mass of the piston", above=0)
    P_S: float = _row(9e5, "Pa", "supply pressure, absolute", above=0)
    D_v: float = _row(5000.0, "N·s/m", "viscous friction", at_least=0)
    K_z: float = _row(1e6, "N/m", "stiffness of the seal deflection", above=0)
    D_zdot: float = _row(5000.0, "N·s/m", "damping of the seal deflection", at_least=0)
    F_C: float = _row(200.0, "N", "Coulomb friction", above=0)
    R_0vs: float = _row(0.07, "1", "duty cycle where the supply valve starts to open", at_least=0, at_most=1)
    R_0ve: float = _row(0.07, "1", "duty cycle where the exhaust valve starts to open", at_least=0, at_most=1)
    R_1vs: float = _row(0.93, "1", "duty cycle where the supply valve is fully open", above=0, at_most=2)
    R_1ve: float = _row(0.93, "1", "duty cycle where the exhaust valve is fully open", above=0, at_most=2)
    B_vs: float = _row(0.1, "1", "flow shape of the supply valve", at_least=-1, at_most=1)
    B_ve: float = _row(-0.7, "1", "flow shape of the exhaust valve", at_least=-1, at_most=1)
    C_vs: float = _row(19e-9, "m³/(Pa·s)", "conductance of the supply valve", at_least=0)
    C_ve: float = _row(21.4e-9, "m³/(Pa·s)", "conductance of the exhaust valve", at_least=0)
    C_r: float = _row(5e-8, "m³/(Pa·s)", "conductance of the orifice of chamber B", at_least=0)
    B_0: float = _row(0.582, "1", "critical pressure ratio of air", above=0, at_most=0.99)
    B_in: float = _row(0.5, "1", "flow shape of the orifice of chamber B, inwards", at_least=-1, at_most=1)
    B_out: float = _row(0.5, "1", "flow shape of the orifice of chamber B, outwards", at_least=-1, at_most=1)
    rho_0: float = _row(1.185, "kg/m³", "reference density of air", above=0, source=f"ISO 6358; {_ERRATA}")
    y_max: float = _row(0.025, "m", "stroke of the piston", above=0, source="Section 3.1, operation range [0, 25] mm")
    r_lam: float = _row(
        0.999, "1", "pressure ratio above which the flow is laminar", above=0.5, at_most=0.99999, source=_ERRATA
    )
    K_stop: float = _row(3e7, "N/m", "stiffness of the end stops", above=0, source=_ERRATA)
    D_stop: float = _row(1e4, "N·s/m", "damping of the end stops", at_least=0, source=_ERRATA)
    d_stop: float = _row(1e-4, "m", "penetration over which the end stop force builds up", above=0, source=_ERRATA)
    b_vs: float = _row(
        0.3, "1", "critical pressure ratio of the supply valve", at_least=0, at_most=0.9, source=_BALANCE
    )
    m_vs: float = _row(0.5, "1", "subsonic index of the supply valve", above=0, at_most=3, source=_BALANCE)
    b_ve: float = _row(
        0.3, "1", "critical pressure ratio of the exhaust valve", at_least=0, at_most=0.9, source=_BALANCE
    )
    m_ve: float = _row(0.5, "1", "subsonic index of the exhaust valve", above=0, at_most=3, source=_BALANCE)
    gamma: float = _row(1.4, "1", "ratio of specific heats of air", above=1, at_most=2, source=_BALANCE)
    T_w: float = _row(293.0, "K", "temperature of the chamber walls", above=0, source=_BALANCE)
    h_A: float = _row(50.0, "W/(m²·K)", "heat transfer to the wall of chamber A at 1 bar", at_least=0, source=_BALANCE)
    h_B: float = _row(50.0, "W/(m²·K)", "heat transfer to the wall of chamber B at 1 bar", at_least=0, source=_BALANCE)
    V_S: float = _row(10e-3, "m³", "volume of the supply reservoir", above=0, source=_BALANCE)
    tau_S: float = _row(0.6, "s", "time in which the reservoir recovers", above=0, source=_BALANCE)
    tau_G: float = _row(10.0, "s", "time in which the compressor's governor returns to P_S", above=0, source=_BALANCE)
    F_h: float = _row(25.0, "N", "release bearing: friction without load", above=0, source=_BALANCE)
    mu_h: float = _row(
        0.03, "1", "half the hysteresis of the load, as a fraction of it", at_least=0, at_most=0.3, source=_BALANCE
    )
    K_h: float = _row(5e5, "N/m", "stiffness of bearing and fork before they slip", above=0, source=_BALANCE)
    R_S: float = _row(1.3, "1", "ratio of static to Coulomb friction", at_least=1, at_most=5, source=_STRIBECK)
    v_S: float = _row(0.01, "m/s", "Stribeck velocity, at which static friction decays", above=0, source=_STRIBECK)
    c_F: float = _row(1.5e-4, "m²", "Coulomb friction that pressure on the seal adds", at_least=0, source=_STRIBECK)
    T_pwm: float = _row(0.0, "s", "period of the valves' carrier; 0: averaged valves", at_least=0, source=_BALANCE)
    s_pwm: float = _row(
        0.0, "1", "phase at which a period starts in a recording", at_least=-0.5, at_most=0.5, source=_BALANCE
    )
    s_vs: float = _row(
        0.0, "1", "supply valve: phase of its opening in the period", at_least=-0.5, at_most=0.5, source=_BALANCE
    )
    s_ve: float = _row(
        0.0, "1", "exhaust valve: phase of its opening in the period", at_least=-0.5, at_most=0.5, source=_BALANCE
    )
    t_vs: float = _row(
        0.0,
        "1",
        "supply valve: travel of its armature, as a fraction of a period",
        at_least=0,
        at_most=1,
        source=_BALANCE,
    )
    t_ve: float = _row(
        0.0,
        "1",
        "exhaust valve: travel of its armature, as a fraction of a period",
        at_least=0,
        at_most=1,
        source=_BALANCE,
    )
    a_0vs: float = _row(
        0.0,
        "1",
        "supply valve: relative opening of its full pulses at R_0vs",
        at_least=0,
        at_most=0.9,
        source=_BALANCE,
    )
    a_0ve: float = _row(
        0.0,
        "1",
        "exhaust valve: relative opening of its full pulses at R_0ve",
        at_least=0,
        at_most=0.9,
        source=_BALANCE,
    )
    tau_y: float = _row(0.0, "s", "lag of the recorded position", at_least=0, at_most=0.05, source=_SENSORS)
    tau_p: float = _row(0.0, "s", "lag of the recorded pressure", at_least=0, at_most=0.05, source=_SENSORS)
    e_y: float = _row(0.0, "m", "offset of the recorded position", at_least=-2e-3, at_most=2e-3, source=_SENSORS)
    e_p: float = _row(0.0, "Pa", "offset of the recorded pressure", at_least=-5e4, at_most=5e4, source=_SENSORS)

    def __post_init__(self) -> None:
        problems = []
        for item in fields(self):
            row, value = item.metadata["row"], getattr(self, item.name)
            if not is_number(value):
                problems.append(f"{item.name} = {_short(value)}: a number in {row.unit} is needed.")
            elif not row.admits(float(value)):
                problems.append(f"{_shown(item.name, float(value), row)}: {_advice(item, row)}")
            else:
                object.__setattr__(self, item.name, float(value))
        if not problems:
            for valve, low, high in (("vs", self.R_0vs, self.R_1vs), ("ve", self.R_0ve, self.R_1ve)):
                if low >= high:
                    problems.append(
                        f"R_0{valve} = {low:g} must be below R_1{valve} = {high:g}: a valve opens with rising duty "
                        "cycle."
                    )
            if self.A_B > self.A_A:
                problems.append(
                    f"A_B = {self.A_B:g} m² must not exceed A_A = {self.A_A:g} m²: the rod reduces the area of chamber "
                    "B."
                )
        if problems:
            raise ParameterError("\n".join(problems))

    def __repr__(self) -> str:
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        changed = [f"{item.name}={values[item.name]!r}" for item in fields(self) if values[item.name] != item.default]
        return f"Parameters({', '.join(changed)})"

    @classmethod
    @cache
    def names(cls) -> tuple[str, ...]:
        """Names in the order of the paper's Appendix, which is also that of `array`."""
        return tuple(item.name for item in fields(cls))

    @classmethod
    def row(cls, name: str) -> Row:
        """The row of the parameter `name`.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        for item in fields(cls):
            if item.name == name:
                row: Row = item.metadata["row"]
                return row
        raise ParameterError(unknown_name(name, cls.names()))

    def array(self) -> NDArray[np.float64]:
        """Values in the order of `names`, shape (n_parameters,)."""
        return np.array([getattr(self, name) for name in self.names()], dtype=np.float64)

    def replace(self, changes: Mapping[str, float] | None = None, /, **by_name: float) -> Parameters:
        """A copy with changed values, validated again: ``replace({"P_S": 7e5})`` or ``replace(P_S=7e5)``.

        Raises
        ------
        ParameterError
            For an unknown name or a value outside its range.
        """
        changes, known = {**(changes or {}), **by_name}, self.names()
        unknown = [unknown_name(name, known) for name in changes if name not in known]
        if unknown:
            raise ParameterError("\n".join(unknown))
        return replace(self, **changes)


def is_number(value: object) -> bool:
    """Whether a value, of a TOML file for example, is a number within the range of a float."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
        return False
    try:
        float(value)  # TOML has no largest integer
    except OverflowError:
        return False
    return True


def _shown(name: str, value: float, row: Row) -> str:
    return f"{name} = {value:g}" + ("" if row.unit == "1" else f" {row.unit}")


def _short(value: object) -> str:
    """A value as it is written, or its beginning."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:39]}…"


def _advice(item: Field[float], row: Row) -> str:
    noun = "a conductance" if item.name.startswith("C_") else "it"
    origin = _APPENDIX if row.source == _APPENDIX else "The default"
    return f"{noun} is {row.allowed}. {origin} {'has' if origin == _APPENDIX else 'is'} {item.default:g}."
